"""Footage measured and fitted to its calibration: every frame decoded once, sizes and rates compared."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from studio.evidence.backgrounds import check_plate_size
from studio.footage.capture.calibration_files import Calibration
from studio.footage.capture.calibration_parts import AssumedCrop
from studio.footage.capture.footage import background_turn, turned_picture
from studio.footage.capture.footage_fit import NO_BARS, Margins, black_margins, fit_camera
from studio.footage.capture.footage_source import TURNS, Turn
from studio.footage.capture.frame_pairing import Steps, drifts, file_frame, paired_by_time
from studio.footage.capture.interlacing import Fields, times_of_fields
from studio.footage.capture.naming import CameraMatch, listed, match_names
from studio.footage.capture.pictures import (
    PictureReader,
    PicturesMeasure,
    check_picture,
    is_picture,
    measure_pictures,
)
from studio.footage.capture.timestamps import offsets_from_times, read_timestamps
from studio.footage.capture.video import MAX_FRAMES, VideoMeasure, VideoReader, measure_video, probe_video
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError, FootageError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress
from studio.sessions.importers.mask_forms import MaskForm, form_of_masks
from studio.sessions.importers.plan import SourcePlan

SAME_RATE, ANNOUNCED_RATE = 0.005, 0.02
TRIMMED_SHARE = 0.1
"""Frame counts that differ by up to this share are trimmed to the shortest; beyond, it is an error."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredCamera:
    """One camera's parts, measured.

    camera : as fitted to the footage.
    footage, masks, background : source paths.
    measure : of the footage as it decodes, before turning.
    crop : assumed to make it fit, if any.
    turned : degrees clockwise.
    offset : the file's frame that is frame 0 of all cameras.
    steps, fields : as of `CameraSource`; `measure` counts fields then.
    mask_form, mask_count : how the masks are meant, and how many there are.
    """

    camera: Camera
    footage: Path
    measure: VideoMeasure | PicturesMeasure
    crop: AssumedCrop | None
    masks: Path | None
    background: Path | None
    turned: Turn = 0
    offset: int = 0
    steps: Steps = ()
    fields: Fields = ""
    mask_form: MaskForm | None = None
    mask_count: int = 0

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the pictures once they are turned, px."""
        measure = self.measure
        return (
            (measure.height, measure.width) if self.turned in (90, 270) else (measure.width, measure.height)
        )


def crop_warnings(calibration: Calibration, measured: tuple[MeasuredCamera, ...]) -> list[str]:
    """A warning for each camera whose footage is not of the calibrated size."""
    sizes = {camera.name: (camera.width, camera.height) for camera in calibration.cameras}
    warnings: list[str] = []
    for entry in measured:
        name, (width, height) = entry.camera.name, entry.size
        wide, tall = sizes[name]
        if entry.crop is None or not calibration.sizes_known or (width, height) == (wide, tall):
            continue
        differences = [
            f"{abs(change)} pixels {smaller if change < 0 else larger}"
            for change, smaller, larger in (
                (width - wide, "narrower", "wider"),
                (height - tall, "lower", "higher"),
            )
            if change
        ]
        warnings.append(
            f"{entry.footage.name} is {width}x{height}, {' and '.join(differences)} than its"
            f" calibration ({wide}x{tall}). {entry.crop.words(name)}"
        )
    return warnings


def gap_warnings(measured: tuple[MeasuredCamera, ...]) -> list[str]:
    """A warning where numbers of pictures are missing, an error if they are not the same in all cameras."""
    missing = {
        entry.footage.name: entry.measure.missing
        for entry in measured
        if isinstance(entry.measure, PicturesMeasure)
    }
    gaps = {name: numbers for name, numbers in missing.items() if numbers}
    if not gaps:
        return []
    name, numbers = next(iter(gaps.items()))
    words = ", ".join(str(number) for number in numbers[:5]) + (" …" if len(numbers) > 5 else "")
    if len(set(missing.values())) > 1:
        raise FootageError(
            f"'{name}' lacks the pictures numbered {words}, which other cameras have.",
            "Remove these pictures from all cameras, so that frames stay together.",
        )
    return [
        f"Pictures numbered {words} are missing in all cameras; the frames around them count as neighbours."
    ]


def check_before_decoding(footage: Sequence[Path], fps: float | None, by_time: bool = False) -> None:
    """Check early what decoding would find only after minutes. fps : None to use the videos' own rates. by_time : rates
    may differ.

    Raises FootageError for videos that are not to be decoded, or whose announced frame rates differ much.
    """
    probes = {path.name: probe_video(path) for path in footage if path.is_file()}
    rates = {name: probe.fps for name, probe in probes.items() if probe.steady}
    known = sorted(rates.values())
    if fps is None and not by_time and known and known[-1] / known[0] - 1.0 > ANNOUNCED_RATE:
        raise different_rates(rates)


def common_frame_count(
    measured: tuple[MeasuredCamera, ...], warnings: list[str], aligned: bool = False
) -> int:
    """The frames that all cameras have after their offsets. aligned : the offsets are known; ends may differ."""
    counts = {entry.footage.name: entry.measure.frame_count - entry.offset for entry in measured}
    shortest, longest = min(counts.values()), max(counts.values())
    if shortest == longest:
        return shortest
    words = ", ".join(f"{name}: {count}" for name, count in counts.items())
    if shortest < 1:
        raise FootageError(
            f"With these offsets no frame is left that all cameras have ({words} frames).",
            "Correct the offsets, or give footage of the same take.",
        )
    if aligned:
        return shortest
    check_counts(counts, aligned)
    warnings.append(
        f"The cameras' frame counts differ ({words}): only the first {shortest} frames are used; check that"
        " all begin at the same moment."
    )
    return shortest


def check_counts(counts: Mapping[str, int], aligned: bool) -> None:
    """Raises FootageError where frame counts differ too much for one take. aligned : the offsets are known."""
    longest = max(counts.values())
    if not aligned and longest - min(counts.values()) > max(1.0, TRIMMED_SHARE * longest):
        words = ", ".join(f"{name}: {count}" for name, count in counts.items())
        raise FootageError(
            f"The cameras' frame counts differ ({words}).",
            "Give footage of the same take, cut to the same first and last frame, or the cameras' offsets.",
        )


def common_rate(
    measured: tuple[MeasuredCamera, ...],
    requested: float | None,
    known: float | None,
    warnings: list[str],
    by_time: bool = False,
) -> float:
    """Frames per second: the user's, the layout's, or that of the videos, which must agree unless frames are paired by
    time: then the slowest.
    """
    videos = [
        (entry.footage.name, entry.measure) for entry in measured if isinstance(entry.measure, VideoMeasure)
    ]
    rates = {name: measure.fps for name, measure in videos}
    uneven = {name: measure.uneven_frame for name, measure in videos if measure.uneven_frame >= 0}
    if requested is not None:
        other = [
            f"{name}: {rate:g}" for name, rate in rates.items() if abs(rate / requested - 1.0) > SAME_RATE
        ]
        if other or uneven:
            warnings.append(
                f"Taken as {requested:g} frames per second as requested; the videos' own differ"
                f" ({', '.join(other) or 'uneven times in ' + listed(uneven)})."
            )
        return requested
    if uneven and not by_time:
        name, frame = next(iter(uneven.items()))
        raise FootageError(
            f"'{name}' has a variable frame rate (frame {frame} is off an even {rates[name]:g} a second).",
            "Pair frames by their times (--by-time), re-encode it with a constant frame rate, or give --fps to take its"
            " frames as evenly spaced.",
        )
    if known is not None:
        return known
    measure = sorted(rates.values())
    if not measure or measure[0] <= 0.0:
        raise FootageError("The frame rate of the footage is unknown.", "Give the frame rate with --fps.")
    if measure[-1] / measure[0] - 1.0 > SAME_RATE and not by_time:
        raise different_rates(rates)
    return measure[0]


def different_rates(rates: Mapping[str, float]) -> FootageError:
    words = ", ".join(f"{name}: {rate:g}" for name, rate in rates.items())
    return FootageError(
        f"The videos' frame rates differ ({words}), so frames with one number were taken at different moments.",
        "Pair them by their times (--by-time), or give the right rate with --fps if the files are wrong.",
    )


Value = TypeVar("Value")
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
    plan: SourcePlan,
    calibration: Calibration,
    fps: float | None,
    progress: Progress,
    *,
    by_time: bool = False,
) -> MeasuredSource:
    """Match, decode and compare all footage. fps : the user's, which overrides all others. by_time : pair frames by
    their times, not by their numbers.

    Raises FootageError, CalibrationError.
    """
    names = [camera.name for camera in calibration.cameras]
    matching = match_names(
        [plan.part_name(path) for path in plan.footage], names, "videos or picture folders", FootageError
    )
    by_camera = {match.camera: path for match, path in zip(matching, plan.footage, strict=True)}
    used = [camera for camera in calibration.cameras if camera.name in by_camera]
    masks = _match(plan.masks, used, "masks")
    backgrounds = _match(plan.backgrounds, used, "backgrounds")
    turns = requested_turns(plan, by_camera)
    split = _by_camera(plan.fields, by_camera)
    # Of fields, videos announce the rate of their pictures.
    check_before_decoding(
        [by_camera[camera.name] for camera in used], fps or plan.fps, by_time or bool(plan.split or split)
    )
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
    measured = in_fields(measured, plan.split, split)
    aligning: list[str] = []
    measured, notes, aligned = with_offsets(plan, measured, names, aligning)
    warnings = [
        *aligning,
        *_without_footage(names, by_camera),
        *crop_warnings(calibration, measured),
        *gap_warnings(measured),
        *_without_background(measured),
    ]
    if by_time:
        rate = common_rate(measured, fps, plan.fps, warnings, by_time)
        measured, count, paired = with_times(plan, measured, names, rate)
        notes = (*notes, *paired)
    else:
        count = common_frame_count(measured, warnings, aligned)
        rate = common_rate(measured, fps, plan.fps, warnings)
        check_in_step(measured, rate, warnings, trusted=fps is not None or plan.timestamps is not None)
    notes = (*_turned_by_files(measured), *_split_in_fields(measured), *notes)
    warnings += _interlaced(measured, guess=plan.split == "auto")
    if plan.split and not any(entry.fields for entry in measured):
        notes = (*notes, "No video is interlaced: none was split into fields.")
    measured = tuple(
        _with_masks(entry, entry.masks, count, plan.masks_inverted, progress)
        if entry.masks is not None
        else entry
        for entry in measured
    )
    for entry in measured:
        if entry.mask_form is not None:
            notes = (*notes, *entry.mask_form.words(entry.camera.name))
            warnings += entry.mask_form.warnings(entry.camera.name)
        if entry.background is not None:
            _check_background(entry, entry.background)
    return MeasuredSource(measured, rate, count, matching, tuple(warnings), notes)


def check_in_step(
    measured: tuple[MeasuredCamera, ...], rate: float, warnings: list[str], *, trusted: bool
) -> None:
    """Raises FootageError where pictures with one number come to lie more than half a frame apart by the videos' times;
    trusted : warns only, as a rate or recorded times were given that say otherwise. A frame lost is a warning.
    """
    drifting = drifts(_own_times(measured, rate), rate)
    apart = [drift for drift in drifting if drift.first >= 0]
    words = " ".join(drift.words(rate) for drift in drifting)
    if apart and not trusted:
        raise FootageError(
            words,
            "Pair the frames by their times (--by-time), or give --fps to take them as evenly spaced in all cameras.",
        )
    if drifting:
        warnings.append(words)


def _own_times(measured: tuple[MeasuredCamera, ...], rate: float) -> dict[str, Array]:
    """Seconds of each camera's frames from its offset on, by its file, else at the common rate."""
    own: dict[str, Array] = {}
    for entry in measured:
        times = entry.measure.times if isinstance(entry.measure, VideoMeasure) else np.zeros(0)
        if len(times) != entry.measure.frame_count:
            times = np.arange(entry.measure.frame_count) / rate
        own[entry.camera.name] = times[entry.offset :]
    return own


