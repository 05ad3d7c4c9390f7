"""Footage into sessions: imported, added, rendered, recorded, put in step; sessions that begin empty."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, FiniteFloat

from studio.footage.capture.camera_addresses import CameraAddress, address_from_text, check_names
from studio.footage.capture.synchrony import MOST_SECONDS, Synchrony, in_words
from studio.footage.capture.timestamps import TimedOffsets
from studio.foundations.declaring import Body, Target, Terminal, Web, operation, taking
from studio.foundations.errors import FootageError, SessionError
from studio.foundations.progress import Progress, no_progress
from studio.foundations.records import extended
from studio.operations.jobs.camera_readers import CameraReaders
from studio.operations.jobs.stream_recording import RecordingStanding, StreamRecording, recording_folder
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.results.drawing_footage.recipes import synthesize as synthesize_recipe
from studio.results.overlay_pictures import forget_composers
from studio.sessions.archives import FOOTAGE_PARTS, only_archive, unpacked, unwrapped
from studio.sessions.footage_changes import (
    FootageChange,
    change_footage,
    pair_by_time,
    recorded_offsets,
    stale_runs,
    synchrony_of,
)
from studio.sessions.importers.importing import ImportOptions, ImportReport, Offsets, Rotations, import_source
from studio.sessions.importers.importing import add_footage as add_to_session
from studio.sessions.recordings import SpreadFigures, calibration_given, check_cameras, import_recording
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace, begin_session

LOOK_SECONDS = 0.2

Source = Annotated[
    str | Path, Field(description="A folder of footage, or an archive of one."), Terminal(kind=Path)
]
Into = Annotated[
    str | Path,
    Field(description="Name of the new session in the workspace, or a path."),
    Terminal("--into", "SESSION", kind=str),
]


@operation
def new_session(
    into: Annotated[
        str | Path,
        Field(description="Name or path."),
        Terminal(kind=str, metavar="SESSION"),
        Web(left_out=True),
    ],
    *,
    title: Annotated[
        str, Field(max_length=200, description="The title that people see; default: the name."), Web(kind=str)
    ] = "",
    body: Annotated[Body, Field(description="The body that is tracked; default: the studio's own.")] = "",
) -> Session:
    """Make an empty session, to which footage and a calibration are added.

    Raises SessionError for a name that is taken, BodyError for an unknown body.
    """
    return begin_session(Workspace().place_for(into), title, body)


@operation
@taking(ImportOptions, without=("replace",))
def import_footage(
    source: Source,
    into: Into,
    *,
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> Session:
    """Make a session from a folder (or an archive) of footage and calibration, checking one against the other.

    Folders of Pose2Sim, FreeMoCap, Caliscope, anipose, EasyMocap, OpenCap, DANNCE and PARSEC are recognised.

    Raises FootageError, CalibrationError or SessionError naming the file or camera that is wrong; then nothing was
    made.
    """
    with reporting(progress, "Importing") as report:
        place = Workspace().place_for(into)
        imported = import_source(Path(source), place, ImportOptions(**options), progress=report)
    _say(imported, progress)
    return imported.session


@operation
@taking(ImportOptions)
@keeping_in_place
def add_footage(
    session: SessionName,
    source: Source,
    *,
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> ImportReport:
    """Add the footage of a folder to a session that exists, before or after it is calibrated.

    Raises FootageError, CalibrationError or SessionError naming the file or camera that is wrong; then the session is
    unchanged.
    """
    with reporting(progress, "Adding") as report:
        added = add_to_session(open_session(session), Path(source), ImportOptions(**options), progress=report)
    forget_composers()
    _say(added, progress)
    return added


def _say(imported: ImportReport, progress: Reporting) -> None:
    say(progress, (*imported.notes, *(f"Warning: {warning}" for warning in imported.warnings)))


@operation
def synthesize(
    recipe: Annotated[
        str | Path,
        Field(description="A TOML file, or the name of a recipe that is shipped."),
        Terminal(kind=str),
    ],
    into: Into,
    *,
    frames: Annotated[int | None, Field(ge=1, description="Number of frames; default: the recipe's.")] = None,
    progress: Reporting = None,
) -> Session:
    """Render footage with exact truth from a recipe.

    Raises NotFoundError for an unknown recipe, SessionError for a name that is taken.
    """
    place = Workspace().place_for(into)
    with reporting(progress, "Rendering") as report:
        synthesize_recipe(recipe, place, progress=report, frames=frames)
    return Session(place)


@dataclass(frozen=True, slots=True)
class FootageCamera:
    """One camera's footage.

    offset : the file's frame that is frame 0 of the session.
    turned : degrees clockwise.
    width, height : pixels.
    """

    name: str
    kind: str
    offset: int
    turned: int
    width: int
    height: int
    frame_count: int
    has_masks: bool
    has_background: bool


@dataclass(frozen=True, slots=True)
class FootageState:
    """How a session's footage is put together.

    frame_count : frames that all cameras have.
    stale_runs : runs made before the footage was last changed.
    notes : what the last change means.
    """

    session: str
    layout: str
    fps: FiniteFloat
    frame_count: int
    cameras: tuple[FootageCamera, ...]
    stale_runs: tuple[str, ...]
    notes: tuple[str, ...]


def footage_state(session: Session, notes: tuple[str, ...] = ()) -> FootageState:
    """How a session's footage is put together. notes : on the change just made."""
    source = session.manifest.footage
    cameras = tuple(
        extended(FootageCamera, one, has_masks=bool(one.masks), has_background=bool(one.background))
        for one in source.cameras
    )
    layout = session.manifest.layout
    return FootageState(
        session.name, layout, source.fps, source.frame_count, cameras, stale_runs(session), notes
    )


