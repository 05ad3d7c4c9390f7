"""A session's cameras turned a little so that its silhouettes agree (`footage.calibration.silhouette_alignment`)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.footage.calibration.silhouette_alignment import AlignedCameras, aligned_cameras
from studio.footage.calibration.silhouette_checks import outlines_of
from studio.foundations.arrays import Bytes
from studio.foundations.errors import CalibrationError
from studio.foundations.progress import Progress, no_progress
from studio.runs.setup.person_hull import spread_frames
from studio.runs.setup.session_settings import masks_of
from studio.runs.setup.silhouette_faults import person_alone
from studio.sessions.calibration_changes import CalibrationChange, NewCalibration, replace_calibration
from studio.sessions.session import Session

FRAMES = 16
WORTHWHILE = 3.0
"""Pixels by which tangents miss (the worst camera's median) from which aligning is advised."""
BETTER = 0.8
"""An alignment that leaves the worst camera more than this share of its former miss explains nothing."""
SAME_DEGREES, SAME_MM = 1e-3, 0.1
"""Files keep cameras to fewer digits than memory."""


@dataclass(frozen=True, slots=True, eq=False)
class SessionAlignment:
    """The result of an alignment. names : of the cameras, in the order of `aligned`."""

    names: tuple[str, ...]
    aligned: AlignedCameras

    @property
    def needed(self) -> bool:
        """Whether the cameras miss by enough to matter."""
        return bool(np.nanmax(self.aligned.before) > WORTHWHILE)

    @property
    def better(self) -> bool:
        """Whether turning the cameras explains most of the misses."""
        return bool(np.nanmax(self.aligned.after) < BETTER * np.nanmax(self.aligned.before))

    def is_of(self, session: Session) -> bool:
        """Whether the cameras in use are those that were measured: they differ from the turned ones by the turns."""
        now, measured = session.cameras(), self.aligned
        if tuple(camera.name for camera in now) != self.names:
            return False
        for camera, turned, angle in zip(now, measured.cameras, measured.turns, strict=True):
            cosine = (np.trace(turned.rotation @ camera.rotation.T) - 1.0) / 2.0
            apart = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
            if abs(apart - angle) > SAME_DEGREES or np.linalg.norm(camera.centre - turned.centre) > SAME_MM:
                return False
        return True

    def in_words(self) -> tuple[str, ...]:
        """One line a camera."""
        aligned = self.aligned
        return tuple(
            f"{name:12} silhouettes miss by {before:.1f} px, {after:.1f} px when turned by {turn:.2f}°"
            for name, before, after, turn in zip(
                self.names, aligned.before, aligned.after, aligned.turns, strict=True
            )
        )


def align_cameras(
    session: Session, frames: Sequence[int] = (), *, progress: Progress = no_progress
) -> SessionAlignment:
    """The turns that make a session's silhouettes agree; nothing is written (see `keep_alignment`).

    frames : default: sixteen, evenly spread. Raises CalibrationError for a single camera or too few whole
    silhouettes, FootageError, NotFoundError.
    """
    cameras = session.cameras()
    if len(cameras) < 2:
        raise CalibrationError(
            f"Session '{session.name}' has one camera: there is nothing to align it with.",
            "Check the outlines instead.",
        )
    with masks_of(session) as maker:
        chosen = tuple(frames) or spread_frames(maker.footage.frame_count, FRAMES)
        masks: dict[int, dict[str, Bytes]] = {}
        for done, frame in enumerate(chosen):
            progress("reading silhouettes", done, len(chosen))
            masks[frame] = {view.camera: person_alone(view.mask) for view in maker.evidence(frame).views}
    aligned = aligned_cameras(cameras, outlines_of(cameras, masks))
    progress("reading silhouettes", len(chosen), len(chosen))
    return SessionAlignment(tuple(camera.name for camera in cameras), aligned)


def keep_alignment(session: Session, aligned: SessionAlignment) -> CalibrationChange:
    """Make the aligned cameras the session's; the earlier calibration is kept. Raises SessionError while tracking."""
    source = session.manifest.calibration_source
    turned = ", ".join(
        f"{name} {turn:.2f}°" for name, turn in zip(aligned.names, aligned.aligned.turns, strict=True)
    )
    note = f"Cameras turned by their silhouettes: {turned}."
    new = NewCalibration(aligned.aligned.cameras, f"{source}, aligned by silhouettes", notes=(note,))
    return replace_calibration(session, new)
