"""A run's frames refined on their silhouettes, with the cameras, body and settings that they were tracked with.

Consecutive frames are refined together (`search.trackers.refinement_over_time`), so that the movement is one that a
body can make. Frames whose silhouettes agree too little even then (a platform or a shadow in the masks) are not
fitted: they keep their pose as far as the neighbours' movement allows. Frames in which the body was lost split the
movement and are refined alone, as are all frames where the acceleration is 0: then no frame gets a lower likelihood
than before, and one with poor masks keeps its pose. Frames without evidence are unchanged.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studio.evidence.distance_maps import silhouette_distances
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array, consecutive
from studio.runs.problem_source import ProblemSource
from studio.runs.run_footage import filmed_cameras
from studio.runs.tracks import Track
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import RunSettings, SettingsHistory, default_settings, settings_from_values
from studio.search.trackers.frame_refinement import followed_along_lines
from studio.search.trackers.hidden_areas import without_hidden
from studio.search.trackers.limb_resampling import bent_by
from studio.search.trackers.loss_detection import Onlooker, Sight
from studio.search.trackers.refinement import Distances, FrameLoss, RefinementSettings, Refiner, mm_at
from studio.search.trackers.refinement_over_time import HELD, MovementRefiner, Window, windows
from studio.search.trackers.tracker import LOST, NO_EVIDENCE
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

JUDGE = "edge-region-silhouette"
"""The likelihood used where the run's own reads pictures instead of masks (blobs need a prediction)."""


@dataclass(frozen=True, slots=True, eq=False)
class RefinedFrames:
    """Refined poses (K, D). agreement : (K,) f_s of each, the track's own value where a frame was not refined.
    agreement_before, agreement_after : means over the refined frames, NaN without any.
    """

    poses: Array
    agreement: Array
    agreement_before: float
    agreement_after: float


def refined_frames(
    session: Session, run: StoredRun, track: Track, knobs: RefinementSettings, read: Callable[[int], None]
) -> RefinedFrames:
    """Refine the frames of a track. read : called with the number of frames read; its exception ends the work."""
    work = _Work(session, run, track, knobs, read)
    try:
        together = knobs.refinement_acceleration > 0.0
        sure = np.array([together and state not in (LOST, NO_EVIDENCE) for state in track.states])
        for rows in _parts(track.frames, sure):
            if sure[rows[0]]:
                work.refine_together(rows)
            elif track.states[rows[0]] != NO_EVIDENCE:
                work.refine_alone(rows[0])
            else:
                work.leave()
    finally:
        work.close()
    return work.result()


