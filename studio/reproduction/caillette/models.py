"""What a model that knows more is good for: Fig. 13, and online learning beyond the paper.

Fig. 13: how long the model should remember, 200 particles. A memory of one frame (a first-order Markov model) wastes
particles on the wrong clusters, says the paper; longer ones are more accurate. Beside the tracker's error stands what
the automaton itself tells of the test performance: its entropy (Eq. 2), which is what a longer memory can better at
all.

Online learning, the paper's second future work: a run adds to its model what it tracked well, and a second pass over
the same clip, never learnt before, is compared with the first. The tracker is the guided one with 1000 particles and a
model-free share, without which nothing new would be tracked that could be learnt. Blobs are fitted from the true pose,
so that only the dynamics differ between the passes.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from studio.body.catalogue import load_body
from studio.comparison.findings import Chart, Number, Series
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import number
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.caillette.comparing import (
    Error,
    Groups,
    angle,
    by_contender,
    curves,
    error_number,
    limb,
    mean_of,
    position,
    ratio,
    summary_table,
)
from studio.reproduction.caillette.following import Follow, Followed, follow_trial, followed, way_of
from studio.reproduction.caillette.following import measure as measure_following
from studio.reproduction.caillette.setting import (
    BLOBS,
    GUIDED,
    MEMORY,
    SIGMA,
    SOURCE,
    TEST,
    UNSEEN,
    guided,
    last_frame,
    taught_with,
    training_words,
)
from studio.reproduction.caillette.training_set import Training, learnt, recorded
from studio.reproduction.caillette.true_motion import true_motion
from studio.reproduction.drawing import line_chart, seed_range
from studio.reproduction.experiment import Experiment, concluding


def _taught(outcomes: Sequence[Outcome]) -> str:
    return training_words(len(outcomes[0].trial.arguments["training"]["sources"]) == 1)


# Fig. 13.

MEMORIES = (1, 2, 5, 10, 20, 30)
FEW = guided(200)
FRAMES = 200
"""Before the pirouettes, in which every tracker is lost whatever its model remembers."""


@dataclass(frozen=True, slots=True)
class Remembering:
    """Runs by memory, and what each automaton says of the test performance, in the order of MEMORIES."""

    groups: Groups
    asked: Sequence[Mapping[str, Any]]

    @classmethod
    def of(cls, outcomes: Sequence[Outcome]) -> "Remembering":
        """From the outcomes of all trials."""
        runs = [outcome for outcome in outcomes if "entropy_of" not in outcome.trial.arguments]
        asked = [outcome.measured for outcome in outcomes if "entropy_of" in outcome.trial.arguments]
        return cls(by_contender(runs), asked)


def group(memory: int) -> str:
    """The words for a memory."""
    return f"memory {memory}"


def _memory_trials(scale: Scale) -> tuple[Trial, ...]:
    """Every memory with every seed, and what each automaton says of the test performance."""
    last = last_frame(TEST, scale.quick, FRAMES)
    found = []
    for memory in MEMORIES:
        model = taught_with(memory, scale.quick)
        found += [
            follow_trial(FEW, group(memory), TEST, seed, last, from_truth=True, training=model)
            for seed in scale.seeds
        ]
        found.append(Trial(f"entropy, {group(memory)}", {"entropy_of": TEST, "last": last, **model.plain()}))
    return tuple(found)


@kept_as("caillette.fig_13.measure")
def measure_memory(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Track, or (where the arguments are a training set) ask the automaton."""
    if "entropy_of" not in arguments:
        return measure_following(arguments, shelf)
    wanted = {name: value for name, value in arguments.items() if name not in ("entropy_of", "last")}
    model = learnt(shelf, Training.of_plain(wanted)).model
    labels = model.labels(recorded(shelf, arguments["entropy_of"], load_body(model.space.body)).poses)
    return {
        "stays": float(np.mean(labels[1:] == labels[:-1])),
        "states": model.states,
        "train": model.making.entropy_train,
        "test": model.automaton.entropy([labels]),
    }


def _over_memory_1(
    memory: int, claim: str, of: Error = limb, what: str = ""
) -> Callable[[Remembering], Number]:
    name = f"memory {memory} over memory 1{what}"
    return lambda found: ratio(name, found.groups[group(memory)], found.groups[group(1)], claim, of)