def with_times(
    plan: SourcePlan, measured: tuple[MeasuredCamera, ...], known: Sequence[str], rate: float
) -> tuple[tuple[MeasuredCamera, ...], int, tuple[str, ...]]:
    """The cameras with their frames paired by time, the frames that all have, and what that came to. By a recorder's
    times where there are, else by the videos' own.
    """
    own = _own_times(measured, rate)
    if plan.timestamps is not None:
        recorded = read_timestamps(plan.timestamps)
        matches = match_names(list(recorded), known, f"cameras of {plan.timestamps.name}", FootageError)
        for match in matches:
            entry = next((one for one in measured if one.camera.name == match.camera), None)
            if entry is not None:
                times = _recorded_of(entry, recorded[match.footage])
                own[match.camera] = times[entry.offset : entry.measure.frame_count]
    steps, count = paired_by_time(own, rate)
    placed = tuple(dataclasses.replace(entry, steps=steps[entry.camera.name]) for entry in measured)
    changed = {name: len(one) for name, one in steps.items() if one}
    words = ", ".join(f"{name} at {number} places" for name, number in changed.items()) or "nowhere"
    note = f"Frames are paired by time, {count} at {rate:g} a second; copied or left out: {words}."
    return placed, count, (note,)


def _turned_by_files(measured: tuple[MeasuredCamera, ...]) -> tuple[str, ...]:
    """A note on videos that say themselves how they are to be turned."""
    turned = {
        entry.footage.name: entry.measure.turned
        for entry in measured
        if isinstance(entry.measure, VideoMeasure) and entry.measure.turned
    }
    words = ", ".join(f"{name} by {degrees} degrees" for name, degrees in turned.items())
    return (f"Turned clockwise as the files themselves say: {words}.",) if turned else ()


