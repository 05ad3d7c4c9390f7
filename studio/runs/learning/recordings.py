"""Recorded motion as poses of a body: motion files (.amc with its .asf, .bvh, .npz, .c3d, .trc) and earlier runs.

A skeleton is retargeted to the synthetic one with the body's proportions; points are fitted by the body in the size
given by their distances; a run of the same body is used unchanged.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from studio.body.forward_kinematics import marker_points
from studio.body.mending import mended
from studio.body.model import BodyModel
from studio.body.motion_files.c3d import read_c3d
from studio.body.motion_files.reading import read_recording
from studio.body.motion_files.recorded_motion import RecordedMotion
from studio.body.motion_files.trc import MarkerMotion, read_trc
from studio.body.person import PersonMotion, sampled
from studio.body.retargeting import family_of, on_skeleton
from studio.body.subject import Subject, fit_subject
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.progress import Progress, no_progress
from studio.runs.learning.marker_labels import person_markers
from studio.runs.learning.pose_fitting import bad_frames, fit_poses
from studio.runs.learning.resampling import frame_times, points_at, poses_at
from studio.runs.learning.targets import Targets, marker_names, of_person, of_poses, skeleton_of_body
from studio.sessions.stored_run import StoredRun

FPS = 30.0
FEWEST_FRAMES = 10
SKELETON_FILES, POINT_FILES = (".amc", ".bvh", ".npz"), (".c3d", ".trc")
MOTION_FILES = (*SKELETON_FILES, *POINT_FILES)
# Pairs of markers whose distances give the person's size.
MEASURED = (
    *(("Hip", "Neck"), ("Neck", "Head")),
    *((f"{side}{one}", f"{side}{other}") for side in "LR" for one, other in (("Hip", "Knee"), ("Knee", "Ankle"))),
    *(
        (f"{side}{one}", f"{side}{other}")
        for side in "LR"
        for one, other in (("Shoulder", "Elbow"), ("Elbow", "Wrist"))
    ),
    *(("Hip", f"{side}Hip") for side in "LR"),
    *(("Neck", f"{side}Shoulder") for side in "LR"),
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Motion of a body.

    poses : (F, D) at `fps`. rms_mm : distance of the body's markers from the recorded ones over all frames; 0 for
    unchanged poses. bad_frames : those that fit far worse than the rest (numbers at `fps`). notes :
    of the file's reader, sentences.
    """

    name: str
    fps: float
    poses: Array
    rms_mm: float = 0.0
    bad_frames: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def frame_count(self) -> int:
        return len(self.poses)


def fitted_person(
    motion: PersonMotion, body: BodyModel, name: str, progress: Progress = no_progress
) -> Recording:
    """The body moving as a synthetic person does, at the motion's rate."""
    return _fit(of_person(motion), body, name, motion.fps, progress)


def _fit(targets: Targets, body: BodyModel, name: str, fps: float, progress: Progress) -> Recording:
    fit = fit_poses(body, targets, fps, progress)
    rms = float(np.sqrt(np.nanmean(fit.rms_mm**2)))
    return Recording(name, fps, fit.poses, rms, tuple(bad_frames(fit.rms_mm).tolist()))


def read_file(
    path: Path, body: BodyModel, skeleton: Path | None, fps: float, progress: Progress
) -> Recording:
    """The motion of a file on `body`, at `fps`. skeleton : the ASF of an .amc. Raises StudioError."""
    ending = path.suffix.lower()
    if ending in SKELETON_FILES:
        marker_names(body)
        recorded = read_recording(path, skeleton if ending == ".amc" else None)
        return replace(_from_recorded(recorded, body, path.stem, fps, progress), notes=recorded.notes)
    if ending in POINT_FILES:
        marker_names(body)
        motion = read_c3d(path) if ending == ".c3d" else read_trc(path)
        return replace(_from_points(motion, body, path, fps, progress), notes=motion.notes)
    raise StudioError(
        f"'{path.name}' is not a motion that can be read.",
        f"Give files ending in {', '.join(MOTION_FILES)}, a recipe, or a run as SESSION/RUN.",
    )


