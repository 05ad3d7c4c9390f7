"""From footage to a start pose: what has to be there before anything is tracked."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from studio.body.model import BodyModel
from studio.body.subject import Subject
from studio.capture.pictures import painted_picture, png_of
from studio.footage_recipes import synthesize as synthesize_recipe
from studio.notebook.opening import SessionName, open_session
from studio.notebook.progress import Told, told
from studio.runs.background_setup import BackgroundSetup, set_up_background
from studio.runs.initialising import WEIGHTING, InitialPose, keep_pose
from studio.runs.initialising import initialise as initialise_session
from studio.runs.mask_quality import MaskQuality, measure_masks
from studio.runs.subject_choice import body_of_choice, choose_subject, keep_fitted
from studio.runs.subject_fitting import COUNT, FitRequest, FittedSubject, fit_session_subject
from studio.sessions.background_files import polygon_exclusion, set_backgrounds, set_exclusion
from studio.sessions.importers.importing import import_source
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

USUAL = FitRequest()


def import_footage(
    source: str | Path,
    into: str | Path,
    *,
    calibration: str | Path | None = None,
    fps: float | None = None,
    copy: bool = True,
    trial: str | None = None,
    offsets: Mapping[str, int] | None = None,
    rotations: Mapping[str, int] | None = None,
    despite_findings: bool = False,
    progress: Told = None,
) -> Session:
    """Make a session from a folder of footage and calibration. into : a name in the workspace, or a path.

    offsets : by camera, the frame that was taken with frame 0 of the others. rotations : by camera, degrees clockwise.
    despite_findings : take a calibration that a check says is wrong. Raises StudioError.
    """
    place = Workspace().place_for(into)
    with told(progress, "Importing") as report:
        import_source(
            Path(source),
            place,
            calibration=Path(calibration) if calibration else None,
            fps=fps,
            copy=copy,
            trial=trial,
            offsets=offsets,
            rotations=rotations,
            despite_findings=despite_findings,
            progress=report,
        )
    return Session(place)


def synthesize(
    recipe: str | Path, into: str | Path, *, frames: int | None = None, progress: Told = None
) -> Session:
    """Render footage with exact truth from a recipe: a TOML file, or the name of one that is shipped."""
    place = Workspace().place_for(into)
    with told(progress, "Rendering") as report:
        synthesize_recipe(recipe, place, progress=report, frames=frames)
    return Session(place)


def background(
    session: SessionName,
    source: str,
    *,
    plates: Mapping[str, str | Path] | None = None,
    exclude: Mapping[str, ArrayLike | str | Path | None] | None = None,
    knobs: Mapping[str, bool | int | float | str] | None = None,
    tune: bool = True,
    exclude_unused: bool = False,
    progress: Told = None,
) -> BackgroundSetup:
    """Choose where a session's masks come from: "plate", "clip", "median" or "combined".

    plates : by camera, a picture or clip of the empty room. exclude : by camera, what does not count: a polygon (K, 2)
    of pixels, a painted picture's path, None for nothing any more. tune : try knobs, keep those under which the views
    agree best. Returns what was set, with the masks' quality where it was measured.
    """
    opened = open_session(session)
    if plates:
        opened = set_backgrounds(opened, {camera: Path(path) for camera, path in plates.items()})
    for camera, region in (exclude or {}).items():
        _exclude(opened, camera, region)
    with told(progress, f"{opened.name}: background") as report:
        return set_up_background(
            opened, source, knobs=knobs, tune=tune, exclude_unused=exclude_unused, progress=report
        )


def mask_quality(session: SessionName, frames: Sequence[int] = (), *, progress: Told = None) -> MaskQuality:
    """How far the masks agree in the hull, camera by camera, and what the silhouettes say against the calibration.

    frames : default five, evenly spread; then it is remembered, and a fault that makes results wrong keeps `track` from
    beginning.
    """
    opened = open_session(session)
    with told(progress, f"{opened.name}: masks") as report:
        return measure_masks(opened, frames, report)


def subject(
    session: SessionName,
    height_mm: float | None = None,
    *,
    lengths_mm: Mapping[str, float] | None = None,
    body: str = "",
) -> BodyModel:
    """Write down who is in front of the cameras, and return the body in that size; with nothing given, as it is.

    lengths_mm : measured, such as {"RHip_RKnee": 420.0}. Raises BodyError.
    """
    return subject_with_notes(session, height_mm, lengths_mm=lengths_mm, body=body)[0]


def subject_with_notes(
    session: SessionName,
    height_mm: float | None = None,
    *,
    lengths_mm: Mapping[str, float] | None = None,
    body: str = "",
) -> tuple[BodyModel, tuple[str, ...]]:
    """`subject`, with notes on measures that the body cannot follow."""
    opened = open_session(session)
    if height_mm is None and not lengths_mm:
        return opened.body_with_notes(body or None)
    wanted = Subject(
        body=body or opened.manifest.body, height_mm=height_mm, lengths_mm=dict(lengths_mm or {})
    )
    choose_subject(opened, wanted)
    return body_of_choice(opened, wanted)


def fit_subject(
    session: SessionName,
    *,
    frames: Sequence[int] = (),
    count: int = COUNT,
    symmetric: bool = True,
    lengths: bool = True,
    radii: bool = True,
    height_mm: float | None = None,
    height_spread: float = USUAL.height_spread,
    run: str = "",
    body: str = "",
    seed: int = 0,
    keep: bool = True,
    progress: Told = None,
) -> FittedSubject:
    """Find lengths and radii of the person on the silhouettes of a few frames, together with the poses.

    height_spread : mm, how far off the height may be: 15 for a measured one, 60 for a guess. keep : make it the
    session's subject; the old one stays beside it.
    """
    opened = open_session(session)
    request = FitRequest(
        frames=tuple(int(frame) for frame in frames),
        count=count,
        symmetric=symmetric,
        lengths=lengths,
        radii=radii,
        run=run,
        body=body,
        height_mm=height_mm,
        height_spread=height_spread,
        seed=seed,
    )
    with told(progress, f"{opened.name}: subject") as report:
        found = fit_session_subject(opened, request, progress=report)
    if keep:
        keep_fitted(opened, found)
    return found


def initialise(
    session: SessionName,
    frame: int = 0,
    *,
    body: str = "",
    behaviour: str = "",
    weighting: str = WEIGHTING,
    seed: int = 0,
    keep: bool = True,
    replace: bool = False,
    progress: Told = None,
) -> InitialPose:
    """Find the pose in a frame with nothing given but the body's dimensions.

    keep : write it down; it becomes the session's start pose if that has none, or by `replace`.
    """
    opened = open_session(session)
    with told(progress, f"{opened.name}: frame {frame}") as report:
        found = initialise_session(
            opened,
            frame,
            body=opened.body(body or None),
            behaviour=behaviour,
            weighting=weighting,
            seed=seed,
            progress=report,
        )
    if keep:
        keep_pose(opened, found, replace)
    return found


def _exclude(session: Session, camera: str, region: ArrayLike | str | Path | None) -> None:
    if region is None:
        set_exclusion(session, camera, b"")
    elif isinstance(region, str | Path):
        set_exclusion(session, camera, png_of(painted_picture(Path(region).read_bytes())))
    else:
        polygon_exclusion(session, camera, np.asarray(region, dtype=np.float64))
