"""Footage measured and fitted to its calibration: every frame decoded once, sizes and rates compared."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from studio.capture.calibration_files import Calibration
from studio.capture.footage import background_turn, turned_picture
from studio.capture.footage_fit import NO_BARS, Margins, black_margins, fit_camera
from studio.capture.footage_source import Turn
from studio.capture.naming import CameraMatch, listed, match_names
from studio.capture.pictures import (
    PictureReader,
    PicturesMeasure,
    check_picture,
    is_picture,
    measure_pictures,
)
from studio.capture.video import VideoMeasure, VideoReader, measure_video
from studio.errors import CalibrationError, FootageError
from studio.evidence.backgrounds import check_plate_size
from studio.geometry.camera import Camera
from studio.progress import Progress
from studio.sessions.importers.agreement import (
    MeasuredCamera,
    check_before_decoding,
    common_frame_count,
    common_rate,
    crop_warnings,
    gap_warnings,
)
from studio.sessions.importers.alignment import turns_asked, with_offsets
from studio.sessions.importers.plan import SourcePlan

CENTRAL = (0.35, 0.65)
"""Where a principal point lies, as a share of the picture, if a calibration without a size fits it."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredSource:
    """All cameras that have footage, in the calibration's order. fps, frame_count : common to all. notes : sentences
    on how they were put in step.
    """

    cameras: tuple[MeasuredCamera, ...]
    fps: float
    frame_count: int
    matching: tuple[CameraMatch, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...] = ()


def measure_source(
    plan: SourcePlan, calibration: Calibration, fps: float | None, progress: Progress
) -> MeasuredSource:
    """Match, decode and compare all footage. fps : the user's, which goes before all others.

    Raises FootageError, CalibrationError.
    """
    names = [camera.name for camera in calibration.cameras]
    matching = match_names(
        [part_name(path) for path in plan.footage], names, "videos or picture folders", FootageError
    )
    by_camera = {match.camera: path for match, path in zip(matching, plan.footage, strict=True)}
    used = [camera for camera in calibration.cameras if camera.name in by_camera]
    masks = _matched(plan.masks, used, "masks")
    backgrounds = _matched(plan.backgrounds, used, "backgrounds")
    turns = turns_asked(plan, by_camera)
    check_before_decoding([by_camera[camera.name] for camera in used], fps or plan.fps)
    measured = tuple(
        _measure_camera(
            calibration,
            camera,
            by_camera[camera.name],
            turns.get(camera.name, 0),
            masks.get(camera.name),
            backgrounds.get(camera.name),
            progress,
        )
        for camera in used
    )
    aligning: list[str] = []
    measured, notes, aligned = with_offsets(plan, measured, names, aligning)
    warnings = [
        *aligning,
        *_without_footage(names, by_camera),
        *crop_warnings(calibration, measured),
        *gap_warnings(measured),
        *_without_background(measured),
    ]
    count = common_frame_count(measured, warnings, aligned)
    rate = common_rate(measured, fps, plan.fps, warnings)
    for entry in measured:
        if entry.masks is not None:
            _check_masks(entry, entry.masks, count, progress)
        if entry.background is not None:
            _check_background(entry, entry.background)
    return MeasuredSource(measured, rate, count, matching, tuple(warnings), notes)


def part_name(path: Path) -> str:
    """The name by which a video (without suffix) or folder is matched."""
    return path.name if path.is_dir() else path.stem


def _measure_camera(
    calibration: Calibration,
    camera: Camera,
    footage: Path,
    turned: Turn,
    masks: Path | None,
    background: Path | None,
    progress: Progress,
) -> MeasuredCamera:
    """Decode one camera's footage and fit its calibration to it."""
    found = _measure(footage, f"reading {footage.name}", progress)
    entry = MeasuredCamera(camera, footage, found, None, masks, background, turned)
    if not calibration.sizes_known:
        return dataclasses.replace(entry, camera=_sized(camera, *entry.size))
    bars = _bars(entry) if entry.size != (camera.width, camera.height) else NO_BARS
    fitted, crop = fit_camera(camera, *entry.size, bars)
    return dataclasses.replace(entry, camera=fitted, crop=crop or calibration.crops.get(camera.name))


