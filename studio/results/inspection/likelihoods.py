"""The likelihood of a stored frame, evaluated again on its evidence; sources of the runs last looked at stay open."""

import math
import threading
import time
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.foundations.errors import NotFoundError
from studio.results.inspection.reading import InspectedFrame, InspectedRun
from studio.results.inspection.tables import Row, table
from studio.results.inspection.wanted import stop_if_left
from studio.runs.problem_source import ProblemSource
from studio.runs.run_footage import footage_of
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.problem import (
    POOLED,
    WHOLE,
    BaseFrameLikelihood,
    FittedToPoses,
    FrameLikelihood,
    Shares,
)
from studio.search.settings import RunSettings

KEPT = 2
"""Runs whose footage, backgrounds and last frames are kept open."""
REST_SECONDS = 60.0
"""Evaluations that were not looked at for so long are closed."""
NATS_SCALE = table(
    "scale",
    "Colours of maps of log weights",
    ("level", "Level", "nats"),
    ("most", "Last colour, also beyond", "nats"),
)
TELLS = 0.25
TIMES_LEVEL = 100.0
"""Times the level: where the colours of maps of log weights end."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameEvaluation:
    """A stored frame's likelihood. cameras : those that have a picture of it."""

    problem: FrameLikelihood
    evidence: FrameEvidence

    @property
    def cameras(self) -> tuple[str, ...]:
        return tuple(view.camera for view in self.evidence.views)

    def log_weights(self, poses: Array) -> Array:
        """(N,) of poses (N, D). Raises LeftError."""
        stop_if_left()
        return self.problem.log_likelihood(poses)

    def shares(self, poses: Array) -> Shares:
        """What each camera and term adds to the log-weights of poses (N, D). Raises LeftError."""
        stop_if_left()
        if isinstance(self.problem, BaseFrameLikelihood):
            return self.problem.shares(poses)
        return Shares((POOLED,), (WHOLE,), self.problem.log_likelihood(poses)[:, None, None])


_lock = threading.RLock()
_sources: OrderedDict[tuple[Path, str], tuple[ProblemSource, float]] = OrderedDict()


def evaluation_of(frame: InspectedFrame) -> FrameEvaluation:
    """The frame's likelihood with the settings at its beginning.

    A likelihood that expects a pose (blobs) is given the frame's own and what the frame before had learnt. Raises
    FootageError, NotFoundError.
    """
    source, settings = source_of(frame.of), frame.settings
    problem, evidence = source.problem(frame.number, settings), source.evidence(frame.number, settings)
    if isinstance(problem, FittedToPoses):
        problem = problem.expecting(frame.searched()[None], _memory(frame))
    return FrameEvaluation(problem, evidence)


def forget_evaluations() -> None:
    """Close the footage that is kept open (before a session is moved or deleted, and at the end)."""
    with _lock:
        while _sources:
            _sources.popitem()[1][0].close()


def let_evaluations_rest(seconds: float = REST_SECONDS) -> None:
    """Close the footage of runs that were not looked at for so long."""
    before = time.monotonic() - seconds
    with _lock:
        for key in [key for key, (_, used) in _sources.items() if used < before]:
            _sources.pop(key)[0].close()


def source_of(run: InspectedRun) -> ProblemSource:
    """The run's frames as likelihoods, kept open."""
    key = (run.session.path, run.run.name)
    with _lock:
        known = _sources.get(key)
        source = known[0] if known else None
        if source is None:
            footage = footage_of(run.session, run.run)
            source = ProblemSource(run.session, run.body, run.run.cameras(), footage=footage)
        _sources[key] = (source, time.monotonic())
        _sources.move_to_end(key)
        while len(_sources) > KEPT:
            _sources.popitem(last=False)[1][0].close()
        return source


def _memory(frame: InspectedFrame) -> dict[str, Array]:
    """What the likelihood had learnt before the frame."""
    with frame.of.run.results() as results:
        before = results.last_before(frame.number)
        return {} if before is None else dict(results.result(before).carried.memory)


def limbs_swapped(run: InspectedRun, pose: Array, other: Array) -> tuple[tuple[str, ...], Array]:
    """The body's parameter groups (G) and (G, D) the pose with each group's parameters as in the other pose."""
    groups = np.array(run.limbs)
    names = tuple(dict.fromkeys(run.limbs))
    return names, np.stack([np.where(groups == name, other, pose) for name in names])


def nats_scale(run: InspectedRun) -> Row:
    """The row of NATS_SCALE, the same in all frames of a run. The level changes a weight of the last layer by about e:
    1 / β there, in the run's first frame as it is stored, to the nearest power of ten; 1 for a tracker without β.
    """
    frames = run.frames()
    with run.run.results() as results:
        beta = results.layers(frames[0])[-1].beta if frames else math.nan
    level = 10.0 ** round(-math.log10(beta)) if math.isfinite(beta) and beta > 0.0 else 1.0
    return (level, TIMES_LEVEL * level)


def telling_nats(settings: RunSettings) -> float:
    """By how much two log-weights must differ for one pose to be preferred: a share of the likelihood's usual spread
    (`LossLimit`).
    """
    return TELLS * WEIGHTINGS[settings.weighting_name].loss.spread


def named_pose(frame: InspectedFrame, name: str, particle: int | None, layer: int) -> Array:
    """(D,) a pose of the frame by name: "estimate", "searched", "mean", "mode", "particle" or a track's name.

    Raises NotFoundError.
    """
    record = frame.layers[layer]
    if name == "particle":
        numbers = frame.particles(layer).tolist()
        if particle not in numbers:
            raise NotFoundError(
                f"Layer {layer + 1} of frame {frame.number} has no stored particle {particle}.",
                "Select one that it has.",
            )
        return record.poses[numbers.index(particle)]
    if name in ("mean", "mode"):
        return record.mean if name == "mean" else record.best
    if name == "searched":
        return frame.searched()
    return frame.estimate("" if name == "estimate" else name)
