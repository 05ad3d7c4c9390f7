"""Where each camera should see a body that a run has tracked: its model's silhouettes, frame by frame."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Bytes
from studio.foundations.errors import RunError
from studio.runs.drawing.overlay_drawing import projected_silhouette
from studio.runs.tracks import BEST, read_track, track_digest
from studio.search.likelihood.overlay import limb_contours
from studio.sessions.session import Session


@dataclass(frozen=True, slots=True, eq=False)
class ProjectedMasks:
    """made_of : words that change when the poses do. of : camera and frame to (H, W) 0 or 255, or None."""

    made_of: str
    of: Callable[[str, int], Bytes | None]


def projected_masks(session: Session, run_name: str) -> ProjectedMasks:
    """The silhouettes of a run's best track. Raises NotFoundError for no such run, RunError for one whose frames are
    not the session's, or without any.
    """
    run = session.run(run_name)
    record = run.record
    if record.ping_pong or record.live:
        raise RunError(f"Run '{run.name}' counts other frames than the session does.", "Name another run.")
    track = read_track(run, BEST)
    if not len(track.frames):
        raise RunError(f"Run '{run.name}' has no frame yet.", "Track it first.")
    cameras = {camera.name: camera for camera in session.cameras()}
    body = run.body()

    def of(name: str, frame: int) -> Bytes | None:
        row = int(np.searchsorted(track.frames, frame))
        if row == len(track.frames) or track.frames[row] != frame:
            return None
        camera = cameras[name]
        (contours,) = limb_contours(body, (camera,), track.poses[row])
        return projected_silhouette(contours, camera.height, camera.width)

    return ProjectedMasks(f"{run.name} {track.name} {track_digest(track)}", of)
