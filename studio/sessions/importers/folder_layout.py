"""Folders of footage and calibration: the studio's own layout and those of other tools.

    SOURCE/videos/*.mp4            or videos/<camera>/*.png, pictures/<camera>/*.png, or <camera>/*.png
    SOURCE/masks/                  videos or one folder of pictures a camera
    SOURCE/background/             a picture or an empty clip a camera
    SOURCE/calibration/            one calibration that can be read (or SOURCE/*calibration*.toml)
    SOURCE/truth/*.trc, subject.toml, start_pose.csv, sigma.csv, bodies/*.toml (*.urdf, *.xml), timestamps.csv
    SOURCE/truth/*.csv             named points in the world of the calibration, or of another one of these cameras that
                                   lies beside them

Everything but footage and calibration may be missing. A session's own folder has this layout as well.

Layouts of other tools:

    FreeMoCap   videos/synchronized/ (formerly synchronized_videos/) and *calibration*.toml beside it
    Caliscope   recordings/<take>/ with calibration/extrinsic/capture_volume/ or camera_array.toml above; or a take with
                a tracker's folder, which holds its own copy
    anipose     videos-raw/, several takes distinguished by their names, and calibration/
    EasyMocap   intri.yml with extri.yml, videos/ or images/
    OpenCap     Videos/<camera>/InputMedia/<trial>/, and the camera's pickle in Videos/<camera>/
    DANNCE      videos/<camera>/0.mp4, calibration/*.mat or the label3d file that io.yaml names
    Pose2Sim    Config.toml in a trial or above trials; <trial>/videos/, calibration*/ in the trial or above it

Anything else is read as the studio's own layout (`folder_layout`). A folder above several trials names them.
"""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from studio.body.catalogue import body_files
from studio.body.motion_files.truth_files import READERS
from studio.footage.capture.calibration_easymocap import is_easymocap
from studio.footage.capture.calibration_files import PICKLES, find_calibrations
from studio.footage.capture.naming import listed, natural_key
from studio.footage.capture.pictures import is_picture, list_pictures
from studio.footage.capture.timestamps import TIMESTAMP_NAMES
from studio.footage.capture.video import VIDEO_SUFFIXES
from studio.foundations.errors import CalibrationError, FootageError
from studio.sessions.importers.plan import SourcePlan
from studio.sessions.importers.points_of_tools import DANNCE_PROJECT, label3d_of, points_of_tool
from studio.sessions.manifest import FILE_NAME, read_manifest

FOOTAGE_FOLDERS = ("videos", "videos/synchronized", "synchronized_videos", "videos-raw", "pictures", "images")
OTHER_FOLDERS = frozenset(
    ("masks", "mask", "mask-schp", "background", "backgrounds", "calibration", "truth", "bodies", "runs", "output",
     "pose", "pose-3d", "kinematics", "annots", "logs", "annotated_videos", "output_data", "recordings")
)  # fmt: skip
MASK_FOLDERS = ("masks", "mask", "mask-schp")
CAMERA_IN_NAME = re.compile(r"[-_. ]*(?:camera|cam|view|port)[-_ ]*[0-9a-z]{1,4}(?=$|[-_. ])", re.IGNORECASE)
CALISCOPE_ARRAY = "camera_array.toml"
CAMERA_FOLDER = re.compile(r"(?:camera|cam|view|port|c)[-_ ]*[0-9a-z]{1,6}$", re.IGNORECASE)
UNREADABLE = {
    ".heic": "convert them to JPEG or PNG",
    ".heif": "convert them to JPEG or PNG",
    ".avif": "convert them to JPEG or PNG",
    ".dng": "develop them to JPEG or PNG",
    ".cr2": "develop them to JPEG or PNG",
    ".nef": "develop them to JPEG or PNG",
    ".arw": "develop them to JPEG or PNG",
    ".gif": "convert them to PNG or a video",
    ".insv": "export them as flat videos",
    ".braw": "export them as H.264",
    ".r3d": "export them as H.264",
    ".mxf": "export them as H.264",
    ".wmv": "convert them to H.264 in mp4",
    ".flv": "convert them to H.264 in mp4",
    ".3gp": "convert them to H.264 in mp4",
    ".bag": "export the colour stream as a video",
    ".svo": "export the left view as a video",
    ".mkv.part": "the download is not complete",
}
DEEPEST_VIDEO = 4
DEEPEST_TRIAL = 3
MOST_FOLDERS = 2000