def _parts(frames: NDArray[np.int64], sure: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Groups of rows refined together: consecutive sure frames; every other row alone."""
    parts: list[NDArray[np.int64]] = []
    rows = np.flatnonzero(sure)
    parts += [rows[part] for part in consecutive(frames[rows] + np.cumsum(~sure)[rows])]
    parts += [np.array([row]) for row in np.flatnonzero(~sure)]
    return sorted(parts, key=lambda part: int(part[0]))


class MaskSettings:
    """The settings of a run's frames, with a likelihood that uses masks."""

    def __init__(self, run: StoredRun) -> None:
        self._record = run.record
        with run.results() as results:
            self._history = SettingsHistory(tuple(results.settings_history()))

    def of(self, frame: int) -> RunSettings:
        entry = self._history.in_use(frame, 0)
        values = self._record.settings if entry is None else entry.values
        settings: RunSettings = settings_from_values(self._record.tracker, self._record.weighting, values)
        if not WEIGHTINGS[settings.weighting_name].reads_pictures:
            return settings
        judge = default_settings(settings.tracker_name, JUDGE)
        return replace(settings, weighting_name=JUDGE, weighting=judge.weighting)


@dataclass(frozen=True, slots=True, eq=False)
class _SeenFrame:
    """Data of a frame kept while its neighbours are read."""

    start: Array
    loss: FrameLoss
    sight: Callable[[Array], Sight]


class _Work:
    """Refines frames of one run, one part after the other."""

    def __init__(
        self,
        session: Session,
        run: StoredRun,
        track: Track,
        knobs: RefinementSettings,
        read: Callable[[int], None],
    ) -> None:
        body, self._cameras = run.body(), filmed_cameras(session, run.cameras())
        self._results, self._settings = run.results(), MaskSettings(run)
        self._record, self._track, self._knobs, self._report = run.record, track, knobs, read
        # Silhouettes lack limbs that were tracked along lines in the pictures: these bend as they were tracked.
        kept = followed_along_lines(body, self._settings.of(run.record.first).refinement)
        self._still = [angle for limb in kept for angle in bent_by(body, limb)]
        self._refiner = Refiner(body, self._cameras, knobs, self._still)
        self._onlooker = Onlooker(body, self._cameras)
        self._problems = ProblemSource(session, body, self._cameras)
        self._poses, self._agreement = track.poses.copy(), track.confidence.copy()
        self._before: list[float] = []
        self._after: list[float] = []
        self._read = 0

    def close(self) -> None:
        self._problems.close()
        self._results.close()

    def result(self) -> RefinedFrames:
        before, after = (
            float(np.nanmean(shares)) if shares else np.nan for shares in (self._before, self._after)
        )
        return RefinedFrames(self._poses, self._agreement, before, after)

    def leave(self) -> None:
        self._count_read()

    def refine_alone(self, row: int) -> None:
        frame, pose = int(self._track.frames[row]), self._track.poses[row]
        settings = self._settings.of(frame)
        evidence = self._problems.evidence(frame, settings)
        refiner = self._refiner_of(tuple(view.camera for view in evidence.views))
        silhouettes = self._silhouettes(refiner, frame, pose, evidence)
        refined = refiner.refine(pose, silhouettes, self._problems.problem(frame, settings))
        sight = self._onlooker.looking(evidence)
        kept = sight(refined.pose).overlap < self._knobs.refinement_least_overlap
        self._keep(row, pose if kept else refined.pose, sight)
        self._count_read()

    def refine_together(self, rows: NDArray[np.int64]) -> None:
        mover = MovementRefiner(self._refiner, self._record.fps, self._knobs.refinement_acceleration)
        seen: list[_SeenFrame] = []
        for first, after, kept in windows(len(rows)):
            while first + len(seen) < after:
                seen.append(self._look_at(int(rows[first + len(seen)])))
            held = self._poses[rows[max(0, first - HELD) : first]]
            poses = self._move(mover, seen, held)
            for row, pose, of_frame in zip(rows[first:kept], poses, seen, strict=False):
                self._keep(int(row), pose, of_frame.sight)
            seen = seen[kept - first :]

    def _move(self, mover: MovementRefiner, seen: list[_SeenFrame], held: Array) -> Array:
        """The poses of a window; computed again without the frames whose masks prove poor."""
        starts, losses = np.array([one.start for one in seen]), [one.loss for one in seen]
        poses = mover.refine(Window(starts, losses, held))
        silent = [
            one.sight(pose).overlap < self._knobs.refinement_least_overlap
            for one, pose in zip(seen, poses, strict=True)
        ]
        if not any(silent):
            return poses
        losses = [
            self._refiner.frame_loss(one.start, ()) if mute else one.loss
            for one, mute in zip(seen, silent, strict=True)
        ]
        return mover.refine(Window(starts, losses, held))

    def _look_at(self, row: int) -> _SeenFrame:
        frame, pose = int(self._track.frames[row]), self._track.poses[row]
        evidence = self._problems.evidence(frame, self._settings.of(frame))
        refiner = self._refiner_of(tuple(view.camera for view in evidence.views))
        loss = refiner.frame_loss(pose, self._silhouettes(refiner, frame, pose, evidence))
        self._count_read()
        return _SeenFrame(pose, loss, self._onlooker.looking(evidence))

    def _silhouettes(
        self, refiner: Refiner, frame: int, pose: Array, evidence: FrameEvidence
    ) -> list[Distances]:
        """A frame's silhouettes without known occlusions."""
        known = self._results.result(frame).carried.memory
        mm = mm_at(refiner.body, refiner.cameras, pose)
        return without_hidden(silhouette_distances(evidence), refiner.cameras, mm, known)

    def _keep(self, row: int, pose: Array, sight: Callable[[Array], Sight]) -> None:
        self._before.append(sight(self._track.poses[row]).overlap)
        self._poses[row], self._agreement[row] = pose, sight(pose).overlap
        self._after.append(float(self._agreement[row]))

    def _count_read(self) -> None:
        self._read += 1
        self._report(self._read)

    def _refiner_of(self, views: tuple[str, ...]) -> Refiner:
        """The refiner for the views that a frame has (a live camera that had stopped has none)."""
        if len(views) == len(self._cameras):
            return self._refiner
        cameras = tuple(camera for camera in self._cameras if camera.name in views)
        return Refiner(self._refiner.body, cameras, self._knobs, self._still)
