"""Body and shadow test on people whom this program did not draw, and on the half of the suite that chooses defaults.

Two clips of the real data are drawn by another program: clothed bodies that are not ours, a floor of skin's colour,
true lengths and a true start pose. What was the default, and what may become it, also track the other half.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from studio.garden.drawn_recipes import CHOOSING, HALVES, KINDS, clip_name
from studio.garden.reproduction.caillette.training_set import made_once
from studio.garden.reproduction.drawing import heat_chart
from studio.garden.reproduction.experiment import Part, each_seed, listed
from studio.garden.reproduction.open_questions.generalisation import (
    AS_A_RUN,
    EVALUATIONS,
    QUICK_FRAMES,
    QUICK_KINDS,
    REFINED,
    set_up_things_in_front,
)
from studio.garden.reproduction.tracking import Candidate, Runs, by_group, lost_percent, named_percent
from studio.results.comparison.findings import Plain, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import Tracked, TrackingTrial, pose_on_truth, track
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.results.drawing_footage.real_data import PREFIX, located
from studio.runs.setup.start_pose_file import keep_start_pose
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING
from studio.sessions.importers.importing import ImportOptions, import_source

ELSEWHERE, FRAMES = {"wood": "drawn-elsewhere/wood", "tiles": "drawn-elsewhere/tiles"}, 75
"""Clips of others in the real data, and the frames of each."""
EACH_PIXEL = {
    "mask_shadow_window": 1,
    "mask_shadow_colour": 0.04,
    "mask_shadow_floor": False,
    "mask_shadow_alike": 0.0,
    "mask_shadow_doubt": False,
}
"""The shadow test as it was: the colour of each pixel alone, each camera alone."""
NARROW = {**EACH_PIXEL, "mask_shadow_colour": 0.015}
TOGETHER: Mapping[str, Any] = {}
"""The default: the colour of neighbouring pixels together."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A body and the shadow test's knobs. reported : whether it tracks the reporting half, too."""

    name: str
    body: str
    knobs: Mapping[str, Any]
    reported: bool = False

    def attempt(self, footage: str, last: int, seed: int) -> TrackingTrial:
        """The default tracker, its frames refined and the shape taken from the first ones as a run does."""
        candidate = Candidate(self.name, DEFAULT_TRACKER, DEFAULT_WEIGHTING, {**REFINED, **self.knobs})
        return candidate.attempt(footage, seed, EVALUATIONS, last=last, body=self.body, **AS_A_RUN)


BEFORE = Choice("human31, each pixel alone", "human31", EACH_PIXEL, reported=True)
CHOICES = (
    BEFORE,
    Choice("human31", "human31", TOGETHER),
    Choice("human34", "human34", TOGETHER),
    Choice("human34, each pixel alone, colour within 0.015", "human34", NARROW),
    Choice("human35", "human35", TOGETHER, reported=True),
)


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every choice on every clip with every seed, clip by clip."""
    planned: list[Trial] = []
    for half in HALVES:
        choices = [one for one in CHOICES if half == CHOOSING or one.reported]
        kinds = [kind for kind in KINDS if kind in QUICK_KINDS or not scale.quick]
        clips = {clip_name(half, kind): KINDS[kind].frames for kind in kinds}
        if half == CHOOSING:
            clips |= {PREFIX + place: FRAMES for place in ELSEWHERE.values()}
        for clip, frames in clips.items():
            last = QUICK_FRAMES if scale.quick else frames
            for one in choices:
                arguments = partial(_arguments, one, clip, last)
                planned += each_seed(f"{one.name} on {clip}", scale.seeds, arguments)
    return tuple(planned)


def _arguments(choice: Choice, clip: str, last: int, seed: int) -> dict[str, Any]:
    return {"attempt": choice.attempt(clip, last, seed).plain()}


@kept_as("open_questions.other_people.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Track a clip; the fields of `Tracked`."""
    plain = dict(arguments["attempt"])
    if plain["footage"].startswith(PREFIX):
        plain["footage"] = str(imported(plain["footage"], cache))
    set_up_things_in_front(cache.session(plain["footage"]))
    return asdict(track(TrackingTrial.of_plain(plain), cache))