def _falling(found: Remembering) -> Number:
    """Whether the error falls as the memory grows, in every seed."""
    ranked = np.arange(len(MEMORIES))
    values = []
    for runs in zip(*(found.groups[group(memory)] for memory in MEMORIES), strict=True):
        ranks = np.argsort(np.argsort([run.limb_rms for run in runs]))
        values.append(float(np.corrcoef(ranked, ranks)[0, 1]))
    return number("rank correlation of error and memory", values, "")


def _limb_of(memory: int) -> Callable[[Remembering], Number]:
    name = group(memory)
    return lambda found: error_number(f"limb direction, RMS: {name}", found.groups[name])


def _memory_words(found: Remembering, numbers: Sequence[Number]) -> str:
    """What the automata say of the test, where a longer memory does not help."""
    errors = ", ".join(f"{mean_of(found.groups[group(memory)]):.1f}" for memory in MEMORIES)
    asked, tests = found.asked, [entry["test"] for entry in found.asked]
    words = (
        f"RMS error of limb directions with memory {', '.join(map(str, MEMORIES))}: {errors}°, states "
        f"{', '.join(str(entry['states']) for entry in asked)}. "
    )
    said = (
        f"The automaton's entropy on the test performance is {', '.join(f'{value:.2f}' for value in tests)} nats a "
        f"frame (training {asked[0]['train']:.2f} to {asked[-1]['train']:.2f}), least with memory "
        f"{MEMORIES[int(np.argmin(tests))]}"
    )
    if all(claim.verdict != "not reproduced" for claim in numbers):
        return f"{words}A longer memory helps. {said}."
    return (
        f"{words}A longer memory does not help here. {said}: what long histories add is the training's own, which "
        "another performance does not repeat. From frame to frame the test stays in its cluster "
        f"{100 * asked[0]['stays']:.0f} % of the time, so a memory of some frames often is one cluster again and again."
    )


AXIS = tuple(float(memory) for memory in MEMORIES)


def _error_chart(found: Remembering) -> Chart:
    rows = ([run.limb_rms for run in found.groups[group(memory)]] for memory in MEMORIES)
    series = seed_range("200 guided particles (bars: lowest and highest seed)", AXIS, rows)
    return line_chart("Error over memory", "memory (frames)", "RMS limb direction error (°)", (series,))


def _entropy_chart(found: Remembering) -> Chart:
    series = (
        Series(label, AXIS, tuple(float(entry[name]) for entry in found.asked))
        for name, label in (("train", "training"), ("test", "test performance"))
    )
    return line_chart("Entropy over memory", "memory (frames)", "entropy (nats a frame)", series)


FIG_13 = Experiment(
    name="caillette-fig-13",
    title="Error over the model's memory",
    source=f"{SOURCE}, Fig. 13",
    claim="With 200 particles a memory of one frame wastes them on the wrong clusters; longer memories, up to 30 "
    "frames, are more accurate.",
    trials=_memory_trials,
    measure=measure_memory,
    conclude=concluding(
        Remembering.of,
        claims=(
            _over_memory_1(30, "lower"),
            _over_memory_1(10, "lower"),
            _over_memory_1(30, "", angle, ", joint angle"),
            _over_memory_1(30, "", position, ", joint position"),
            _falling,
            *(_limb_of(memory) for memory in MEMORIES),
        ),
        words=_memory_words,
        tables=(lambda found: summary_table("200 guided particles", found.groups),),
        charts=(_error_chart, _entropy_chart),
        settings=lambda outcomes: {
            "footage": TEST,
            "weighting": BLOBS,
            "particles": 200,
            "training": _taught(outcomes),
        },
    ),
    footage=(TEST,),
)

# Online learning.

PARTICLES, INTERVAL = 1000, 30
PLAIN, FIRST, SECOND = "not learning", "first pass, learning", "second pass, with what the first learnt"


@dataclass(frozen=True, slots=True)
class Passes:
    """Runs by pass; of every seed clusters and states before and after."""

    groups: Groups
    sizes: Sequence[Mapping[str, Any]]

    @classmethod
    def of(cls, outcomes: Sequence[Outcome]) -> "Passes":
        """From the outcomes of all trials."""
        measured = [outcome.measured for outcome in outcomes]
        names = (PLAIN, FIRST, SECOND)
        return cls({name: [Followed(**one["passes"][name]) for one in measured] for name in names}, measured)