def _interlaced(measured: tuple[MeasuredCamera, ...], *, guess: bool) -> list[str]:
    """Warnings of videos with two moments in a picture, and of those split in a guessed or wrong order."""
    videos = {
        entry.footage.name: (entry.measure, entry.fields)
        for entry in measured
        if isinstance(entry.measure, VideoMeasure) and entry.measure.interlaced
    }
    whole = [name for name, (_, fields) in videos.items() if not fields]
    guessed = [
        name for name, (measure, fields) in videos.items() if guess and fields and not measure.first_field
    ]
    wrong = [
        name
        for name, (measure, fields) in videos.items()
        if fields and measure.first_field not in ("", fields)
    ]
    warnings: list[str] = []
    if whole:
        warnings.append(
            f"{listed(whole)} {_are(whole)} interlaced: each picture holds two moments in its odd and even lines,"
            " which fray what moves. Import it with --fields auto, which makes a frame of each."
        )
    if guessed:
        warnings.append(
            f"{listed(guessed)} {_are(guessed)} interlaced, and too little moves in it to see which field of a"
            " picture is the earlier. Where the movement jumps to and fro, import it with --fields top or bottom."
        )
    if wrong:
        other = videos[wrong[0]][0].first_field
        warnings.append(
            f"By what moves in {listed(wrong)}, the {other} field is the earlier one: import it with --fields {other}."
        )
    return warnings