@dataclass(frozen=True, slots=True)
class Layout:
    """The places of the parts of a source.

    title : of the layout. folder : of everything but the calibration. calibrations : folders
    to look for it, the first one that has any. footage : videos and picture folders, natural order. timestamps : a
    recorder's times, None without. names : cameras of footage that its folder, not its file, is named after. take : the
    name of what was chosen of several in the folder.
    """

    title: str
    folder: Path
    footage: tuple[Path, ...]
    calibrations: tuple[Path, ...]
    timestamps: Path | None = None
    names: Mapping[Path, str] = field(default_factory=dict[Path, str])
    take: str = ""


def recognise(source: Path) -> Layout:
    """The layout of a folder that holds one trial; its footage may be empty."""
    footage = entries_of_first(source, FOOTAGE_FOLDERS)
    own = (*calibration_folders(source), source)
    if (source / FILE_NAME).is_file():
        return Layout("studio session", source, footage or loose_footage(source), own)
    if (source / "videos" / "synchronized").is_dir():
        return _with_times(
            "FreeMoCap recording", source, entries(source / "videos" / "synchronized"), (source, *own)
        )
    if (source / "synchronized_videos").is_dir():
        return _with_times(
            "FreeMoCap recording (older layout)",
            source,
            entries(source / "synchronized_videos"),
            (source, *own),
        )
    if (source / "videos-raw").is_dir():
        return _with_times("anipose session", source, entries(source / "videos-raw"), own)
    if is_easymocap(source):
        return _with_times("EasyMocap data set", source, footage or loose_footage(source), (source,))
    snapshots = tuple(path.parent for path in sorted(source.glob(f"*/{CALISCOPE_ARRAY}")))
    if (snapshots and loose_footage(source)) or (source / CALISCOPE_ARRAY).is_file():
        return _with_times(
            "Caliscope recording", source, loose_footage(source) or footage, (source, *snapshots[-1:])
        )
    if (source / DANNCE_PROJECT).is_file():
        return _with_times("DANNCE project", source, footage or loose_footage(source), own)
    if (source / "Config.toml").is_file():
        return _with_times("Pose2Sim trial", source, footage or loose_footage(source), own)
    return _with_times("folder in the studio's layout", source, footage or loose_footage(source), own)


def trials_of(source: Path) -> dict[str, Layout]:
    """The trials below a folder that holds none itself, by name; empty if there are none."""
    if is_caliscope(source):
        return {take.folder.name: take for take in _caliscope_takes(source)}
    if is_opencap(source):
        return _opencap_trials(source)
    takes = _takes_of_camera_folders(source)
    if takes:
        return takes
    trials: dict[str, Layout] = {}
    for folder in _folders_below(source, DEEPEST_TRIAL):
        if any(folder.is_relative_to(layout.folder) for layout in trials.values()):
            continue
        if not _is_trial(folder):
            continue
        layout = recognise(folder)
        above = [place for place in _up_to(folder, source) for place in (*calibration_folders(place), place)]
        title = layout.title
        if title.startswith("folder") and (source / "Config.toml").is_file():
            title = "Pose2Sim trial"
        name = folder.relative_to(source).as_posix()
        trials[name] = Layout(
            title, folder, layout.footage, (*layout.calibrations, *above), layout.timestamps
        )
    return trials


def is_caliscope(source: Path) -> bool:
    marks = (
        source / "calibration" / "extrinsic",
        source / "calibration" / "intrinsic",
        source / CALISCOPE_ARRAY,
    )
    return (source / "recordings").is_dir() and any(mark.exists() for mark in marks)