def _online_trials(scale: Scale) -> tuple[Trial, ...]:
    """All three passes with every seed."""
    taught = taught_with(MEMORY, scale.quick)
    last = last_frame(UNSEEN, scale.quick)
    knobs = {
        "particles": PARTICLES,
        "model_free_share": 0.1,
        "estimate": "mode",
        "learning_interval": INTERVAL,
        **SIGMA,
    }
    return tuple(
        Trial(
            f"online learning, seed {seed}",
            Follow(UNSEEN, GUIDED, BLOBS, seed, last, knobs, from_truth=True, training=taught).plain(),
        )
        for seed in scale.seeds
    )


@kept_as("caillette.online_learning.measure")
def measure_online(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """The passes, each the fields of `Followed`; clusters and states before and after."""
    wanted = Follow.of_plain(arguments)
    assert wanted.training is not None
    learning = dataclasses.replace(wanted, changes={**wanted.changes, "online_learning": True})
    model = learnt(shelf, wanted.training).model
    session = shelf.session(wanted.footage)
    truth = true_motion(shelf, session, wanted.last)
    plain = way_of(shelf, session, truth, wanted, model)
    first = way_of(shelf, session, truth, learning, model)
    assert first.model is not None
    second = way_of(shelf, session, truth, wanted, first.model)
    passes = {PLAIN: plain, FIRST: first, SECOND: second}
    return {
        "passes": {name: asdict(followed(session, truth, way)) for name, way in passes.items()},
        "clusters": [model.clusters, first.model.clusters],
        "states": [model.states, first.model.states],
    }


def _pass_ratio(name: str, ours: str, claim: str = "", of: Error = limb) -> Callable[[Passes], Number]:
    return lambda found: ratio(name, found.groups[ours], found.groups[PLAIN], claim, of)


def _pass_error(name: str) -> Callable[[Passes], Number]:
    return lambda found: error_number(f"limb direction, RMS: {name}", found.groups[name])


def _learnt_in_a_pass(what: str) -> Callable[[Passes], Number]:
    return lambda found: number(f"{what} learnt", [one[what][1] - one[what][0] for one in found.sizes], "")


def _pass_words(found: Passes, numbers: Sequence[Number]) -> str:
    limbs, places, shares = (
        {name: of(runs) for name, runs in found.groups.items()}
        for of in (
            mean_of,
            lambda runs: mean_of(runs, position),
            lambda runs: 100.0 * float(np.mean([np.mean(run.free) for run in runs])),
        )
    )
    return (
        f"On a clip never learnt the RMS error of limb directions is {limbs[PLAIN]:.1f}° without online "
        f"learning, {limbs[FIRST]:.1f}° while the run learns (a lesson every {INTERVAL} frames) and "
        f"{limbs[SECOND]:.1f}° in a second pass with what the first has learnt; joint positions "
        f"{places[PLAIN]:.0f}, {places[FIRST]:.0f} and "
        f"{places[SECOND]:.0f} mm RMS. Particles that go their own way are {shares[PLAIN]:.0f} %, "
        f"{shares[FIRST]:.0f} % and {shares[SECOND]:.0f} % of all. What is learnt is what was tracked, its errors "
        "included."
    )


ONLINE_LEARNING = Experiment(
    name="caillette-online-learning",
    title="A second pass with what the first has learnt",
    source="beyond the paper (its section 8)",
    claim="Online learning, where unseen sequences are added to the model, would be worthwhile: a second pass over a "
    "clip is more accurate than one whose model learnt nothing.",
    trials=_online_trials,
    measure=measure_online,
    conclude=concluding(
        Passes.of,
        claims=(
            _pass_ratio("second pass over one that learnt nothing", SECOND, "lower"),
            _pass_ratio("the same, joint angle", SECOND, of=angle),
            _pass_ratio("the same, joint position", SECOND, of=position),
            _pass_ratio("learning while tracking over not learning", FIRST),
            *(_pass_error(name) for name in (PLAIN, FIRST, SECOND)),
            *(_learnt_in_a_pass(what) for what in ("clusters", "states")),
        ),
        words=_pass_words,
        tables=(lambda found: summary_table("Passes over the clip", found.groups),),
        charts=(lambda found: curves("RMS limb direction error", found.groups),),
        settings=lambda outcomes: {
            "footage": UNSEEN,
            "particles": PARTICLES,
            "memory": MEMORY,
            "training": _taught(outcomes),
        },
    ),
    footage=(UNSEEN,),
)