def _from_recorded(
    recorded: RecordedMotion, body: BodyModel, name: str, fps: float, progress: Progress
) -> Recording:
    """Motion of a recorded skeleton; one with unknown joint names is fitted to the joints' positions alone."""
    if recorded.positions.shape[0] < 2:
        return Recording(name, fps, np.repeat(body.neutral[None], len(recorded.positions), axis=0))
    try:
        family_of(recorded)
    except StudioError:
        times = np.arange(len(recorded.positions)) / recorded.fps
        joints = MarkerMotion(recorded.names, times, recorded.positions, rate=recorded.fps)
        return _from_points(joints, body, Path(recorded.source), fps, progress, unit_known=False)
    whole = mended(on_skeleton(recorded, skeleton_of_body(body)))
    return fitted_person(sampled(whole, frame_times(recorded.seconds, fps), fps), body, name, progress)


def _from_points(
    motion: MarkerMotion,
    body: BodyModel,
    path: Path,
    fps: float,
    progress: Progress,
    *,
    unit_known: bool = True,
) -> Recording:
    """Motion of points; where their unit is unknown (BVH has none), they are scaled to the body's leg length."""
    names, points = person_markers(motion.names, motion.positions, path.name)
    if not unit_known:
        theirs = _leg(names, points)
        mine = _leg(marker_names(body), marker_points(body, body.neutral))
        points = points * (mine / theirs if theirs > 0.0 else 1.0)
    times = motion.times - motion.times[0]
    new_times = frame_times(float(times[-1]), fps)
    if len(new_times) < FEWEST_FRAMES:
        return Recording(path.stem, fps, np.repeat(body.neutral[None], len(new_times), axis=0))
    targets = Targets(names, points_at(times, points, new_times), {})
    return _fit(targets, _in_size(body, targets), path.stem, fps, progress)


def _leg(names: tuple[str, ...], points: Array) -> float:
    """The usual length of both legs together, mm. points : (F, M, 3)."""
    at = {name: points[:, place] for place, name in enumerate(names)}
    pairs = [
        (f"{side}{one}", f"{side}{other}")
        for side in "LR"
        for one, other in (("Hip", "Knee"), ("Knee", "Ankle"))
    ]
    return float(sum(np.nanmedian(np.linalg.norm(at[one] - at[other], axis=1)) for one, other in pairs))


def _in_size(body: BodyModel, targets: Targets) -> BodyModel:
    """The body in the size given by its markers' distances, medians over the frames."""
    at = {name: place for place, name in enumerate(targets.names)}
    lengths: dict[str, float] = {}
    for one, other in MEASURED:
        if one in at and other in at:
            apart = np.linalg.norm(targets.points[:, at[one]] - targets.points[:, at[other]], axis=1)
            length = float(np.median(apart[np.isfinite(apart)])) if np.isfinite(apart).any() else 0.0
            if length > 1.0:
                lengths[f"{one}_{other}"] = length
    return fit_subject(body, Subject(body=body.name, lengths_mm=lengths))[0]


def read_run(run: StoredRun, body: BodyModel, fps: float, progress: Progress) -> Recording:
    """A run's stored poses, at `fps`; another body is fitted to the markers of the tracked one. Raises StudioError."""
    name, own = f"{run.session_name}/{run.name}", run.body()
    with run.results() as results:
        frames, poses = results.poses()
    if len(frames) < 2:
        raise StudioError(f"Run '{name}' holds {len(frames)} frames.", "Track it first.")
    times = (np.asarray(frames, dtype=float) - frames[0]) / run.record.fps
    new_times = frame_times(float(times[-1]), fps)
    moved = poses_at(own, times, poses, new_times)
    if own.name == body.name and len(own.parameters) == len(body.parameters):
        return Recording(name, fps, moved)
    marker_names(own)
    marker_names(body)
    targets = of_poses(own, moved)
    return _fit(targets, _in_size(body, targets), name, fps, progress)