def is_opencap(source: Path) -> bool:
    """Whether a folder is a session that OpenCap offers for download."""
    return bool(_opencap_cameras(source))


def _opencap_cameras(source: Path) -> list[Path]:
    folders = (source / "Videos").iterdir() if (source / "Videos").is_dir() else ()
    cameras = [path for path in folders if (path / "InputMedia").is_dir() and not path.is_symlink()]
    return sorted(cameras, key=lambda path: natural_key(path.name))


def _opencap_trials(source: Path) -> dict[str, Layout]:
    """The trials that every camera has a video of, without the board's; synchronised videos are preferred."""
    cameras = _opencap_cameras(source)
    videos: dict[str, dict[str, Path]] = {}
    for camera in cameras:
        for folder in sorted((camera / "InputMedia").iterdir(), key=lambda path: natural_key(path.name)):
            files = [path for path in entries(folder) if path.is_file()]
            synchronised = [path for path in files if path.stem.endswith("_sync")] or files
            if len(synchronised) == 1 and folder.name.lower() != "calibration":
                videos.setdefault(folder.name, {})[camera.name] = synchronised[0]
    places = (*calibration_folders(source), source / "Videos", source)
    return {
        trial: Layout(
            "OpenCap session",
            source,
            tuple(files.values()),
            places,
            names={video: camera for camera, video in files.items()},
            take=trial,
        )
        for trial, files in videos.items()
        if len(files) == len(cameras)
    }


def _takes_of_camera_folders(source: Path) -> dict[str, Layout]:
    """Takes of which folders named after cameras hold a video each, by the videos' names without the camera's; of those
    that every camera has. Raises FootageError where cameras' folders hold several videos and no name is in all.
    """
    for place in (source / "videos", source / "videos-raw", source):
        folders = sorted(place.iterdir(), key=lambda path: natural_key(path.name)) if place.is_dir() else []
        cameras = [path for path in folders if CAMERA_FOLDER.match(path.name) and path.is_dir()]
        videos = {camera: [path for path in entries(camera) if path.is_file()] for camera in cameras}
        if len(cameras) < 2 or min(map(len, videos.values())) < 2:
            continue
        takes: dict[str, dict[Path, str]] = {}
        for camera, clips in videos.items():
            for video in clips:
                name = CAMERA_IN_NAME.sub("", video.stem).strip("-_. ") or video.stem
                takes.setdefault(name, {})[video] = camera.name
        whole = {name: clips for name, clips in takes.items() if len(set(clips.values())) == len(cameras)}
        if not whole:
            raise FootageError(
                f"The folders {listed(path.name for path in cameras)} hold several videos each, and none has the same"
                " name in all.",
                "Give the videos of one take the same name in every camera's folder, or leave one video in each.",
            )
        own = (*calibration_folders(source), source)
        return {
            name: Layout("folder a camera", source, tuple(clips), own, names=clips, take=name)
            for name, clips in whole.items()
            if len(clips) == len(cameras)
        }
    return {}


def takes_by_name(footage: tuple[Path, ...]) -> dict[str, tuple[Path, ...]]:
    """Videos of several takes in one folder, by their names without the camera's."""
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
    inside = [
        path
        for path in folder.iterdir()
        if not path.name.startswith(".")
        and (bool(list_pictures(path)) if path.is_dir() else path.suffix.lower() in VIDEO_SUFFIXES)
    ]
    return tuple(sorted(inside, key=lambda path: natural_key(path.name)))


def entries_of_first(source: Path, places: tuple[str, ...]) -> tuple[Path, ...]:
    return next((inside for place in places if (inside := entries(source / place))), ())


def loose_footage(source: Path) -> tuple[Path, ...]:
    """Videos and picture folders that lie in the source itself."""
    return tuple(
        path
        for path in entries(source)
        if not (path.is_dir() and (path.name.lower() in OTHER_FOLDERS or "calib" in path.name.lower()))
    )


