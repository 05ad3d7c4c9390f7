"""Two people (the body's own cones) drawn as masks before four cameras, crossing each other's way; what is true of each
is known.
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.body.subject import Subject, fit_subject, write_subject
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.arrays import Array, Bytes
from studio.results.drawing_footage.cameras import RIGS
from studio.runs.drawing.overlay_drawing import projected_silhouette
from studio.runs.search_space import parameter_names
from studio.search.likelihood.overlay import overlay_points
from studio.search.settings import default_settings
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.named_rows import write_pose
from studio.sessions.session import BESIDE, Session

SIZE, BODY = (240, 180), "human31"
HEIGHTS = (1780.0, 1650.0)
STARTS, STEPS = ((-520.0, 130.0), (500.0, -330.0)), ((52.0, 0.0), (-50.0, 6.0))
"""mm: places in the first frame, and ways from frame to frame."""


@dataclass(frozen=True, slots=True, eq=False)
class TwoPeople:
    """session : of both; masks come with it, the first one's measures and start pose are its own, the other's lie
    beside. bodies, poses (F, D) : of each. masks : of each by camera and frame, as if he were alone.
    """

    session: Session
    bodies: tuple[BodyModel, ...]
    poses: tuple[Array, ...]
    masks: tuple[dict[tuple[str, int], Bytes], ...]

    def places(self, frame: int = 0) -> tuple[tuple[float, float], ...]:
        """Where each stands, metres."""
        return tuple(
            (float((x + frame * dx) / 1000.0), float((y + frame * dy) / 1000.0))
            for (x, y), (dx, dy) in zip(STARTS, STEPS, strict=True)
        )


def two_people(folder: Path, frames: int) -> TwoPeople:
    """Written into `folder`, which must not exist."""
    cameras = RIGS["corners"](SIZE, np.random.default_rng(1))
    weighting = default_settings("annealed", "edge-region-silhouette").weighting
    measures = [Subject(body=BODY, height_mm=height) for height in HEIGHTS]
    bodies = tuple(fit_subject(load_body(BODY), one)[0] for one in measures)
    poses: list[Array] = []
    masks: list[dict[tuple[str, int], Bytes]] = []
    for body, start, step in zip(bodies, STARTS, STEPS, strict=True):
        names = list(parameter_names(body))
        moved = np.repeat(body.neutral[None], frames, axis=0)
        columns = [names.index("pelvis_x"), names.index("pelvis_y")]
        moved[:, columns] = np.array(start) + np.arange(frames)[:, None] * np.array(step)
        poses.append(moved)
        found: dict[tuple[str, int], Bytes] = {}
        for frame in range(frames):
            for camera, seen in zip(
                cameras, overlay_points(body, cameras, moved[frame], weighting), strict=True
            ):
                found[camera.name, frame] = projected_silhouette(seen.contours, camera.height, camera.width)
        masks.append(found)
    for camera in cameras:
        for part in ("pictures", "masks"):
            (folder / part / camera.name).mkdir(parents=True)
        for frame in range(frames):
            mask = masks[0][camera.name, frame] | masks[1][camera.name, frame]
            noise = np.random.default_rng(frame).integers(90, 110, (*mask.shape, 1), dtype=np.uint8)
            picture = np.where(mask[..., None] > 0, np.uint8(200), np.repeat(noise, 3, axis=2))
            cv2.imwrite(str(folder / "pictures" / camera.name / f"{frame:03d}.png"), picture)
            cv2.imwrite(str(folder / "masks" / camera.name / f"{frame:03d}.png"), mask)
    (folder / "calibration").mkdir()
    write_calibration(cameras, folder / "calibration" / "cameras.toml")
    sources = tuple(
        CameraSource(
            camera.name, "pictures", f"pictures/{camera.name}", *SIZE, frames, masks=f"masks/{camera.name}"
        )
        for camera in cameras
    )
    footage = FootageSource(25.0, frames, sources)
    write_manifest(
        folder, SessionManifest(name=folder.name, title="Two", created=now(), body=BODY, footage=footage)
    )
    for place, subject, body, moved in zip(
        (folder, folder / BESIDE / "1"), measures, bodies, poses, strict=True
    ):
        place.mkdir(parents=True, exist_ok=True)
        write_subject(subject, place / "subject.toml")
        write_pose(place / "start_pose.csv", parameter_names(body), moved[0])
    return TwoPeople(Session(folder), bodies, tuple(poses), tuple(masks))