def unpacked_upload(
    folder: Path, parts: Sequence[str] = FOOTAGE_PARTS, progress: Progress = no_progress
) -> Path:
    """The uploaded folder: out of its archive, and without folders that only wrap it.

    parts : patterns of what the folder in question holds.

    Raises SessionError for an archive that cannot be read.
    """
    if only_archive(folder):
        progress("unpacking", 0, 1)
    return unwrapped(unpacked(folder), parts)


@dataclass(frozen=True, slots=True, eq=False)
class Synchronised:
    """By how many frames the cameras of a session began apart.

    session : after the change, if there was one.
    synchrony : estimated from motion or read from recorded times; None for offsets given by hand.
    change : what was written; None for nothing.
    """

    session: Session
    synchrony: Synchrony | TimedOffsets | None = None
    change: FootageChange | None = None

    def in_words(self) -> list[str]:
        """The estimate or what was read, as lines."""
        if isinstance(self.synchrony, Synchrony):
            return [in_words(self.synchrony)]
        if self.synchrony is None:
            return []
        return [
            *(f"{name}: {offset:+d} frames" for name, offset in self.synchrony.offsets.items()),
            f"At most {self.synchrony.apart:.2f} frames apart at {self.synchrony.fps:.2f} frames a second.",
            *self.synchrony.notes,
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class SynchronyRequest:
    """Offsets and turns by hand, or how they are estimated or read."""

    offsets: Offsets = None
    rotations: Rotations = None
    timestamps: Annotated[
        str | Path | None,
        Field(description="A recorder's times of the frames (timestamps.csv), instead of an estimate."),
        Terminal(kind=Path),
    ] = None
    by_time: Annotated[
        bool,
        Field(description="Pair frames by their times, not by number: drift, lost frames. Written at once."),
    ] = False
    within: Annotated[float, Field(gt=0, le=600, description="Largest offset that is searched, seconds.")] = (
        MOST_SECONDS
    )
    apply: Annotated[bool, Field(description="Write what was estimated or read into the session.")] = False


@operation
@taking(SynchronyRequest)
@keeping_in_place
def synchronise(
    session: SessionName,
    *,
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> Synchronised:
    """Say by how many frames the cameras of a session began apart.

    Without offsets or turns it estimates them from motion in the pictures, and says how far to trust the estimate;
    nothing is changed unless the estimate is applied. Offsets and turns given by hand are written at once.

    Raises FootageError for offsets that do not fit the footage, and for an estimate that is to be applied but cannot be
    trusted.
    """
    opened, request = open_session(session), SynchronyRequest(**options)
    if request.offsets or request.rotations:
        if request.apply or request.timestamps is not None:
            raise FootageError(
                "Offsets cannot be given by hand and estimated or read at once.",
                "Leave out --apply and --timestamps.",
            )
        change = change_footage(opened, request.offsets, request.rotations)
        return Synchronised(change.session, None, change)
    if request.by_time:
        place = Path(request.timestamps) if request.timestamps is not None else None
        with reporting(progress, "Reading times") as report:
            change = pair_by_time(opened, place, report)
        return Synchronised(change.session, None, change)
    if request.timestamps is not None:
        synchrony = recorded_offsets(opened, Path(request.timestamps))
    else:
        with reporting(progress, "Estimating") as report:
            synchrony = synchrony_of(opened, report, request.within)
        if request.apply and not synchrony.sure:
            say(progress, synchrony.notes)
            raise FootageError(
                "The estimate is not reliable enough to be applied.",
                "Give the offsets by hand with --offset CAMERA=FRAMES.",
            )
    if not request.apply:
        return Synchronised(opened, synchrony)
    change = change_footage(opened, synchrony.offsets)
    return Synchronised(change.session, synchrony, change)


Cameras = Annotated[
    Mapping[str, str] | Sequence[str],
    Field(
        description="A camera by its name in the calibration: http://… (MJPEG), rtsp://…, /dev/video0, or a video to be"
        " replayed."
    ),
    Terminal("--camera", "NAME=ADDRESS", kind=Sequence[str], required=False),
]
Seconds = Annotated[float | None, Field(gt=0, le=86400)]


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recording.

    session : made of it.
    spread : of the pictures of one frame over time.
    notes, warnings : sentences.
    standing : how the recording ended; None for an interrupted one that was finished.
    """

    session: Session
    spread: SpreadFigures
    notes: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    standing: RecordingStanding | None = None


@operation
@keeping_in_place
def record(
    cameras: Cameras,
    into: Into,
    calibration: Annotated[
        SessionName,
        Field(description="The cameras' calibration, a file or folder; or a session that has it."),
        Target(""),
        Terminal("--calibration", "CALIBRATION|SESSION", kind=str),
    ],
    *,
    seconds: Annotated[
        Seconds, Field(description="Seconds to record; default: until the streams end, or Ctrl-C.")
    ] = None,
    fps: Annotated[
        float | None, Field(gt=0, le=10_000, description="Pictures a second; default: as measured.")
    ] = None,
    finish: Annotated[
        str | Path | None,
        Field(description="Make a session of an interrupted recording instead."),
        Terminal(kind=Path, metavar="FOLDER"),
    ] = None,
    progress: Reporting = None,
) -> Recorded:
    """Record live cameras at once into a session, each picture with its time of arrival.

    The recording lies in a folder beside the session until it is imported; a kill or a full disk loses less than a
    second of it, and `finish` makes a session of the rest. Ctrl-C (a notebook's stop button) ends the recording and
    keeps it.

    Raises FootageError for a camera that gives no picture, SessionError for a name that is taken.
    """
    place = Workspace().place_for(into)
    if place.exists():
        raise SessionError(f"There is something at '{place}' already.", "Choose another name.")
    known = calibration_given(
        calibration.path if isinstance(calibration, Session) else calibration, Workspace()
    )
    if finish is not None:
        return _make_session(Path(finish), place, known, None, progress)
    addresses = addresses_of(cameras)
    check_cameras(known, [address.name for address in addresses])
    folder = recording_folder(place)
    with CameraReaders(addresses) as readers:
        say(progress, ["Waiting for the cameras."])
        readers.await_pictures()
        say(
            progress,
            [f"{one.name}: {one.width}x{one.height}, {one.shown}" for one in readers.cameras.standings],
        )
        recording = StreamRecording(readers, folder, fps or readers.await_rate())
        try:
            with reporting(progress, f"{place.name}: recording") as report:
                _until(recording, seconds, report, progress)
        except KeyboardInterrupt:
            say(progress, ["Stopped."])
        finally:
            standing = recording.close()
    return _make_session(folder, place, known, standing, progress)


def addresses_of(cameras: Mapping[str, str] | Sequence[str]) -> list[CameraAddress]:
    """Addresses by camera, from a mapping or from NAME=ADDRESS. Raises FootageError."""
    if not cameras:
        raise FootageError(
            "No camera was given.",
            "Give each by its name in the calibration, with its address: NAME=ADDRESS.",
        )
    texts = (
        [f"{name}={place}" for name, place in cameras.items()] if isinstance(cameras, Mapping) else cameras
    )
    addresses = [address_from_text(text, replays=True) for text in texts]
    check_names(addresses)
    return addresses


def _until(recording: StreamRecording, seconds: float | None, report: Progress, progress: Reporting) -> None:
    """Record for so many seconds, or until the recording ends by itself."""
    began = time.monotonic()
    stopped: set[str] = set()
    while seconds is None or time.monotonic() - began < seconds:
        if recording.wait(LOOK_SECONDS):
            return
        standing = recording.standing
        ended = {
            one.name: f"{one.in_words}. {one.message}" for one in standing.cameras if one.state == "stopped"
        }
        say(progress, [words for name, words in ended.items() if name not in stopped])
        stopped = set(ended)
        total = round(seconds) if seconds else 0
        report(standing.in_words, min(total, round(standing.seconds)), total)


def _make_session(
    folder: Path, place: Path, calibration: Path, standing: RecordingStanding | None, progress: Reporting
) -> Recorded:
    with reporting(progress, f"{place.name}: importing") as report:
        imported, spread = import_recording(
            folder, place, calibration, standing.notes if standing else (), report
        )
    notes = (*imported.notes, *imported.warnings)
    say(progress, notes)
    return Recorded(imported.session, spread, notes, imported.warnings, standing)