def calibration_folders(source: Path) -> tuple[Path, ...]:
    return tuple(
        folder for folder in sorted(source.iterdir()) if folder.is_dir() and "calib" in folder.name.lower()
    )


def video_of_a_camera(folder: Path) -> Path | None:
    """The only video of a folder that a camera's recordings lie in, however deep (a copied card, DANNCE's
    `Camera1/0.mp4`, OpenCap's `Cam0/InputMedia/walk/walk_sync.mp4`); None where there is none or several.
    """
    level, clips = [folder], list[Path]()
    for _ in range(DEEPEST_VIDEO):
        inside = [path for one in level for path in one.iterdir() if not path.name.startswith(".")]
        clips += [path for path in inside if path.suffix.lower() in VIDEO_SUFFIXES and path.is_file()]
        level = [
            path
            for path in inside
            if path.is_dir() and not path.is_symlink() and path.name.lower() not in OTHER_FOLDERS
        ]
        if len(clips) > 1 or len(level) > MOST_FOLDERS:
            return None
    return clips[0] if clips else None


def folders_of_cameras(source: Path) -> dict[str, Path]:
    """Camera → its video, in folders of `source` (or of its folder of videos) that are named after cameras and hold one
    video each; empty where fewer than two do, or one of them holds several.
    """
    places = [
        path for path in source.iterdir() if path.is_dir() and path.name.lower() in ("videos", "videos-raw")
    ]
    for place in (*places, source):
        folders = [
            path
            for path in place.iterdir()
            if path.is_dir() and not path.is_symlink() and not path.name.startswith(".")
            and path.name.lower() not in OTHER_FOLDERS and "calib" not in path.name.lower()
            and path.name.lower() not in FOOTAGE_FOLDERS
        ]  # fmt: skip
        named = [path for path in folders if CAMERA_FOLDER.match(path.name)] or folders
        clips = {path.name: video for path in named if (video := video_of_a_camera(path)) is not None}
        if len(clips) > 1 and (len(clips) == len(named)):
            return {name: clips[name] for name in sorted(clips, key=natural_key)}
    return {}


def what_was_found(source: Path) -> str:
    """What a folder without footage holds instead, a sentence; "" for nothing of note."""
    kinds: Counter[str] = Counter()
    videos: list[str] = []
    broken: list[str] = []
    for folder in (source, *_folders_below(source, DEEPEST_VIDEO)):
        for path in folder.iterdir():
            ending = path.suffix.lower()
            if path.is_symlink() and not path.exists():
                broken.append(path.relative_to(source).as_posix())
            elif ending in VIDEO_SUFFIXES:
                videos.append(path.relative_to(source).as_posix())
            elif ending in UNREADABLE:
                kinds[ending] += 1
    sentences: list[str] = []
    if kinds:
        ending, count = kinds.most_common(1)[0]
        sentences.append(f"It has {count} {ending} files, which are not read: {UNREADABLE[ending]}.")
    if videos:
        more = f" and {len(videos) - 4} more" if len(videos) > 4 else ""
        sentences.append(f"Videos lie deeper: {', '.join(videos[:4])}{more}.")
    if broken:
        sentences.append(f"'{broken[0]}' is a link to a file that does not exist.")
    return " ".join(sentences)


def _caliscope_takes(source: Path) -> list[Layout]:
    calibration = source / "calibration"
    places = (calibration / "extrinsic" / "capture_volume", calibration / "extrinsic", source, calibration)
    takes = sorted(
        (folder for folder in (source / "recordings").iterdir() if folder.is_dir()),
        key=lambda folder: natural_key(folder.name),
    )
    return [
        _with_times(
            "Caliscope recording", take, entries(take), tuple(place for place in places if place.is_dir())
        )
        for take in takes
        if entries(take)
    ]


