"""Whether the cameras' footage agrees: sizes, frame counts, frame rates, missing pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from studio.capture.calibration_files import Calibration
from studio.capture.calibration_parts import AssumedCrop
from studio.capture.footage_source import Turn
from studio.capture.naming import listed
from studio.capture.pictures import PicturesMeasure
from studio.capture.video import VideoMeasure
from studio.capture.video_probe import probe_video
from studio.errors import FootageError
from studio.geometry.camera import Camera

SAME_RATE, ANNOUNCED_RATE = 0.005, 0.02
TRIMMED_SHARE = 0.1
"""Frame counts that differ by up to this share are trimmed to the shortest; beyond, it is an error."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredCamera:
    """One camera's parts, measured.

    camera : as fitted to the footage. footage, masks, background : source paths. found : what decoding the
    footage found, before turning. crop : what had to be assumed to make it fit, if anything. turned : degrees
    clockwise. offset : the file's frame that is frame 0 of all cameras.
    """

    camera: Camera
    footage: Path
    found: VideoMeasure | PicturesMeasure
    crop: AssumedCrop | None
    masks: Path | None
    background: Path | None
    turned: Turn = 0
    offset: int = 0

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the pictures once they are turned, px."""
        found = self.found
        return (found.height, found.width) if self.turned in (90, 270) else (found.width, found.height)


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
        entry.footage.name: entry.found.missing
        for entry in measured
        if isinstance(entry.found, PicturesMeasure)
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


def check_before_decoding(footage: Sequence[Path], fps: float | None) -> None:
    """Refuse at once what decoding would only find after minutes. fps : None where the videos' own rates count.

    Raises FootageError for videos that are not to be decoded, or whose announced frame rates differ much.
    """
    probes = {path.name: probe_video(path) for path in footage if path.is_file()}
    rates = {name: probe.fps for name, probe in probes.items() if probe.steady}
    known = sorted(rates.values())
    if fps is None and known and known[-1] / known[0] - 1.0 > ANNOUNCED_RATE:
        raise different_rates(rates)


def common_frame_count(
    measured: tuple[MeasuredCamera, ...], warnings: list[str], aligned: bool = False
) -> int:
    """The frames that all cameras have after their offsets. aligned : the offsets are known, so that footage may end
    at different moments.
    """
    counts = {entry.footage.name: entry.found.frame_count - entry.offset for entry in measured}
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
    measured: tuple[MeasuredCamera, ...], asked: float | None, known: float | None, warnings: list[str]
) -> float:
    """Frames per second: the user's, the layout's, or that of the videos, which must agree."""
    videos = [
        (entry.footage.name, entry.found) for entry in measured if isinstance(entry.found, VideoMeasure)
    ]
    rates = {name: found.fps for name, found in videos}
    uneven = {name: found.uneven_frame for name, found in videos if found.uneven_frame >= 0}
    if asked is not None:
        other = [f"{name}: {rate:g}" for name, rate in rates.items() if abs(rate / asked - 1.0) > SAME_RATE]
        if other or uneven:
            warnings.append(
                f"Taken as {asked:g} frames per second as asked, whatever the videos say"
                f" ({', '.join(other) or 'uneven times in ' + listed(uneven)})."
            )
        return asked
    if uneven:
        name, frame = next(iter(uneven.items()))
        raise FootageError(
            f"'{name}' has a variable frame rate (frame {frame} is off an even {rates[name]:g} a second).",
            "Re-encode it with a constant frame rate, or give --fps to take its frames as evenly spaced.",
        )
    if known is not None:
        return known
    found = sorted(rates.values())
    if not found or found[0] <= 0.0:
        raise FootageError(
            "The footage does not say how many frames a second it has.", "Give the frame rate with --fps."
        )
    if found[-1] / found[0] - 1.0 > SAME_RATE:
        raise different_rates(rates)
    return found[0]


def different_rates(rates: Mapping[str, float]) -> FootageError:
    """The error where footage was taken at several rates."""
    words = ", ".join(f"{name}: {rate:g}" for name, rate in rates.items())
    return FootageError(
        f"The videos' frame rates differ ({words}), so frames with one number were taken at different moments.",
        "Resample them to one rate, or give the right one with --fps if the files are wrong.",
    )
