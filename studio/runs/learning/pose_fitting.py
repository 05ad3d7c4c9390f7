"""Poses of a body along a recorded motion: inverse kinematics on marker points, all frames together.

First frame by frame, forwards and backwards, each from its neighbour; these paths are then fitted as wholes, where
unsteady angles have a cost (`smooth_path`): that determines what markers leave open (twists of straight limbs, joints
near their singular positions). A path that is at first held very steady and gradually released finds the branch of
the joints' angles without a jump, and paths begun on the other branches (`other_spellings`) find what limits keep
from the first; the best stretches of all paths are joined (`path_splicing`) and fitted again.
Angles stay within the body's limits throughout.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.progress import Progress, no_progress
from studio.runs.learning.marker_problem import MarkerProblem
from studio.runs.learning.other_spellings import on_branch
from studio.runs.learning.path_splicing import spliced
from studio.runs.learning.smooth_path import SmoothPath, Steadiness
from studio.runs.learning.targets import Targets

STEADY = Steadiness(acceleration=90.0, speed=8.0, rest=1.5)
"""mm a radian a frame, at STEADY_FPS frames a second."""
STEADY_FPS = 30.0
STRICTER = ((1.0,), (4.0, 2.0, 1.0), (16.0, 8.0, 4.0, 2.0, 1.0))
"""Factors on the steadiness in successive refinements."""
OTHERS = (4.0, 2.0, 1.0)
"""The same for paths that begin on the other branches."""
PATH_STEPS, LAST_STEPS = 10, 25
BAD_SHARE, BAD_MM = 2.5, 60.0


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """poses : (F, D). rms_mm : (F,) distance of markers and points, NaN in frames that hold too few points."""

    poses: Array
    rms_mm: Array


def fit_poses(body: BodyModel, targets: Targets, fps: float, progress: Progress = no_progress) -> Fitted:
    """The poses of `body` whose markers and pointers come closest to the targets, steady over time.

    progress : called with (step, done, total). Raises StudioError where no frame has
    enough markers of the body.
    """
    problem, steady = MarkerProblem(body, targets), STEADY.at_rate(fps / STEADY_FPS)
    frames, paths, done = targets.frame_count, list[Array](), 0
    refinements = sum(map(len, STRICTER)) + 2 * len(OTHERS)
    total = 2 * frames + PATH_STEPS * frames * 2 * refinements + LAST_STEPS * frames
    for backwards in (False, True):

        def report(more: int) -> None:
            nonlocal done
            done += more
            progress("fitting the body", min(done, total), total)

        start = _follow(problem, backwards, report)
        others = [on_branch(body, start * problem.scale, beyond) / problem.scale for beyond in (False, True)]
        for grades, path in (
            *((grades, start) for grades in STRICTER),
            *((OTHERS, other) for other in others),
        ):
            for times in grades:
                path = _refined(problem, path, steady.times(times), PATH_STEPS)
                report(PATH_STEPS * frames)
            paths.append(path)
    paths.sort(key=lambda path: float(problem.costs(path).sum()))
    path = spliced(paths, problem.groups, problem.costs, steady.acceleration)
    path = _refined(problem, path, steady, LAST_STEPS)
    progress("fitting the body", total, total)
    return Fitted(path * problem.scale, problem.rms(path))


def bad_frames(rms_mm: Array) -> NDArray[np.int64]:
    """Numbers of the frames that fit far worse than the others, or had no markers. rms_mm : (F,)."""
    limit = max(BAD_MM, BAD_SHARE * float(np.nanmedian(rms_mm)))
    return np.flatnonzero(~(rms_mm <= limit))


def _refined(problem: MarkerProblem, path: Array, steadiness: Steadiness, steps: int) -> Array:
    smooth = SmoothPath(problem.slopes, problem.costs, problem.lower, problem.upper, problem.rest, steadiness)
    return smooth.refined(path, steps)


def _follow(problem: MarkerProblem, backwards: bool, report: Callable[[int], None]) -> Array:
    """(F, D) each frame from its neighbour, beginning with the first (or last) frame that can be fitted."""
    frames = np.arange(len(problem.usable))[:: -1 if backwards else 1]
    first = int(np.argmax(problem.usable[frames]))
    pose = problem.searched(int(frames[first]), problem.rest)
    path = np.tile(pose, (len(frames), 1))
    for frame in frames[first + 1 :]:
        if problem.usable[frame]:
            pose = problem.next(pose, int(frame))
        path[frame] = pose
        report(1)
    return path
