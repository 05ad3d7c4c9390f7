"""The frames that trials weigh, prepared once for all trials of a process that look at the same ones.

Two ways: as in a run, where blobs are fitted from where the tracker expects the body; and with blobs that are fitted
from the true pose in every frame, learnt from true poses too (section 7.3: "initialised from the annotated
ground-truth pose", so that trackers are compared by their dynamics alone).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from studio.comparison.footage_shelf import FootageShelf
from studio.errors import SettingsError
from studio.sessions.session import Session
from studio.settings import RunSettings
from studio.weighting.catalogue import WEIGHTINGS
from studio.weighting.problem import Expectant, FrameProblem

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Known:
    """A frame that has been told where the body is, and is not told again by those who search it."""

    told: FrameProblem

    def weigh(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights."""
        return self.told.weigh(poses, stage)

    def fitness(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) what a swarm maximises."""
        return self.told.fitness(poses, stage)

    def feasible(self, poses: Array, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether the body can take them."""
        return self.told.feasible(poses, limbs_apart)


def problems(
    shelf: FootageShelf, session: Session, settings: RunSettings, last: int
) -> Callable[[int], FrameProblem]:
    """Frame number to problem, for the first `last` frames. Those of hulls are kept, as carving takes longest."""
    weighting, cameras = WEIGHTINGS[settings.weighting_name], session.cameras()
    weigher = weighting.prepare(session.body(), cameras, settings.weighting)

    def made(frame: int) -> FrameProblem:
        seen = shelf.evidence(
            session, cameras, frame, settings.evidence, weighting.edge_kind, weighting.reads_pictures
        )
        return weigher.problem(seen)

    if weighting.edge_kind != "hull":
        return made
    key = ("hulls", session.path, settings.weighting, settings.evidence, last)
    kept = shelf.prepared(key, lambda: [made(frame) for frame in range(last)])
    return lambda frame: kept[frame]


def known_problems(
    shelf: FootageShelf, session: Session, settings: RunSettings, true_poses: Array
) -> Callable[[int], FrameProblem]:
    """Frame number to problem, each told the true pose (F, D) and nothing else. Raises SettingsError for a weighting
    that needs no telling.
    """
    last = len(true_poses)

    def told() -> Sequence[FrameProblem]:
        memory: Mapping[str, Array] = {}
        found = []
        of_frame = problems(shelf, session, settings, last)
        for frame, pose in enumerate(true_poses):
            problem = of_frame(frame)
            if not isinstance(problem, Expectant):
                raise SettingsError(
                    f"Weighting '{settings.weighting_name}' expects nothing.", "Take one that fits blobs."
                )
            expecting = problem.expecting(pose[None], memory)
            memory = cast("Expectant", expecting).remembered(pose)
            found.append(Known(expecting))
        return found

    key = ("known", session.path, settings.weighting, settings.evidence, last)
    kept = shelf.prepared(key, told)
    return lambda frame: kept[frame]
