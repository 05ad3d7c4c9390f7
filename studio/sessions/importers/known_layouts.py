"""Whose folder layout a source has, and where in it footage, calibration, masks and times lie.

    FreeMoCap   videos/synchronized/ (formerly synchronized_videos/) and *calibration*.toml beside it
    Caliscope   recordings/<take>/ with calibration/extrinsic/capture_volume/ or camera_array.toml above; or a take with
                a tracker's folder, which holds its own copy
    anipose     videos-raw/, several takes told apart by their names, and calibration/
    EasyMocap   intri.yml with extri.yml, videos/ or images/
    Pose2Sim    Config.toml in a trial or above trials; <trial>/videos/, calibration*/ in the trial or above it

Anything else is read as the studio's own layout (`folder_layout`). A folder above several trials names them.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from studio.capture.calibration_easymocap import is_easymocap
from studio.capture.naming import natural_key
from studio.capture.pictures import list_pictures
from studio.capture.timestamps import TIMESTAMP_NAMES
from studio.capture.video import VIDEO_SUFFIXES
from studio.sessions.manifest import FILE_NAME

FOOTAGE_FOLDERS = ("videos", "videos/synchronized", "synchronized_videos", "videos-raw", "pictures", "images")
OTHER_FOLDERS = frozenset(
    ("masks", "mask", "mask-schp", "background", "backgrounds", "calibration", "truth", "bodies", "runs", "output",
     "pose", "pose-3d", "kinematics", "annots", "logs", "annotated_videos", "output_data", "recordings")
)  # fmt: skip
MASK_FOLDERS = ("masks", "mask", "mask-schp")
CAMERA_IN_NAME = re.compile(r"[-_. ]*(?:camera|cam|view|port)[-_ ]*[0-9a-z]{1,4}(?=$|[-_. ])", re.IGNORECASE)
CALISCOPE_ARRAY = "camera_array.toml"
DEEPEST_TRIAL = 3
MOST_FOLDERS = 2000


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the parts of a source lie.

    title : whose layout, in words. folder : what everything but the calibration is taken from. calibrations : folders
    to look for it, the first one that has any. footage : videos and picture folders, natural order. timestamps : a
    recorder's times, None without.
    """

    title: str
    folder: Path
    footage: tuple[Path, ...]
    calibrations: tuple[Path, ...]
    timestamps: Path | None = None


def recognise(source: Path) -> Layout:
    """The layout of a folder that holds one trial; its footage may be empty."""
    footage = entries_of_first(source, FOOTAGE_FOLDERS)
    own = (*calibration_folders(source), source)
    if (source / FILE_NAME).is_file():
        return Layout("studio session", source, footage or loose_footage(source), own)
    if (source / "videos" / "synchronized").is_dir():
        return _timed(
            "FreeMoCap recording", source, entries(source / "videos" / "synchronized"), (source, *own)
        )
    if (source / "synchronized_videos").is_dir():
        return _timed(
            "FreeMoCap recording (older layout)",
            source,
            entries(source / "synchronized_videos"),
            (source, *own),
        )
    if (source / "videos-raw").is_dir():
        return _timed("anipose session", source, entries(source / "videos-raw"), own)
    if is_easymocap(source):
        return _timed("EasyMocap data set", source, footage or loose_footage(source), (source,))
    snapshots = tuple(path.parent for path in sorted(source.glob(f"*/{CALISCOPE_ARRAY}")))
    if (snapshots and loose_footage(source)) or (source / CALISCOPE_ARRAY).is_file():
        return _timed(
            "Caliscope recording", source, loose_footage(source) or footage, (source, *snapshots[-1:])
        )
    if (source / "Config.toml").is_file():
        return _timed("Pose2Sim trial", source, footage or loose_footage(source), own)
    return _timed("folder in the studio's layout", source, footage or loose_footage(source), own)


def trials_of(source: Path) -> dict[str, Layout]:
    """The trials below a folder that holds none itself, by the names to choose them with; empty if there are none."""
    if is_caliscope(source):
        return {take.folder.name: take for take in _caliscope_takes(source)}
    found: dict[str, Layout] = {}
    for folder in _folders_below(source, DEEPEST_TRIAL):
        if any(folder.is_relative_to(layout.folder) for layout in found.values()):
            continue
        if not _is_trial(folder):
            continue
        layout = recognise(folder)
        above = [place for place in _up_to(folder, source) for place in (*calibration_folders(place), place)]
        title = layout.title
        if title.startswith("folder") and (source / "Config.toml").is_file():
            title = "Pose2Sim trial"
        name = folder.relative_to(source).as_posix()
        found[name] = Layout(title, folder, layout.footage, (*layout.calibrations, *above), layout.timestamps)
    return found


