"""Masks of a session: their source, and how far the views agree."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from studio.evidence.settings import EvidenceSettings
from studio.footage.capture.footage import Region
from studio.footage.capture.naming import match_names
from studio.footage.capture.pictures import is_picture, painted_picture, png_of
from studio.foundations.declaring import Knobs, Terminal, Values, Web, operation, taking
from studio.foundations.errors import FootageError, NotFoundError
from studio.foundations.foreign_files import read_file
from studio.foundations.knobs import Knob, Value, knobs_of
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.results.overlay_pictures import forget_composers
from studio.runs.setup.background_setup import (
    MASK_SOURCES,
    SOURCES,
    BackgroundSetup,
    BackgroundSource,
    set_up_background,
)
from studio.runs.setup.contrast import draw_contrast
from studio.runs.setup.mask_quality import MaskQuality, measure_masks
from studio.runs.setup.mask_quality import mask_quality as quality_with
from studio.runs.setup.session_settings import session_settings
from studio.runs.setup.stroke_masks import unpainted_cameras
from studio.search.settings import values
from studio.sessions.background_files import (
    add_polygon,
    change_evidence,
    given_masks_of,
    home_of_masks,
    read_evidence,
    set_backgrounds,
    set_region,
)
from studio.sessions.provenance import origin_of
from studio.sessions.session import Session
from studio.sessions.stroke_files import read_strokes, strokes_of_file

Regions = Mapping[str, ArrayLike | str | Path | None] | None
"""By camera: a polygon (K, 2) of pixels, the path of a painted picture, or None for no region any more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskRequest:
    """How a session's masks are set up, besides their source."""

    plates: Annotated[
        Mapping[str, str | Path] | None,
        Field(description="By camera: a picture or clip of the empty place."),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = None
    exclude: Annotated[
        Regions,
        Field(
            description="By camera, the region that does not count: a polygon (K, 2) of pixels or the path of a"
            " painted picture; None removes it."
        ),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = None
    in_front: Annotated[
        Regions,
        Field(
            description="By camera, where a thing stands in front of the subject's place (a table, a pole), so that"
            " it cannot be told what is there: a polygon or a painted picture, as for `exclude`."
        ),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = None
    strokes: Annotated[
        str | Path | None,
        Field(description="File of brush strokes (JSON), in place of the session's."),
        Web(left_out=True),
    ] = None
    run: Annotated[
        str, Field(max_length=64, description="A tracked run whose projected model helps to carry strokes.")
    ] = ""
    knobs: Annotated[
        Values,
        Field(max_length=64, description="Knobs of the masks, by name."),
        Knobs(others=True),
        Web("knobs"),
    ] = None
    tune: Annotated[bool, Field(description="Try knobs and keep those with which the views agree best.")] = (
        True
    )
    exclude_unused: Annotated[
        bool,
        Field(description="Regions that no view's hull comes near do not count."),
        Terminal(left_out=True),
    ] = False
    find_in_front: Annotated[
        bool,
        Field(
            description="Look for things that stand in front of the subject's place, by the masks of three cameras or"
            " more; what was painted stays."
        ),
    ] = True
    subject_at: Annotated[
        tuple[float, float] | None,
        Field(
            description="With several subjects in view: where the wanted one stands in the first frame, x and y"
            " on the floor in metres. The others are cut out of the masks."
        ),
        Terminal(metavar="X,Y"),
    ] = None


@operation
@taking(MaskRequest)
@keeping_in_place
def background(
    session: SessionName,
    source: Annotated[
        BackgroundSource, Field(description="Background to use from now on."), Terminal("--source")
    ],
    *,
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> BackgroundSetup:
    """Choose where a session's masks come from, what does not count, and (on the command line) see how good they are.

    Sources: a background ("plate", "clip", "median", "combined"); "animal" (an animal before a picture of the empty
    place: no shadows and reflections, a tail and legs a few pixels wide); "person" (a network cuts out a person;
    needs no picture of the empty room, takes about a twentieth of a second a picture); "strokes" (anything, from a few
    brush strokes in one or more pictures of each camera); "threshold" (by brightness and colour: knobs `mask_darkest`,
    `mask_brightest`, `mask_hue`, `mask_hue_reach`, `mask_saturation`); "masks" (that came with the footage); "best"
    (all of these are tried, and each camera gets the one under which views agree and borders lie on edges of the
    picture); "subject" (the masks in use, cut down to one of several subjects, who stands at `subject_at`; with any
    other source that place cuts the masks made of it).

    Agreement is the smaller of two shares: of a camera's mask that the visual hull of all views covers, and of the
    hull's silhouette that lies in the mask. From 0.9 on masks are called usable, unless subject and background are
    alike in colour: then all masks may lack the same part. In that case "best" is tried as well, unless `tune` is off.

    Raises FootageError for a source that the session lacks, SettingsError for an unknown knob; then nothing is changed.
    """
    opened, request = open_session(session), MaskRequest(**options)
    if request.plates:
        opened = give_plates(opened, {camera: Path(path) for camera, path in request.plates.items()})
    for camera, region in (request.exclude or {}).items():
        paint_region(opened, "exclusions", camera, region)
    for camera, region in (request.in_front or {}).items():
        paint_region(opened, "in_front", camera, region)
    strokes = None if request.strokes is None else strokes_of_file(opened, Path(request.strokes))
    with reporting(progress, f"{opened.name}: background") as report:
        try:
            made = set_up_background(
                opened,
                source,
                knobs=request.knobs,  # pyright: ignore[reportArgumentType]
                tune=request.tune,
                exclude_unused=request.exclude_unused,
                strokes=strokes,
                run=request.run,
                subject_at=request.subject_at,
                find_in_front=request.find_in_front,
                progress=report,
            )
        finally:
            forget_composers()
    say(progress, made.notes)
    return made


@operation
@keeping_in_place
def mask_quality(
    session: SessionName,
    frames: Annotated[
        Sequence[int], Field(max_length=24, description="Frames to look at; default: five, evenly spread.")
    ] = (),
    *,
    knobs: Annotated[
        Values,
        Field(max_length=64, description="Knobs to try in place of the session's."),
        Knobs(others=True),
    ] = None,
    keep: Annotated[bool, Field(description="Remember the result for the session's own knobs.")] = True,
    pictures: Annotated[
        str | Path | None,
        Field(
            description="Folder for one picture a camera, in which regions that are like the background are"
            " outlined."
        ),
        Terminal(metavar="FOLDER"),
        Web(left_out=True),
    ] = None,
    progress: Reporting = None,
) -> MaskQuality:
    """Measure how far the masks agree in the hull, camera by camera, whether subject and background can be told apart,
    and what the silhouettes say against the calibration.

    Without frames the result is remembered; a fault that would make results wrong then keeps tracking from beginning.

    Raises RunError for a single camera, SettingsError for an unknown knob.
    """
    opened = open_session(session)
    with reporting(progress, f"{opened.name}: masks") as report:
        if keep and knobs is None:
            measured = measure_masks(opened, frames, report)
        else:
            measured = quality_with(opened, mask_settings(opened, knobs), frames, progress=report)
    if pictures is not None and measured.contrast is not None:
        say(
            progress, [f"Picture {path}" for path in draw_contrast(opened, measured.contrast, Path(pictures))]
        )
    return measured


def mask_settings(session: Session, knobs: Mapping[str, object] | None = None) -> EvidenceSettings:
    """The settings that a session's masks are made with, these knobs changed. Raises SettingsError."""
    return session_settings(session, changes=knobs).evidence


@dataclass(frozen=True, slots=True)
class MaskKnobs:
    """Knobs of the masks that the session's new runs begin with, by flat name."""

    knobs: dict[str, Value]


def mask_knobs(session: Session) -> MaskKnobs:
    return MaskKnobs(read_evidence(session).knobs)


def keep_mask_knobs(session: Session, knobs: Mapping[str, Value]) -> MaskKnobs:
    """Let new runs of a session begin with exactly these knobs; existing runs keep theirs. Raises SettingsError."""
    mask_settings(session, knobs)
    change_evidence(session, knobs=dict(knobs))
    return mask_knobs(session)


@dataclass(frozen=True, slots=True)
class PaintedRegion:
    """A region of a camera. pixels : how many."""

    camera: str
    pixels: int


def paint_region(
    session: Session, kind: Region, camera: str, region: ArrayLike | str | Path | bytes | None
) -> PaintedRegion:
    """Let a region of a camera's pictures not count, or say that a thing stands in front of the subject's place there.

    region : as `background` takes it, or the bytes of a painted picture; none removes it.

    Raises NotFoundError, FootageError.
    """
    if region is None or isinstance(region, bytes):
        pixels = set_region(session, kind, camera, region or b"")
    elif isinstance(region, str | Path):
        pixels = set_region(session, kind, camera, png_of(painted_picture(read_file(Path(region)))))
    else:
        pixels = add_polygon(session, kind, camera, np.asarray(region, dtype=np.float64))
    forget_composers()
    return PaintedRegion(camera, pixels)


def region_picture(session: Session, kind: Region, camera: str) -> bytes:
    """PNG, as stored: white in a region of a camera. Raises NotFoundError where nothing is painted."""
    path = _region_of(session, kind, session.camera_source(camera).name)
    if not path.exists():
        raise NotFoundError(f"Nothing is painted on camera '{camera[:64]}'.", "Paint something.")
    return read_file(path)


def _region_of(session: Session, kind: Region, camera: str) -> Path:
    return session.path / kind / f"{camera}.png"


def give_plates(session: Session, plates: Mapping[str, Path], files: Iterable[Path] = ()) -> Session:
    """The session with pictures or clips of the empty place in use; they are copied.

    plates : by camera.
    files : matched to the other cameras by their names.

    Raises NotFoundError, FootageError.
    """
    rest = {path.stem: path for path in files}
    if rest:
        cameras = [one.name for one in session.manifest.footage.cameras if one.name not in plates]
        matches = match_names(list(rest), cameras, "backgrounds", FootageError)
        plates = {**plates, **{match.camera: rest[match.footage] for match in matches}}
    try:
        return set_backgrounds(session, plates)
    finally:
        forget_composers()


@dataclass(frozen=True, slots=True)
class BackgroundCamera:
    """One camera.

    given : which kind of picture of its empty place there is.
    file : its name.
    masks : whether it has some.
    excluded : whether regions of it do not count.
    in_front : whether things in front of the subject's place are known.
    found : whether these were found in the masks, not painted.
    width, height : pixels.
    """

    name: str
    given: Literal["", "plate", "clip"]
    file: str
    masks: bool
    excluded: bool
    in_front: bool
    found: bool
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class SourceLine:
    """A source of masks.

    lacking : what has to be done first, "" where the source can be used now.
    has_knobs : whether knobs of the masks change the result.
    """

    name: BackgroundSource
    label: str
    help: str
    lacking: str
    has_knobs: bool


@dataclass(frozen=True, slots=True)
class Background:
    """A session's background.

    source : in use; "masks" where masks came with the footage.
    possible, sources : those that can be used now, and all.
    knobs : of masks.
    settings : their values in use.
    own : those that the session sets.
    measured : how far the views agreed at the last measurement, in words.
    """

    session: str
    source: BackgroundSource
    possible: tuple[BackgroundSource, ...]
    sources: tuple[SourceLine, ...]
    frame_count: int
    cameras: tuple[BackgroundCamera, ...]
    knobs: tuple[Knob, ...]
    settings: dict[str, Value]
    own: dict[str, Value]
    measured: str


def background_of(session: Session) -> Background:
    """A session's source of masks and its knobs."""
    evidence, settings = read_evidence(session), session_settings(session)
    knobs, known = knobs_of(settings.evidence), origin_of(session, "background")
    now = values(settings)
    cameras = tuple(
        BackgroundCamera(
            source.name,
            "" if not given else "plate" if is_picture(Path(given)) else "clip",
            given.rpartition("/")[2],
            bool(source.masks),
            _region_of(session, "exclusions", source.name).exists(),
            _region_of(session, "in_front", source.name).exists(),
            source.name in evidence.found_in_front,
            source.width,
            source.height,
        )
        for source in session.manifest.footage.cameras
        for given in [evidence.given.get(source.name, source.background)]
    )
    possible = _possible_sources(session, cameras)
    return Background(
        session.name,
        _source_in_use(session, settings.evidence.background_model, bool(evidence.given), cameras),
        possible,
        tuple(
            SourceLine(name, one.label, one.help, "" if name in possible else one.lacking, one.has_knobs)
            for name, one in MASK_SOURCES.items()
        ),
        session.manifest.frame_count,
        cameras,
        knobs,
        {entry.name: now[entry.name] for entry in knobs},
        evidence.knobs,
        known.words if known is not None else "",
    )


def _possible_sources(session: Session, cameras: Sequence[BackgroundCamera]) -> tuple[BackgroundSource, ...]:
    needs = {
        "plate": all(one.given == "plate" for one in cameras),
        "clip": all(one.given == "clip" for one in cameras),
        "person": session.is_calibrated,
        "strokes": not unpainted_cameras(session, read_strokes(session)),
        "masks": all(given_masks_of(session).values()),
        "best": session.is_comparable,
        "subject": session.is_comparable,
        "animal": session.is_comparable and all(one.given for one in cameras),
    }
    return tuple(name for name in SOURCES if cameras and needs.get(name, True))


def _source_in_use(
    session: Session, model: str, cleaned: bool, cameras: Sequence[BackgroundCamera]
) -> BackgroundSource:
    if model == "mask" or (model == "auto" and cameras and all(one.masks for one in cameras)):
        homes = {home_of_masks(source) for source in session.manifest.footage.cameras}
        made: list[BackgroundSource] = [
            name for name, one in MASK_SOURCES.items() if one.home and homes == {one.home}
        ]
        return made[0] if made else "masks"
    if model == MASK_SOURCES["threshold"].model:
        return "threshold"
    if cleaned or model == MASK_SOURCES["combined"].model:
        return "combined"
    if model == MASK_SOURCES["median"].model or not cameras or not all(one.given for one in cameras):
        return "median"
    return "clip" if cameras[0].given == "clip" else "plate"
