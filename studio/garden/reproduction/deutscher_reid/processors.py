"""Section 6.3: particles farmed out to several processors are weighed faster in proportion to their number, about
0.8 times each.

Frames are searched with one and with two threads in turn, within one run on one machine, so that only ratios count.
The paper's filter takes 60 s a frame, all of it in the weighting; here a frame takes milliseconds, and the
serial part (drawing, noise, a lock) is larger, so the weighting alone is measured beside the whole frame.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from studio.foundations.numba_in_threads import numba
from studio.garden.benchmarks.timing import quickest
from studio.garden.reproduction.claims import beside
from studio.garden.reproduction.deutscher_reid.setting import CIRCLE, PLAIN, WEIGHTING
from studio.garden.reproduction.drawing import line, line_chart
from studio.garden.reproduction.experiment import Part, each_seed, listed, measured
from studio.results.comparison.findings import Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.runs.search_space import default_sigma, search_space
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import changed_settings, default_settings
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.tracker import start_of

PAPER = 0.8
PER_PROCESSOR = "speed-up per processor"
LAYERS, PARTICLES = 10, 2000
ROUNDS, QUICK_ROUNDS = 8, 3


def trials(scale: Scale) -> tuple[Trial, ...]:
    """One a seed."""
    rounds = QUICK_ROUNDS if scale.quick else ROUNDS
    fields = {"footage": CIRCLE, "rounds": rounds, "last": 1}
    return tuple(each_seed("processors", scale.seeds, lambda seed: {"seed": seed, **fields}))


@kept_as("deutscher_reid.processors.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Fewest milliseconds of a frame's search and of weighing one layer, for 1, 2, … threads in turn."""
    session = cache.session(arguments["footage"])
    body, cameras, seed = session.body(), session.cameras(), int(arguments["seed"])
    knobs = {**PLAIN, "layers": LAYERS, "particles": PARTICLES}
    settings = changed_settings(default_settings("annealed", WEIGHTING), knobs)
    weighting = WEIGHTINGS[WEIGHTING]
    seen = cache.evidence(session, cameras, 0, settings.evidence, weighting.edge_kind)
    problem = weighting.prepare(body, cameras, settings.weighting).problem(seen)
    sigma = default_sigma(body, session.manifest.fps)
    pose = session.start_pose(body)
    start = body.neutral if pose is None else pose
    poses = start + sigma * np.random.default_rng(seed).standard_normal((PARTICLES, len(start)))
    space = search_space(body, sigma)

    def frame() -> None:
        search_frame(
            TRACKERS["annealed"],
            problem,
            start_of(tuple(start)),
            space,
            seed=seed,
            frame=0,
            settings_source=lambda: (1, settings.tracker),
        )

    # A process that runs alone begins with one thread a core.
    threads = list(range(1, numba.get_num_threads() + 1))

    def milliseconds(work: Callable[[], object]) -> list[float]:
        every = dict.fromkeys(threads, work)
        seconds = quickest(every, arguments["rounds"], {count: count for count in threads})
        return [1000.0 * seconds[count] for count in threads]

    return {
        "threads": threads,
        "frame": milliseconds(frame),
        "weighing": milliseconds(lambda: problem.log_likelihood(poses)),
    }


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Speed-up over processors: of the weighing, which the paper distributes, and of whole frames, whose time its claim
    is about.
    """
    yield {"footage": CIRCLE, "layers": LAYERS, "particles": PARTICLES, "weighting": WEIGHTING}
    counts: list[int] = outcomes[0].measured["threads"]
    if len(counts) < 2:
        yield "This machine offers one processor, so there is nothing to compare."
        return
    spent = {what: measured(outcomes, what) for what in ("frame", "weighing")}
    speed = {what: times[:, :1] / times for what, times in spent.items()}
    for what, label in (("weighing", "weighing"), ("frame", "a whole frame")):
        for place, count in list(enumerate(counts))[1:]:
            name, paper = f"{PER_PROCESSOR}, {label}, {count} processors", PAPER if count == 2 else None
            yield beside(number(name, speed[what][:, place] / count, "", paper, "higher"))
    yield (
        "Answered, not judged: two cores of one machine are not the paper's processors. The paper farms out the "
        "weighing, which its frames spend their time on; here that takes milliseconds, so that drawing and noise, done "
        "by one, are a larger part of a whole frame. With 200 particles a "
        "layer there is too little to share and one thread does it all. Threads of one machine in turn, the quickest "
        "of the rounds; other programs on the machine lower the figures."
    )
    axis = tuple(map(float, counts))
    series = (
        line(label, axis, speed[what].mean(axis=0))
        for what, label in (("frame", "a whole frame"), ("weighing", "weighing alone"))
    )
    claimed = Series("paper: 0.8 each", axis, tuple(max(1.0, PAPER * count) for count in counts), dashed=True)
    yield line_chart("Speed-up over processors", "processors", "times as fast", (*series, claimed))
    means = ([round(float(value), 2) for value in times.mean(axis=0)] for times in spent.values())
    rows = zip(counts, *means, strict=True)
    yield Table("Times of one machine", ("processors", "a frame (ms)", "weighing a layer (ms)"), tuple(rows))


EXPERIMENTS = (listed("deutscher-processors", trials, measure, shown, footage=(CIRCLE,), alone=True),)