def _with_times(
    title: str, folder: Path, footage: tuple[Path, ...], calibrations: tuple[Path, ...]
) -> Layout:
    """A layout with the times that lie beside its footage."""
    beside = [folder, *{path.parent for path in footage}]
    times = [place / name for place in beside for name in TIMESTAMP_NAMES if (place / name).is_file()]
    return Layout(title, folder, footage, calibrations, times[0] if times else None)


def _is_trial(folder: Path) -> bool:
    """Whether a folder holds footage in a place of its own, or videos."""
    loose = [path for path in entries(folder) if path.is_file()]
    return bool(entries_of_first(folder, FOOTAGE_FOLDERS) or len(loose) > 1)


def _folders_below(source: Path, depth: int) -> list[Path]:
    folders: list[Path] = []
    level = [source]
    for _ in range(depth):
        level = [
            path
            for folder in level
            for path in sorted(folder.iterdir(), key=lambda path: natural_key(path.name))
            if path.is_dir() and not path.is_symlink() and not path.name.startswith(".")
            and path.name.lower() not in OTHER_FOLDERS and "calib" not in path.name.lower()
        ]  # fmt: skip
        folders += level
        if len(folders) > MOST_FOLDERS:
            break
    return folders


def _up_to(folder: Path, source: Path) -> list[Path]:
    return [place for place in folder.parents if place.is_relative_to(source)]


def plan_folder(
    source: Path, calibration: Path | str | None, trial: str | None = None, *, bare: bool = False
) -> SourcePlan:
    """The parts of a folder. trial : one of several below it, or of several takes in one folder of videos. bare :
    footage alone is enough; the plan's calibration is None if none can be chosen.

    Raises FootageError, CalibrationError naming what is missing, or the trials there are.
    """
    layout, footage = _chosen(source, trial)
    folder = layout.folder
    session = read_manifest(folder) if (folder / FILE_NAME).is_file() else None
    kept = session.footage.cameras if session else ()
    try:
        wanted, chosen = _calibration(folder, layout.calibrations, calibration or label3d_of(folder)), True
    except CalibrationError:
        if not bare or calibration is not None:
            raise
        wanted, chosen = folder, False
    calibration_note = f"calibration '{wanted.name}'" if chosen else "without a calibration"
    above = "" if folder == source else f" in '{source.name}'"
    article = "an" if layout.title[0].lower() in "aeiou" else "a"
    truth = _truths(folder / "truth")
    points, several = (None, "") if truth or session else points_of_tool(folder, layout.take)
    return SourcePlan(
        source=folder,
        calibration=wanted if chosen else None,
        footage=footage,
        masks=next((inside for name in MASK_FOLDERS if (inside := entries(folder / name))), ()),
        backgrounds=_backgrounds(folder / "background") or _backgrounds(folder / "backgrounds"),
        truth=truth,
        points=points,
        bodies=body_files(folder / "bodies"),
        fps=session.fps if session else None,
        subject_file=_file(folder / "subject.toml"),
        start_pose_file=_file(folder / "start_pose.csv"),
        sigma_file=_file(folder / "sigma.csv"),
        tracker=session.tracker if session else "",
        weighting=session.weighting if session else "",
        notes=(
            f"Taken for {article} {layout.title}: '{folder.name}'{above}, {calibration_note}.",
            *([several] if several else []),
        ),
        layout=layout.title,
        timestamps=layout.timestamps,
        names=layout.names,
        offsets={camera.name: camera.offset for camera in kept if camera.offset},
        rotations={camera.name: camera.turned for camera in kept if camera.turned},
        fields={camera.name: camera.fields for camera in kept if camera.fields},
    )


def _truths(folder: Path) -> tuple[Path, ...]:
    """Files of a true motion."""
    files = folder.iterdir() if folder.is_dir() else ()
    return tuple(sorted(path for path in files if path.suffix.lower() in READERS and path.is_file()))


def choose_calibration(source: Path, choice: Path | str | None) -> Path:
    """The calibration to take from a source: the requested one, or the only readable one.

    choice : a path, or a file's name in the source's calibration folder. Raises CalibrationError.
    """
    return _calibration(source, (*calibration_folders(source), source), choice)


