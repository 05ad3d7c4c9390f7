"""Pictures of a tracked run, kept to be looked at (STUDIO_ARTEFACTS, default artefacts/)."""

import os
from pathlib import Path

import cv2
import numpy as np

import studio
from studio.results.overlay_pictures import ViewComposer
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

ROOT = Path(__file__).resolve().parents[2]


def keep_overlays(folder: str, session: Session, run: StoredRun, every: int, track: str = "best") -> None:
    """The views of every so-many-th frame side by side, with masks and outlines."""
    place = Path(os.environ.get("STUDIO_ARTEFACTS", ROOT / "artefacts")) / folder
    place.mkdir(parents=True, exist_ok=True)
    composer = ViewComposer(session, run)
    found = studio.read_track(run, track)
    try:
        for frame, pose in zip(found.frames[::every].tolist(), found.poses[::every], strict=True):
            views = [
                composer.compose(frame, name, ("mask", "outline"), pose=pose, height=960)
                for name in composer.cameras
            ]
            cv2.imwrite(str(place / f"frame-{frame:03d}.png"), np.hstack(views))
    finally:
        composer.close()
