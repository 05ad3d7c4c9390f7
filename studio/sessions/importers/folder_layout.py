"""Folders of footage and calibration: the studio's own layout and those of `known_layouts`.

    SOURCE/videos/*.mp4            or videos/<camera>/*.png, pictures/<camera>/*.png, or <camera>/*.png
    SOURCE/masks/                  videos or one folder of pictures a camera
    SOURCE/background/             a picture or an empty clip a camera
    SOURCE/calibration/            one calibration that can be read (or SOURCE/*calibration*.toml)
    SOURCE/truth/*.trc, subject.toml, start_pose.csv, sigma.csv, bodies/*.toml, timestamps.csv

Everything but footage and calibration may be missing. A session's own folder has this layout as well.
"""

from pathlib import Path

from studio.capture.calibration_files import PICKLES, find_calibrations
from studio.capture.naming import listed, natural_key
from studio.capture.pictures import is_picture
from studio.capture.video import VIDEO_SUFFIXES
from studio.errors import CalibrationError, FootageError
from studio.sessions.importers.known_layouts import (
    MASK_FOLDERS,
    Layout,
    calibration_folders,
    entries,
    is_caliscope,
    recognise,
    takes_by_name,
    trials_of,
)
from studio.sessions.importers.plan import SourcePlan
from studio.sessions.manifest import FILE_NAME, read_manifest


def plan_folder(
    source: Path, calibration: Path | str | None, trial: str | None = None, *, bare: bool = False
) -> SourcePlan:
    """What a folder holds. trial : which one of several below it, or of several takes in one folder of videos. bare :
    footage alone will do; the plan's calibration is None where none can be chosen.

    Raises FootageError, CalibrationError naming what is missing, or the trials there are.
    """
    layout, footage = _chosen(source, trial)
    folder = layout.folder
    session = read_manifest(folder) if (folder / FILE_NAME).is_file() else None
    kept = session.footage.cameras if session else ()
    try:
        wanted, chosen = _calibration(folder, layout.calibrations, calibration), True
    except CalibrationError:
        if not bare or calibration is not None:
            raise
        wanted, chosen = folder, False
    said = f"calibration '{wanted.name}'" if chosen else "without a calibration"
    above = "" if folder == source else f" in '{source.name}'"
    return SourcePlan(
        source=folder,
        calibration=wanted if chosen else None,
        footage=footage,
        masks=next((found for name in MASK_FOLDERS if (found := entries(folder / name))), ()),
        backgrounds=_backgrounds(folder / "background") or _backgrounds(folder / "backgrounds"),
        truth=tuple(sorted((folder / "truth").glob("*.[tT][rR][cC]"))),
        bodies=tuple(sorted((folder / "bodies").glob("*.toml"))),
        fps=session.fps if session else None,
        subject_file=_file(folder / "subject.toml"),
        start_pose_file=_file(folder / "start_pose.csv"),
        sigma_file=_file(folder / "sigma.csv"),
        tracker=session.tracker if session else "",
        weighting=session.weighting if session else "",
        notes=(f"Taken for a {layout.title}: '{folder.name}'{above}, {said}.",),
        layout=layout.title,
        timestamps=layout.timestamps,
        offsets={camera.name: camera.offset for camera in kept if camera.offset},
        rotations={camera.name: camera.turned for camera in kept if camera.turned},
    )


def choose_calibration(source: Path, wish: Path | str | None) -> Path:
    """The calibration to take from a source: the one that is asked for, or the only one that can be read.

    wish : a path, or a file's name in the source's calibration folder. Raises CalibrationError.
    """
    return _calibration(source, (*calibration_folders(source), source), wish)


def _chosen(source: Path, trial: str | None) -> tuple[Layout, tuple[Path, ...]]:
    """The trial to take and its footage. Raises FootageError."""
    layout = None if is_caliscope(source) else recognise(source)
    if layout is None or not layout.footage:
        trials = trials_of(source)
        if not trials:
            raise FootageError(
                f"'{source.name}' holds no footage.",
                "Put one video a camera into 'videos/', or give one folder of pictures a camera.",
            )
        layout = trials[_one_of(source, tuple(trials), trial)]
        trial = None
    takes = takes_by_name(layout.footage)
    if takes:
        return layout, takes[_one_of(layout.folder, tuple(takes), trial)]
    if trial is not None:
        raise FootageError(
            f"'{source.name}' is one trial and holds none named '{trial}'.",
            "Leave the trial out, or give its folder.",
        )
    return layout, layout.footage


def _one_of(source: Path, names: tuple[str, ...], trial: str | None) -> str:
    """The trial that is asked for, or the only one. Raises FootageError naming all."""
    if trial in names:
        return str(trial)
    if trial is None and len(names) == 1:
        return names[0]
    there = f"'{source.name}' holds {len(names)} trials: {listed(names)}"
    if trial is None:
        raise FootageError(f"{there}.", f"Choose one with --trial {sorted(names, key=natural_key)[0]}.")
    raise FootageError(f"There is no trial '{trial}'; {there}.", "Choose one of them with --trial NAME.")


def _calibration(source: Path, places: tuple[Path, ...], wish: Path | str | None) -> Path:
    """The one that is asked for, or the only one of the first place that has any. Raises CalibrationError."""
    if wish is not None:
        for path in (Path(wish), *(place / wish for place in places)):
            if path.exists():
                return path
        there = listed(path.name for place in places for path in find_calibrations(place))
        raise CalibrationError(f"There is no calibration '{wish}'.", f"Found in '{source.name}': {there}.")
    for place in places:
        found = find_calibrations(place)
        if len(found) == 1:
            return found[0]
        if found:
            raise CalibrationError(
                f"'{place.name}' holds {len(found)} calibrations: {listed(path.name for path in found)}.",
                "Choose one with --calibration NAME.",
            )
    pickles = [path.name for place in places for path in place.iterdir() if path.suffix.lower() in PICKLES]
    if pickles:
        raise CalibrationError(
            f"'{source.name}' holds no calibration but '{pickles[0]}', a Python pickle, which can run any program when"
            " it is opened and is not read.",
            "Convert it where you trust it (Pose2Sim converts OpenCap's), and put the TOML into 'calibration/'.",
        )
    raise CalibrationError(
        f"'{source.name}' holds no calibration that can be read.",
        "Put a TOML of Pose2Sim, aniposelib, FreeMoCap or Caliscope, EasyMocap's or OpenCV's YAML, a Qualisys .qca.txt"
        " or Bouguet .cal files into 'calibration/'; for a trial of several, import the folder above with --trial.",
    )


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


def _file(path: Path) -> Path | None:
    return path if path.is_file() else None