def _are(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"


def in_fields(
    measured: tuple[MeasuredCamera, ...],
    split: Literal["", "auto", "top", "bottom"],
    before: Mapping[str, Fields],
) -> tuple[MeasuredCamera, ...]:
    """The cameras, of interlaced videos with a frame of each field. split : as of `ImportOptions.fields`; where an
    order is given and no video seems interlaced all are. before : the earlier field by camera, where none is requested.
    """
    if not split:
        return tuple(_of_fields(entry, before.get(entry.camera.name, "")) for entry in measured)
    seen: dict[str, Fields] = {
        entry.camera.name: entry.measure.first_field or "top"
        for entry in measured
        if isinstance(entry.measure, VideoMeasure) and entry.measure.interlaced
    }
    if split == "auto":
        return tuple(_of_fields(entry, seen.get(entry.camera.name, "")) for entry in measured)
    names = seen or {entry.camera.name for entry in measured}
    return tuple(_of_fields(entry, split if entry.camera.name in names else "") for entry in measured)


def _of_fields(entry: MeasuredCamera, first: Fields) -> MeasuredCamera:
    """The camera with a frame of each field of its video. first : the earlier one, "" to leave pictures whole."""
    measure = entry.measure
    if not first or not isinstance(measure, VideoMeasure):
        return entry
    count = 2 * measure.frame_count
    if count > MAX_FRAMES:
        raise FootageError(
            f"'{entry.footage.name}' has more than {MAX_FRAMES} fields.", "Cut it into pieces."
        )
    fields = dataclasses.replace(
        measure,
        frame_count=count,
        fps=2.0 * measure.fps,
        uneven_frame=2 * measure.uneven_frame if measure.uneven_frame >= 0 else -1,
        times=times_of_fields(measure.times, count),
    )
    return dataclasses.replace(entry, measure=fields, fields=first)


def _split_in_fields(measured: tuple[MeasuredCamera, ...]) -> tuple[str, ...]:
    """A note on videos that were split into their fields."""
    split = {entry.footage.name: entry for entry in measured if entry.fields}
    words = ", ".join(
        f"{name} ({entry.fields} field first, {entry.measure.frame_count} frames)"
        for name, entry in split.items()
    )
    return (
        (f"Split into fields, each a frame with the lines between interpolated: {words}.",) if split else ()
    )


def _recorded_of(entry: MeasuredCamera, times: Array) -> Array:
    """A recorder's times of a camera's frames: of each field, where it is split and the times are of its pictures."""
    return times_of_fields(times, entry.measure.frame_count) if entry.fields else times


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
    measure = _measure(footage, f"reading {footage.name}", progress)
    entry = MeasuredCamera(camera, footage, measure, None, masks, background, turned)
    if not calibration.sizes_known:
        return dataclasses.replace(entry, camera=_in_size(camera, *entry.size))
    bars = _bars(entry) if entry.size != (camera.width, camera.height) else NO_BARS
    fitted, crop = fit_camera(camera, *entry.size, bars)
    return dataclasses.replace(entry, camera=fitted, crop=crop or calibration.crops.get(camera.name))


def _measure(path: Path, step: str, progress: Progress) -> VideoMeasure | PicturesMeasure:
    def report(done: int, total: int) -> None:
        progress(step, done, total)

    return measure_pictures(path, report) if path.is_dir() else measure_video(path, report)


def _bars(entry: MeasuredCamera) -> Margins:
    footage, count = entry.footage, entry.measure.frame_count
    reader = PictureReader(footage, count) if footage.is_dir() else VideoReader(footage, count)
    try:
        return black_margins(lambda frame: turned_picture(reader.read(frame), entry.turned), count)
    finally:
        reader.close()


def _match(parts: tuple[Path, ...], cameras: list[Camera], what: str) -> dict[str, Path]:
    """Masks or backgrounds by camera; those of cameras without footage are passed over."""
    if not parts:
        return {}
    names = [camera.name for camera in cameras]
    matches = match_names([part_name(path) for path in parts], names, what, FootageError)
    return {match.camera: path for match, path in zip(matches, parts, strict=True)}


def _in_size(camera: Camera, width: int, height: int) -> Camera:
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


def _with_masks(
    entry: MeasuredCamera, masks: Path, count: int, inverted: bool, progress: Progress
) -> MeasuredCamera:
    """The camera with how its masks are meant. Raises FootageError where they do not fit the footage."""
    measure = _measure(masks, f"reading masks {masks.name}", progress)
    if (measure.width, measure.height) != (entry.measure.width, entry.measure.height):
        raise FootageError(
            f"The masks '{masks.name}' are {measure.width}x{measure.height} pixels, the footage"
            f" {entry.measure.width}x{entry.measure.height}.",
            "Give masks of the footage's size.",
        )
    last = entry.offset + file_frame(entry.steps, count - 1)
    if measure.frame_count <= last:
        raise FootageError(
            f"The masks '{masks.name}' have {measure.frame_count} frames, the footage {last + 1}.",
            "Give one mask for every field." if entry.fields else "Give one mask for every frame.",
        )
    form = form_of_masks(masks, measure.frame_count, inverted)
    return dataclasses.replace(entry, mask_form=form, mask_count=measure.frame_count)


def _check_background(entry: MeasuredCamera, background: Path) -> None:
    if is_picture(background):
        width, height = check_picture(background)
    else:
        measure = measure_video(background)
        width, height = measure.width, measure.height
    turned = background_turn(entry.turned, entry.size, (width, height)) in (90, 270)
    check_plate_size((height, width) if turned else (width, height), entry.size, background.name)


MOST_OFFSET = 1_000_000


def checked_turn(camera: str, degrees: int) -> Turn:
    """Degrees clockwise as 0, 90, 180 or 270 (-90 is 270). Raises FootageError for any other angle."""
    for turn in TURNS:
        if degrees % 360 == turn:
            return turn
    raise FootageError(
        f"Camera {camera} cannot be turned by {degrees} degrees.",
        "Turn it by 90, 180 or 270 degrees clockwise.",
    )


def in_step(offsets: Mapping[str, int]) -> dict[str, int]:
    """Offsets by camera, the smallest 0. Raises FootageError for an impossible one."""
    for camera, offset in offsets.items():
        if abs(offset) > MOST_OFFSET:
            raise FootageError(
                f"Camera {camera} cannot be {offset} frames off.", "Give its offset in frames."
            )
    least = min(offsets.values(), default=0)
    return {name: offset - least for name, offset in offsets.items()}


def requested_turns(plan: SourcePlan, footage: Mapping[str, Path]) -> dict[str, Turn]:
    """Turns by camera. footage : of every camera. Raises FootageError for names and angles that are none."""
    requested = _by_camera(plan.rotations, footage)
    return {camera: checked_turn(camera, degrees) for camera, degrees in requested.items()}


def with_offsets(
    plan: SourcePlan, measured: tuple[MeasuredCamera, ...], known: Sequence[str], warnings: list[str]
) -> tuple[tuple[MeasuredCamera, ...], tuple[str, ...], bool]:
    """Cameras with their offsets, these as sentences, and whether any were given.

    Those given by hand override recorded times; the camera that began last gets 0 … as its smallest offset. known :
    names of all calibrated cameras. Raises FootageError.
    """
    offsets = dict.fromkeys((entry.camera.name for entry in measured), 0)
    notes: list[str] = []
    if plan.timestamps is not None and not plan.offsets:
        offsets = _recorded(plan.timestamps, measured, known, notes, warnings)
    by_hand = _by_camera(plan.offsets, {entry.camera.name: entry.footage for entry in measured})
    offsets = in_step(offsets | by_hand)
    given = bool(by_hand) or plan.timestamps is not None
    if any(offsets.values()):
        words = ", ".join(f"{name}: {offset}" for name, offset in offsets.items())
        notes.append(f"Frame 0 of all cameras is frame so-and-so of their footage: {words}.")
    placed = tuple(dataclasses.replace(entry, offset=offsets[entry.camera.name]) for entry in measured)
    return placed, tuple(notes), given


def _recorded(
    path: Path,
    measured: tuple[MeasuredCamera, ...],
    known: Sequence[str],
    notes: list[str],
    warnings: list[str],
) -> dict[str, int]:
    """Offsets of a recorder's times. Raises FootageError if a camera has none."""
    times = read_timestamps(path)
    names = match_names(list(times), known, f"cameras of {path.name}", FootageError)
    entries = {entry.camera.name: entry for entry in measured}
    by_camera = {
        match.camera: _recorded_of(entries[match.camera], times[match.footage])
        for match in names
        if match.camera in entries
    }
    missing = [entry.camera.name for entry in measured if entry.camera.name not in by_camera]
    if missing:
        raise FootageError(
            f"'{path.name}' has no times of camera {listed(missing)}.",
            "Give the offsets by hand with --offset.",
        )
    for entry in measured:
        count, frames = len(by_camera[entry.camera.name]), entry.measure.frame_count
        if abs(count - frames) > 1:
            warnings.append(
                f"'{path.name}' has times of {count} frames of camera {entry.camera.name}, which has {frames}."
            )
    synchrony = offsets_from_times({entry.camera.name: by_camera[entry.camera.name] for entry in measured})
    notes.append(f"Offsets are taken from '{path.name}' ({synchrony.apart:.2f} frames apart at most).")
    warnings.extend(synchrony.notes)
    return synchrony.offsets


def _by_camera(requested: Mapping[str, Value], footage: Mapping[str, Path]) -> dict[str, Value]:
    """Requested values by camera, from names of cameras or of their footage. Raises FootageError for other names."""
    values: dict[str, Value] = {}
    for name, value in requested.items():
        fitting = [camera for camera, path in footage.items() if name in (camera, path.name, path.stem)]
        if len(fitting) != 1:
            raise FootageError(
                f"There is no camera '{name}'.", f"The cameras with footage are {listed(footage)}."
            )
        values[fitting[0]] = value
    return values
