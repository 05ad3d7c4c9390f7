"""The studio's own layout of a source, near enough to Pose2Sim's, FreeMoCap's and Caliscope's to read them.

    SOURCE/videos/*.mp4            or videos/<camera>/*.png, pictures/<camera>/*.png, or <camera>/*.png
    SOURCE/masks/                  videos or one folder of pictures a camera
    SOURCE/background/             a picture or an empty clip a camera
    SOURCE/calibration/            one calibration that can be read (or SOURCE/*calibration*.toml)
    SOURCE/truth/*.trc, subject.toml, start_pose.csv, sigma.csv, bodies/*.toml

Everything but footage and calibration may be missing. A session's own folder has this layout as well.
"""

from pathlib import Path

from studio.capture.calibration_files import find_calibrations
from studio.capture.naming import listed, natural_key
from studio.capture.pictures import is_picture, list_pictures
from studio.capture.video import VIDEO_SUFFIXES
from studio.errors import CalibrationError, FootageError
from studio.sessions.importers.plan import SourcePlan
from studio.sessions.manifest import FILE_NAME, read_manifest

FOOTAGE_FOLDERS = ("videos", "videos/synchronized", "synchronized_videos", "videos-raw", "pictures", "images")
OTHER_FOLDERS = frozenset(
    ("masks", "mask", "background", "backgrounds", "calibration", "truth", "bodies", "runs", "output", "pose")
)


def plan_folder(source: Path, calibration: Path | str | None) -> SourcePlan:
    """What a folder of this layout holds. Raises FootageError, CalibrationError naming what is missing."""
    footage = _footage(source)
    session = read_manifest(source) if (source / FILE_NAME).is_file() else None
    return SourcePlan(
        source=source,
        calibration=choose_calibration(source, calibration),
        footage=footage,
        masks=_entries(source / "masks") or _entries(source / "mask"),
        backgrounds=_backgrounds(source / "background") or _backgrounds(source / "backgrounds"),
        truth=tuple(sorted((source / "truth").glob("*.[tT][rR][cC]"))),
        bodies=tuple(sorted((source / "bodies").glob("*.toml"))),
        fps=session.fps if session else None,
        subject_file=_file(source / "subject.toml"),
        start_pose_file=_file(source / "start_pose.csv"),
        sigma_file=_file(source / "sigma.csv"),
        tracker=session.tracker if session else "",
        weighting=session.weighting if session else "",
    )


def choose_calibration(source: Path, wish: Path | str | None) -> Path:
    """The calibration to take: the one that is asked for, or the only one that can be read.

    wish : a path, or a file's name in the source's calibration folder. Raises CalibrationError.
    """
    folders = [
        folder for folder in sorted(source.iterdir()) if folder.is_dir() and "calib" in folder.name.lower()
    ]
    places = [*folders, source]
    if wish is not None:
        for path in (Path(wish), *(place / wish for place in places)):
            if path.exists():
                return path
        raise CalibrationError(
            f"There is no calibration '{wish}'.", f"Found in '{source.name}': {_found(places)}."
        )
    for place in places:
        found = find_calibrations(place)
        if len(found) == 1:
            return found[0]
        if found:
            raise CalibrationError(
                f"'{place.name}' holds {len(found)} calibrations: {listed(path.name for path in found)}.",
                "Choose one with --calibration NAME.",
            )
    raise CalibrationError(
        f"'{source.name}' holds no calibration that can be read.",
        "Put a Pose2Sim, aniposelib, FreeMoCap or Caliscope TOML or Bouguet .cal files into 'calibration/'.",
    )


def _footage(source: Path) -> tuple[Path, ...]:
    """Videos and picture folders, from the first place that has any."""
    for name in FOOTAGE_FOLDERS:
        found = _entries(source / name)
        if found:
            return found
    loose = [path for path in _entries(source) if not (path.is_dir() and path.name.lower() in OTHER_FOLDERS)]
    if not loose:
        raise FootageError(
            f"'{source.name}' holds no footage.",
            "Put one video a camera into 'videos/', or give one folder of pictures a camera.",
        )
    return tuple(loose)


def _entries(folder: Path) -> tuple[Path, ...]:
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


def _backgrounds(folder: Path) -> tuple[Path, ...]:
    """Pictures and clips."""
    if not folder.is_dir():
        return ()
    found = [
        path
        for path in folder.iterdir()
        if not path.name.startswith(".") and (is_picture(path) or path.suffix.lower() in VIDEO_SUFFIXES)
    ]
    return tuple(sorted(found, key=lambda path: natural_key(path.name)))


def _found(places: list[Path]) -> str:
    return listed(path.name for place in places for path in find_calibrations(place))


def _file(path: Path) -> Path | None:
    return path if path.is_file() else None