def is_caliscope(source: Path) -> bool:
    """Whether a folder is a Caliscope workspace."""
    marks = (
        source / "calibration" / "extrinsic",
        source / "calibration" / "intrinsic",
        source / CALISCOPE_ARRAY,
    )
    return (source / "recordings").is_dir() and any(mark.exists() for mark in marks)


def takes_by_name(footage: tuple[Path, ...]) -> dict[str, tuple[Path, ...]]:
    """Videos of several takes in one folder, by what is left of their names without the camera's."""
    takes: dict[str, list[Path]] = {}
    for path in footage:
        name = path.name if path.is_dir() else path.stem
        takes.setdefault(CAMERA_IN_NAME.sub("", name).strip("-_. "), []).append(path)
    several = len(takes) > 1 and all(name and len(paths) > 1 for name, paths in takes.items())
    return {name: tuple(paths) for name, paths in takes.items()} if several else {}


def entries(folder: Path) -> tuple[Path, ...]:
    """The videos of a folder and its folders that hold pictures, in natural order."""
    if not folder.is_dir():
        return ()
    found = [
        path
        for path in folder.iterdir()
        if not path.name.startswith(".")
        and (bool(list_pictures(path)) if path.is_dir() else path.suffix.lower() in VIDEO_SUFFIXES)
    ]
    return tuple(sorted(found, key=lambda path: natural_key(path.name)))


def entries_of_first(source: Path, places: tuple[str, ...]) -> tuple[Path, ...]:
    """The entries of the first place that has any."""
    return next((found for place in places if (found := entries(source / place))), ())


def loose_footage(source: Path) -> tuple[Path, ...]:
    """Videos and picture folders that lie in the source itself."""
    return tuple(
        path
        for path in entries(source)
        if not (path.is_dir() and (path.name.lower() in OTHER_FOLDERS or "calib" in path.name.lower()))
    )


def calibration_folders(source: Path) -> tuple[Path, ...]:
    """Folders with 'calib' in their name."""
    return tuple(
        folder for folder in sorted(source.iterdir()) if folder.is_dir() and "calib" in folder.name.lower()
    )


def _caliscope_takes(source: Path) -> list[Layout]:
    calibration = source / "calibration"
    places = (calibration / "extrinsic" / "capture_volume", calibration / "extrinsic", source, calibration)
    takes = sorted(
        (folder for folder in (source / "recordings").iterdir() if folder.is_dir()),
        key=lambda folder: natural_key(folder.name),
    )
    return [
        _timed("Caliscope recording", take, entries(take), tuple(place for place in places if place.is_dir()))
        for take in takes
        if entries(take)
    ]


def _timed(title: str, folder: Path, footage: tuple[Path, ...], calibrations: tuple[Path, ...]) -> Layout:
    """A layout with the times that lie beside its footage."""
    beside = [folder, *{path.parent for path in footage}]
    times = [place / name for place in beside for name in TIMESTAMP_NAMES if (place / name).is_file()]
    return Layout(title, folder, footage, calibrations, times[0] if times else None)


def _is_trial(folder: Path) -> bool:
    """Whether a folder holds footage in a place of its own, or videos."""
    loose = [path for path in entries(folder) if path.is_file()]
    return bool(entries_of_first(folder, FOOTAGE_FOLDERS) or len(loose) > 1)


def _folders_below(source: Path, depth: int) -> list[Path]:
    """Folders that may be trials, parents first, in natural order."""
    found: list[Path] = []
    level = [source]
    for _ in range(depth):
        level = [
            path
            for folder in level
            for path in sorted(folder.iterdir(), key=lambda path: natural_key(path.name))
            if path.is_dir() and not path.is_symlink() and not path.name.startswith(".")
            and path.name.lower() not in OTHER_FOLDERS and "calib" not in path.name.lower()
        ]  # fmt: skip
        found += level
        if len(found) > MOST_FOLDERS:
            break
    return found


def _up_to(folder: Path, source: Path) -> list[Path]:
    """The folders above a trial up to the source, nearest first."""
    return [place for place in folder.parents if place.is_relative_to(source)]
