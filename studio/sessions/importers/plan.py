"""What was found in a source, before anything of it is opened or copied."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from studio.arrays import Array
from studio.body.subject import Subject
from studio.capture.footage_source import TURNS, Turn
from studio.capture.naming import listed, match_names
from studio.capture.timestamps import offsets_from_times, read_timestamps
from studio.errors import FootageError
from studio.sessions.importers.measuring import MeasuredCamera


@dataclass(frozen=True, slots=True)
class SourcePlan:
    """The parts of a source.

    calibration : a file, or the folder of several .cal files; None where footage is added without. footage, masks :
    videos and folders of pictures. backgrounds : pictures and clips. fps : known frame rate or None. subject,
    start_pose, sigma :
    values where the layout gives them in a form of its own; the files of the same names otherwise.
    sigma_fps : the rate at which sigma was measured. tracker, weighting : what runs of the session use unless
    told otherwise, "" for the default. layout : whose folder layout it was taken for, in words. timestamps : a
    recorder's times of the frames. offsets, rotations : asked for by hand, by the name of a camera or its footage.
    """

    source: Path
    calibration: Path | None
    footage: tuple[Path, ...]
    masks: tuple[Path, ...] = ()
    backgrounds: tuple[Path, ...] = ()
    truth: tuple[Path, ...] = ()
    bodies: tuple[Path, ...] = ()
    fps: float | None = None
    subject: Subject | None = None
    subject_file: Path | None = None
    start_pose: Array | None = None
    start_pose_file: Path | None = None
    sigma: Array | None = None
    sigma_fps: float = 0.0
    sigma_file: Path | None = None
    tracker: str = ""
    weighting: str = ""
    notes: tuple[str, ...] = ()
    layout: str = ""
    timestamps: Path | None = None
    offsets: Mapping[str, int] = field(default_factory=dict)
    rotations: Mapping[str, int] = field(default_factory=dict)

    def without_person(self) -> "SourcePlan":
        """The footage alone: start pose and truth belong to a calibration."""
        return replace(
            self,
            truth=(),
            bodies=(),
            subject=None,
            subject_file=None,
            start_pose=None,
            start_pose_file=None,
            sigma=None,
            sigma_file=None,
        )


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
    """Offsets by camera, the smallest 0. Raises FootageError for one that cannot be."""
    for camera, offset in offsets.items():
        if abs(offset) > MOST_OFFSET:
            raise FootageError(
                f"Camera {camera} cannot be {offset} frames off.", "Give its offset in frames."
            )
    least = min(offsets.values(), default=0)
    return {name: offset - least for name, offset in offsets.items()}


def turns_asked(plan: SourcePlan, footage: Mapping[str, Path]) -> dict[str, Turn]:
    """Turns by camera. footage : of every camera. Raises FootageError for names and angles that are none."""
    asked = _by_camera(plan.rotations, footage)
    return {camera: checked_turn(camera, degrees) for camera, degrees in asked.items()}


def with_offsets(
    plan: SourcePlan, measured: tuple[MeasuredCamera, ...], known: Sequence[str], warnings: list[str]
) -> tuple[tuple[MeasuredCamera, ...], tuple[str, ...], bool]:
    """Cameras with their offsets, sentences that say them, and whether any were told.

    Those given by hand go before recorded times; the camera that began last gets 0 … as its smallest offset. known :
    names of all calibrated cameras. Raises FootageError.
    """
    offsets = dict.fromkeys((entry.camera.name for entry in measured), 0)
    notes: list[str] = []
    if plan.timestamps is not None and not plan.offsets:
        offsets = _recorded(plan.timestamps, measured, known, notes, warnings)
    by_hand = _by_camera(plan.offsets, {entry.camera.name: entry.footage for entry in measured})
    offsets = in_step(offsets | by_hand)
    told = bool(by_hand) or plan.timestamps is not None
    if any(offsets.values()):
        words = ", ".join(f"{name}: {offset}" for name, offset in offsets.items())
        notes.append(f"Frame 0 of all cameras is frame so-and-so of their footage: {words}.")
    placed = tuple(dataclasses.replace(entry, offset=offsets[entry.camera.name]) for entry in measured)
    return placed, tuple(notes), told


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
    by_camera = {match.camera: times[match.footage] for match in names}
    missing = [entry.camera.name for entry in measured if entry.camera.name not in by_camera]
    if missing:
        raise FootageError(
            f"'{path.name}' has no times of camera {listed(missing)}.",
            "Give the offsets by hand with --offset.",
        )
    for entry in measured:
        count, frames = len(by_camera[entry.camera.name]), entry.found.frame_count
        if abs(count - frames) > 1:
            warnings.append(
                f"'{path.name}' has times of {count} frames of camera {entry.camera.name}, which has {frames}."
            )
    found = offsets_from_times({entry.camera.name: by_camera[entry.camera.name] for entry in measured})
    notes.append(f"Offsets are taken from '{path.name}' ({found.apart:.2f} frames apart at most).")
    warnings.extend(found.notes)
    return found.offsets


def _by_camera(asked: Mapping[str, int], footage: Mapping[str, Path]) -> dict[str, int]:
    """What was asked by the name of a camera or of its footage, by camera. Raises FootageError for other names."""
    found: dict[str, int] = {}
    for name, value in asked.items():
        fitting = [camera for camera, path in footage.items() if name in (camera, path.name, path.stem)]
        if len(fitting) != 1:
            raise FootageError(
                f"There is no camera '{name}'.", f"The cameras with footage are {listed(footage)}."
            )
        found[fitting[0]] = value
    return found