def _chosen(source: Path, trial: str | None) -> tuple[Layout, tuple[Path, ...]]:
    """The trial to take and its footage. Raises FootageError."""
    layout = None if is_caliscope(source) or is_opencap(source) else recognise(source)
    if layout is not None and not layout.footage and not trials_of(source):
        cameras = folders_of_cameras(source)
        names = {video: name for name, video in cameras.items()}
        layout = replace(layout, footage=tuple(cameras.values()), names=names)
    _check_links(source, layout)
    if layout is None or not layout.footage:
        trials = trials_of(source)
        if not trials:
            content = what_was_found(source)
            raise FootageError(
                f"'{source.name}' holds no footage" + (f". {content}" if content else "."),
                "Put one video a camera into 'videos/' (or into a folder named after the camera, one in each), or give"
                " one folder of pictures a camera.",
            )
        layout = trials[_one_of(source, tuple(trials), trial)]
        trial = None
    takes = takes_by_name(layout.footage) if not layout.names else {}
    if takes:
        take = _one_of(layout.folder, tuple(takes), trial)
        return replace(layout, take=take), takes[take]
    if trial is not None:
        raise FootageError(
            f"'{source.name}' is one trial and holds none named '{trial}'.",
            "Leave the trial out, or give its folder.",
        )
    return layout, layout.footage


def _check_links(source: Path, layout: Layout | None) -> None:
    """Raises FootageError for links to videos that are not there, beside the footage."""
    for place in {path.parent for path in layout.footage} if layout is not None else ():
        for path in place.iterdir():
            if path.suffix.lower() in VIDEO_SUFFIXES and path.is_symlink() and not path.exists():
                raise FootageError(
                    f"'{path.relative_to(source).as_posix()}' is a link to a file that does not exist.",
                    "Copy the video itself, or remove the link.",
                )


def _one_of(source: Path, names: tuple[str, ...], trial: str | None) -> str:
    """The requested trial, or the only one. Raises FootageError naming all."""
    if trial in names:
        return str(trial)
    if trial is None and len(names) == 1:
        return names[0]
    listing = f"'{source.name}' holds {len(names)} trials: {listed(names)}"
    if trial is None:
        raise FootageError(f"{listing}.", f"Choose one with --trial {sorted(names, key=natural_key)[0]}.")
    raise FootageError(f"There is no trial '{trial}'; {listing}.", "Choose one of them with --trial NAME.")


def _calibration(source: Path, places: tuple[Path, ...], choice: Path | str | None) -> Path:
    """The requested calibration, or the only one in the first place that has any. Raises CalibrationError."""
    if choice is not None:
        for path in (Path(choice), *(place / choice for place in places)):
            if path.exists():
                return path
        listing = listed(path.name for place in places for path in find_calibrations(place))
        raise CalibrationError(
            f"There is no calibration '{choice}'.", f"Found in '{source.name}': {listing}."
        )
    for place in places:
        files = find_calibrations(place)
        if len(files) == 1:
            return files[0]
        if files:
            raise CalibrationError(
                f"'{place.name}' holds {len(files)} calibrations: {listed(path.name for path in files)}.",
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
        "Give its file with --calibration FILE, or put a TOML of Pose2Sim, aniposelib, FreeMoCap or Caliscope,"
        " EasyMocap's or OpenCV's YAML, a Qualisys .qca.txt or Bouguet .cal files into 'calibration/'. Where the folder"
        " above has it, import that one, with --trial NAME if it holds several trials.",
    )


def _backgrounds(folder: Path) -> tuple[Path, ...]:
    if not folder.is_dir():
        return ()
    files = [
        path
        for path in folder.iterdir()
        if not path.name.startswith(".") and (is_picture(path) or path.suffix.lower() in VIDEO_SUFFIXES)
    ]
    return tuple(sorted(files, key=lambda path: natural_key(path.name)))


def _file(path: Path) -> Path | None:
    return path if path.is_file() else None
