"""`studio background`."""

from collections.abc import Sequence
from pathlib import Path

import click
import msgspec
import numpy as np

from studio.capture.naming import match_names
from studio.capture.pictures import painted_picture, png_of
from studio.cli.arguments import frame_numbers
from studio.cli.knob_options import chosen_changes
from studio.cli.output import command, note, progress
from studio.errors import FootageError, NotFoundError
from studio.runs.background_setup import SOURCES, set_up_background
from studio.runs.mask_quality import MaskQuality, measure_masks
from studio.runs.session_settings import session_settings
from studio.sessions.background_files import polygon_exclusion, set_backgrounds, set_exclusion
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

UNUSED = "unused"


@click.command(name="background")
@click.argument("session")
@click.option(
    "--source",
    type=click.Choice(SOURCES),
    help="Background to use from now on; without it nothing is changed.",
)
@click.option(
    "--plates",
    multiple=True,
    metavar="CAMERA=FILE|FOLDER",
    help="Pictures or clips of the empty room: one a camera, or a folder whose names tell the cameras.",
)
@click.option(
    "--exclude",
    multiple=True,
    metavar="CAMERA=MASK.png|CAMERA=X,Y;X,Y;X,Y|unused",
    help="What does not count: painted, a polygon, none (CAMERA=), or all that no view's hull comes near.",
)
@click.option("--set", "changes", multiple=True, metavar="KNOB=VALUE", help="Knobs of the masks.")
@click.option(
    "--tune/--no-tune", default=True, help="Try knobs, keep those under which the views agree best."
)
@click.option(
    "--quality", is_flag=True, help="Measure how far the masks agree in the hull, camera by camera."
)
@click.option("--frames", default="", metavar="A,B,…", help="In which frames; default: five, evenly spread.")
@command
def background(
    session: str,
    source: str | None,
    plates: Sequence[str],
    exclude: Sequence[str],
    changes: Sequence[str],
    tune: bool,
    quality: bool,
    frames: str,
) -> dict[str, object]:
    """Choose where SESSION's masks come from, what does not count, and see how good they are.

    Agreement is the smaller of two shares: of a camera's mask that the visual hull of all views covers, and of the
    hull's silhouette that lies in the mask. From 0.9 on masks are called usable.
    """
    opened = Workspace().resolve(session)
    if plates:
        opened = set_backgrounds(opened, _files(opened, plates))
    for word in exclude:
        if word != UNUSED:
            _exclude(opened, word)
    knobs = chosen_changes(changes)
    found: MaskQuality | None = None
    if source is None and knobs:
        raise FootageError("Knobs are kept with a background.", "Give --source too, or try them on the page.")
    if source is not None:
        with progress(f"{opened.name}: background") as report:
            setup = set_up_background(
                opened,
                source,
                knobs=knobs,
                tune=tune,
                exclude_unused=UNUSED in exclude,
                progress=report,
            )
        for line in setup.notes:
            note(line)
        opened = Session(opened.path)
    comparable = len(opened.manifest.footage.cameras) > 1 and opened.is_calibrated
    if quality or (comparable if source is not None else not plates and not exclude):
        with progress(f"{opened.name}: masks") as report:
            found = measure_masks(opened, frame_numbers(frames), report)
    return _told(opened, found)


def _told(session: Session, found: MaskQuality | None) -> dict[str, object]:
    knobs = msgspec.to_builtins(session_settings(session).evidence)
    if found is None:
        return {"session": session.name, "settings": knobs, "text": f"Background of {session.name} is set."}
    views = [
        {
            "camera": view.camera,
            "agreement": view.agreement,
            "covered": view.covered,
            "inside": view.inside,
            "denied": view.denied,
            "usable": view.usable,
            "note": view.in_words(),
        }
        for view in found.views
    ]
    lines = [
        f"{view.camera:12} agreement {view.agreement:.2f}  (covered {view.covered:.2f}, inside {view.inside:.2f})"
        f"  {view.in_words()}".rstrip()
        for view in found.views
    ]
    lines += [f"The calibration is in doubt: {finding}" for finding in found.doubts]
    return {
        "session": session.name,
        "frames": list(found.frames),
        "cameras": views,
        "usable": found.usable,
        "doubts": [msgspec.to_builtins(finding) for finding in found.doubts],
        "hull_litres": list(found.hull_litres),
        "settings": knobs,
        "text": "\n".join(lines),
    }


def _files(session: Session, words: Sequence[str]) -> dict[str, Path]:
    """CAMERA=FILE words, or one folder, as files by camera."""
    cameras = [source.name for source in session.manifest.footage.cameras]
    if len(words) == 1 and Path(words[0]).is_dir():
        found = {path.stem: path for path in sorted(Path(words[0]).iterdir()) if path.is_file()}
        matched = match_names(list(found), cameras, "plates", NotFoundError)
        return {match.camera: found[match.footage] for match in matched}
    parted = [word.partition("=") for word in words]
    if any(not camera or not equals or not path for camera, equals, path in parted):
        raise NotFoundError("The plates cannot be understood.", "Write CAMERA=FILE, or one folder.")
    return {camera: Path(path) for camera, _, path in parted}


def _exclude(session: Session, word: str) -> None:
    camera, equals, value = word.partition("=")
    if not equals:
        raise NotFoundError(f"'--exclude {word}' cannot be understood.", "Write CAMERA=MASK.png, or unused.")
    if not value:
        set_exclusion(session, camera, b"")
    elif Path(value).is_file():
        set_exclusion(session, camera, png_of(painted_picture(Path(value).read_bytes())))
    else:
        try:
            corners = [tuple(float(number) for number in corner.split(",")) for corner in value.split(";")]
            polygon = np.asarray(corners, dtype=np.float64)
        except ValueError:
            polygon = np.empty((0, 2))
        if polygon.ndim != 2 or polygon.shape[1] != 2 or len(polygon) < 3:
            raise NotFoundError(
                f"'{value}' is neither a picture nor a polygon.",
                "Write a PNG's path, or X,Y;X,Y;X,Y in pixels.",
            )
        polygon_exclusion(session, camera, polygon)