def imported(clip: str, cache: FootageCache) -> Path:
    """The session of a clip of the real data, imported once, its start pose the true one. Raises StudioError."""
    source = located(clip, Path())

    def make(folder: Path) -> None:
        session = import_source(source, folder / "session", ImportOptions(copy=False)).session
        body = session.body()
        keep_start_pose(session, body, pose_on_truth(session, body, 0), 0)

    return (made_once(cache, "imported", {"clip": clip}, make) / "session").absolute()


MEAN: Callable[[Runs], float] = lambda runs: float(np.mean([run.mean_mm for run in runs]))  # noqa: E731


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Of each choice over the clips of both halves and the others': mean error, frames with a limb lost, and how many
    of them were named; a table by clip.
    """
    groups = by_group(outcomes)
    of_half = {half: {clip_name(half, kind): kind for kind in KINDS} for half in HALVES}
    sets = {
        "choosing half": of_half[CHOOSING],
        "clips of others": {PREFIX + place: name for name, place in ELSEWHERE.items()},
        "reporting half": next(clips for half, clips in of_half.items() if half != CHOOSING),
    }
    for called, clips in sets.items():
        # By choice and clip, a run a seed.
        by_choice: dict[str, dict[str, list[Tracked]]] = {}
        for one in CHOICES:
            runs = {name: groups.get(f"{one.name} on {clip}", []) for clip, name in clips.items()}
            by_choice[one.name] = {name: tracked for name, tracked in runs.items() if tracked}
        by_choice = {name: tracked for name, tracked in by_choice.items() if tracked}
        if by_choice:
            yield from _set(called, by_choice)
    yield {
        "tracker": DEFAULT_TRACKER,
        "weighting": DEFAULT_WEIGHTING,
        "evaluations": EVALUATIONS,
        "start": "the pose on the true markers (human31 on drawn clips: 4 mm beside them)",
    }


def _set(called: str, by_choice: Mapping[str, Mapping[str, Runs]]) -> Iterator[Part]:
    rows: list[tuple[Plain, ...]] = []
    names = list(dict.fromkeys(clip for clips in by_choice.values() for clip in clips))
    for choice, clips in by_choice.items():
        by_seed, words = list(zip(*clips.values(), strict=True)), f"{choice}, {called}"
        every = [run for runs in clips.values() for run in runs]
        lost = [float(np.mean([lost_percent(run) for run in runs])) for runs in by_seed]
        yield number(f"mean error, {words}", map(MEAN, by_seed), "mm", better="lower")
        yield number(
            f"worst clip, {words}",
            [max(run.mean_mm for run in runs) for runs in by_seed],
            "mm",
            better="lower",
        )
        yield number(f"frames with a limb lost, {words}", lost, "%", better="lower")
        yield number(
            f"named of frames with a limb lost, {words}",
            [named_percent(every, lost=True)],
            "%",
            better="higher",
        )
        yield number(
            f"named of other frames, {words}", [named_percent(every, lost=False)], "%", better="lower"
        )
        rows.append((choice, *(_cell(clips.get(name, [])) for name in names)))
    yield Table(
        f"{called}: mean / worst frame (mm) / frames with a limb lost / named of these, all seeds",
        ("choice", *names),
        tuple(rows),
    )
    cells = {choice: [MEAN(clips[name]) for name in names] for choice, clips in by_choice.items()}
    yield heat_chart(f"{called}: mean error (mm)", "clip", "choice", names, cells)


def _cell(runs: Runs) -> str:
    if not runs:
        return "–"
    pairs = [(bool(ours), bool(true)) for run in runs for ours, true in zip(run.named, run.lost, strict=True)]
    named = sum(ours for ours, true in pairs if true)
    return f"{MEAN(runs):.1f} / {max(run.worst_mm for run in runs):.0f} / {sum(true for _, true in pairs)} / {named}"


EXPERIMENTS = (
    listed(
        "other-people",
        trials,
        measure,
        shown,
        footage=tuple(clip_name(half, kind) for half in HALVES for kind in KINDS),
    ),
)
