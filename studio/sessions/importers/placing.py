"""Added footage put beside what a session has: which cameras stay, where files go, which are not needed any more."""

import shutil
from dataclasses import replace
from pathlib import Path

from studio.capture.footage_source import CameraSource, FootageSource
from studio.capture.naming import listed
from studio.errors import FootageError
from studio.sessions.importers.agreement import SAME_RATE, TRIMMED_SHARE
from studio.sessions.importers.plan import SourcePlan
from studio.sessions.names import free_name
from studio.sessions.session import THUMBNAIL_NAME, Session

OWN_PARTS = ("videos", "pictures", "masks", "background")
PERSON_PARTS = ("subject.toml", "start_pose.csv", "sigma.csv", "truth", "bodies")


def cameras_that_stay(
    session: Session, added: FootageSource, plan: SourcePlan, replaced: bool
) -> tuple[CameraSource, ...]:
    """Cameras that stay as they are beside the added ones. Raises FootageError where the two do not fit together."""
    names = {camera.name for camera in added.cameras}
    before = session.manifest.footage
    stay = () if replaced else tuple(camera for camera in before.cameras if camera.name not in names)
    if not stay:
        return ()
    if abs(before.fps / added.fps - 1.0) > SAME_RATE:
        raise FootageError(
            f"The session's footage has {before.fps:g} frames a second, {listed(names)} {added.fps:g}, so frames with"
            " one number were taken at different moments.",
            "Resample it to one rate, or replace all footage.",
        )
    counts = {camera.name: camera.last for camera in (*stay, *added.cameras)}
    short, long = min(counts.values()), max(counts.values())
    told = bool(plan.offsets) or any(camera.offset for camera in stay)
    if long - short > max(1.0, TRIMMED_SHARE * long) and not told:
        words = ", ".join(f"{name}: {count}" for name, count in counts.items())
        raise FootageError(
            f"The cameras' frame counts differ ({words}).",
            "Give footage of the same take, replace all footage, or give the cameras' offsets.",
        )
    return stay


def take_in(
    session: Session, staged: Path, added: FootageSource, stay: tuple[CameraSource, ...]
) -> FootageSource:
    """Move what was written beside the session into it; returns the footage as it is then."""
    prefix = ""
    if any((session.path / part).exists() for part in OWN_PARTS):
        prefix = free_name("take-2", {path.name for path in session.path.iterdir()})
    place = session.path / prefix if prefix else session.path
    place.mkdir(exist_ok=True)
    for part in OWN_PARTS:
        if (staged / part).exists():
            (staged / part).rename(place / part)
    for part in ("calibration", *PERSON_PARTS):
        if (staged / part).exists() and not (session.path / part).exists():
            (staged / part).rename(session.path / part)
    cameras = (*stay, *(_placed(camera, prefix) for camera in added.cameras))
    names = [camera.name for camera in session.manifest.footage.cameras]
    ranked = sorted(
        cameras, key=lambda camera: names.index(camera.name) if camera.name in names else len(names)
    )
    return FootageSource(added.fps, min(camera.last for camera in ranked), tuple(ranked))


def _placed(camera: CameraSource, prefix: str) -> CameraSource:
    """A camera's source where it lies in the session; places elsewhere stay."""
    if not prefix:
        return camera
    moved = {
        name: f"{prefix}/{path}"
        for name in ("path", "masks", "background")
        if (path := getattr(camera, name)) and not Path(path).is_absolute()
    }
    return replace(camera, **moved)


def forget_old(session: Session, before: FootageSource) -> None:
    """Remove files of the session's own that no camera refers to any more, and the small picture."""
    (session.path / THUMBNAIL_NAME).unlink(missing_ok=True)
    used = {
        path
        for camera in session.manifest.footage.cameras
        for path in (camera.path, camera.masks, camera.background)
    }
    for camera in before.cameras:
        for path in (camera.path, camera.masks, camera.background):
            if not path or path in used or Path(path).is_absolute():
                continue
            place = session.path / path
            if place.is_dir():
                shutil.rmtree(place, ignore_errors=True)
            else:
                place.unlink(missing_ok=True)