def _measure(path: Path, step: str, progress: Progress) -> VideoMeasure | PicturesMeasure:
    def told(done: int, total: int) -> None:
        progress(step, done, total)

    return measure_pictures(path, told) if path.is_dir() else measure_video(path, told)


def _bars(entry: MeasuredCamera) -> Margins:
    footage, count = entry.footage, entry.found.frame_count
    reader = PictureReader(footage, count) if footage.is_dir() else VideoReader(footage, count)
    try:
        return black_margins(lambda frame: turned_picture(reader.read(frame), entry.turned), count)
    finally:
        reader.close()


def _matched(parts: tuple[Path, ...], cameras: list[Camera], what: str) -> dict[str, Path]:
    """Masks or backgrounds by camera; those of cameras without footage are passed over."""
    if not parts:
        return {}
    names = [camera.name for camera in cameras]
    matches = match_names([part_name(path) for path in parts], names, what, FootageError)
    return {match.camera: path for match, path in zip(matches, parts, strict=True)}


def _sized(camera: Camera, width: int, height: int) -> Camera:
    """A camera whose file gives no size, with the footage's. Raises CalibrationError if it cannot be."""
    x, y = camera.matrix[0, 2] / width, camera.matrix[1, 2] / height
    if not (CENTRAL[0] < x < CENTRAL[1] and CENTRAL[0] < y < CENTRAL[1]):
        raise CalibrationError(
            f"The footage of camera {camera.name} is {width}x{height} pixels and its calibration is for"
            f" another size: its principal point is ({camera.matrix[0, 2]:.0f}, {camera.matrix[1, 2]:.0f}).",
            "Give footage of the calibrated size, or a calibration made at the footage's size.",
        )
    return dataclasses.replace(camera, width=width, height=height)


def _without_footage(names: list[str], by_camera: dict[str, Path]) -> list[str]:
    """A warning where calibrated cameras have no footage."""
    left = [name for name in names if name not in by_camera]
    return [f"Calibrated camera {listed(left)} has no footage and is left out."] if left else []


def _without_background(measured: tuple[MeasuredCamera, ...]) -> list[str]:
    """A warning where some cameras came with a background and others with neither that nor masks."""
    bare = [entry.camera.name for entry in measured if entry.background is None and entry.masks is None]
    if not bare or len(bare) == len(measured):
        return []
    return [f"Camera {listed(bare)} has no background: it is taken from the footage, less reliably."]


def _check_masks(entry: MeasuredCamera, masks: Path, count: int, progress: Progress) -> None:
    """Masks of the footage's size, one for every frame in use."""
    found = _measure(masks, f"reading masks {masks.name}", progress)
    if (found.width, found.height) != (entry.found.width, entry.found.height):
        raise FootageError(
            f"The masks '{masks.name}' are {found.width}x{found.height} pixels, the footage"
            f" {entry.found.width}x{entry.found.height}.",
            "Give masks of the footage's size.",
        )
    if found.frame_count < entry.offset + count:
        raise FootageError(
            f"The masks '{masks.name}' have {found.frame_count} frames, the footage {entry.offset + count}.",
            "Give one mask for every frame.",
        )


def _check_background(entry: MeasuredCamera, background: Path) -> None:
    """A background that can be cut to the footage's size."""
    if is_picture(background):
        width, height = check_picture(background)
    else:
        found = measure_video(background)
        width, height = found.width, found.height
    turned = background_turn(entry.turned, entry.size, (width, height)) in (90, 270)
    check_plate_size((height, width) if turned else (width, height), entry.size, background.name)
