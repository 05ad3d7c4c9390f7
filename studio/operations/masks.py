"""Masks of a session: what they are made of, and how far the views agree."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from studio.footage.capture.pictures import painted_picture, png_of
from studio.foundations.declaring import Knobs, Terminal, Values, Web, operation
from studio.foundations.foreign_files import read_file
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.runs.setup.background_setup import BackgroundSetup, BackgroundSource, set_up_background
from studio.runs.setup.contrast import draw_contrast
from studio.runs.setup.mask_quality import MaskQuality, measure_masks
from studio.sessions.background_files import polygon_exclusion, set_backgrounds, set_exclusion
from studio.sessions.session import Session
from studio.sessions.stroke_files import strokes_of_file


@operation
@keeping_in_place
def background(
    session: SessionName,
    source: Annotated[
        BackgroundSource, Field(description="Background to use from now on."), Terminal("--source")
    ],
    *,
    plates: Annotated[
        Mapping[str, str | Path] | None,
        Field(description="By camera: a picture or clip of the empty room."),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = None,
    exclude: Annotated[
        Mapping[str, ArrayLike | str | Path | None] | None,
        Field(
            description="By camera, what does not count: a polygon (K, 2) of pixels, a painted picture's path, None for"
            " nothing any more."
        ),
        Terminal(left_out=True),
        Web(left_out=True),
    ] = None,
    strokes: Annotated[
        str | Path | None,
        Field(description="File of brush strokes (JSON), in place of the session's."),
        Web(left_out=True),
    ] = None,
    run: Annotated[
        str,
        Field(max_length=64, description="A tracked run: its model's projection helps to carry strokes."),
    ] = "",
    knobs: Annotated[
        Values,
        Field(max_length=64, description="Knobs of the masks, by name."),
        Knobs(others=True),
        Web("knobs"),
    ] = None,
    tune: Annotated[
        bool, Field(description="Try knobs, keep those under which the views agree best.")
    ] = True,
    exclude_unused: Annotated[
        bool, Field(description="What no view's hull comes near does not count."), Terminal(left_out=True)
    ] = False,
    subject_at: Annotated[
        tuple[float, float] | None,
        Field(
            description="Of several in view, follow the one who stands here in the first frame: x and y on the floor in"
            " metres. The others are cut out of the masks."
        ),
        Terminal(metavar="X,Y"),
    ] = None,
    progress: Reporting = None,
) -> BackgroundSetup:
    """Choose where a session's masks come from, what does not count, and (on the command line) see how good they are.

    Sources: a background ("plate", "clip", "median", "combined"), "person" (a network cuts a person out: no picture of
    the empty room, about a twentieth of a second a picture), "strokes" (anything, from a few brush strokes in one
    picture of each camera or in more), "threshold" (by brightness and colour: knobs `mask_darkest`, `mask_brightest`,
    `mask_hue`, `mask_hue_reach`, `mask_saturation`), "masks" (those that came with the footage), "best" (all of these
    are tried, and each camera gets the one under which views agree and borders lie on edges of the picture), "subject"
    (the masks in use, cut down to the one of several who stands at `subject_at`; with any other source that place cuts
    the masks made of it).

    Agreement is the smaller of two shares: of a camera's mask that the visual hull of all views covers, and of the
    hull's silhouette that lies in the mask. From 0.9 on masks are called usable, unless subject and background are
    alike in colour: then all masks may lack the same part. Where that is so, "best" is tried as well, unless `tune` is
    off.

    Raises FootageError for a source that is not there, SettingsError for a knob; then nothing is changed.
    """
    opened = open_session(session)
    if plates:
        opened = set_backgrounds(opened, {camera: Path(path) for camera, path in plates.items()})
    for camera, region in (exclude or {}).items():
        exclude_region(opened, camera, region)
    with reporting(progress, f"{opened.name}: background") as report:
        made = set_up_background(
            opened,
            source,
            knobs=knobs,  # pyright: ignore[reportArgumentType]
            tune=tune,
            exclude_unused=exclude_unused,
            strokes=None if strokes is None else strokes_of_file(opened, Path(strokes)),
            run=run,
            subject_at=subject_at,
            progress=report,
        )
    say(progress, made.notes)
    return made


@operation
@keeping_in_place
def mask_quality(
    session: SessionName,
    frames: Annotated[
        Sequence[int], Field(max_length=24, description="To look at; default: five, evenly spread.")
    ] = (),
    *,
    pictures: Annotated[
        str | Path | None,
        Field(description="Folder for a picture a camera, in which is outlined what is like the background."),
        Terminal(metavar="FOLDER"),
        Web(left_out=True),
    ] = None,
    progress: Reporting = None,
) -> MaskQuality:
    """How far the masks agree in the hull, camera by camera, whether subject and background can be told apart, and what
    the silhouettes say against the calibration.

    Without frames it is remembered; then a fault that makes results wrong keeps tracking from beginning.
    """
    opened = open_session(session)
    with reporting(progress, f"{opened.name}: masks") as report:
        found = measure_masks(opened, frames, report)
    if pictures is not None and found.contrast is not None:
        say(progress, [f"Picture {path}" for path in draw_contrast(opened, found.contrast, Path(pictures))])
    return found


def exclude_region(session: Session, camera: str, region: ArrayLike | str | Path | None) -> None:
    """Let a region of a camera's pictures not count, as `background` takes it."""
    if region is None:
        set_exclusion(session, camera, b"")
    elif isinstance(region, str | Path):
        set_exclusion(session, camera, png_of(painted_picture(read_file(Path(region)))))
    else:
        polygon_exclusion(session, camera, np.asarray(region, dtype=np.float64))
