"""`studio background`."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import click
import msgspec

from studio.cli.deriving import Call, command_of
from studio.cli.reading import frame_numbers
from studio.footage.capture.naming import match_names
from studio.foundations.errors import FootageError, NotFoundError
from studio.foundations.words import sentence
from studio.operations.masks import background, exclude_region, mask_quality
from studio.runs.setup.background_setup import SOURCES
from studio.runs.setup.mask_quality import MaskQuality
from studio.runs.setup.session_settings import session_settings
from studio.sessions.background_files import read_evidence, set_backgrounds
from studio.sessions.session import Session

UNUSED = "unused"
OWN = (
    click.option(
        "--source",
        type=click.Choice(SOURCES),
        help="Background to use from now on; without it nothing is changed.",
    ),
    click.option(
        "--plates",
        multiple=True,
        metavar="CAMERA=FILE|FOLDER",
        help="Pictures or clips of the empty room: one a camera, or a folder named after the cameras.",
    ),
    click.option(
        "--exclude",
        multiple=True,
        metavar="CAMERA=MASK.png|CAMERA=X,Y;X,Y;X,Y|unused",
        help="What does not count: painted, a polygon, none (CAMERA=), or all that no view's hull comes near.",
    ),
    click.option(
        "--quality", is_flag=True, help="Measure how far the masks agree in the hull, camera by camera."
    ),
    click.option(
        "--frames", default="", metavar="A,B,…", help="In which frames; default: five, evenly spread."
    ),
    click.option(
        "--pictures",
        type=click.Path(path_type=Path),
        metavar="FOLDER",
        help="With --quality: a picture a camera there, in which is outlined what is like the background.",
    ),
)


@command_of(background, *OWN, without=("source", "plates", "exclude", "exclude_unused"))
def background_command(
    call: Call,
    source: str | None,
    plates: Sequence[str],
    exclude: Sequence[str],
    quality: bool,
    frames: str,
    pictures: Path | None,
) -> dict[str, object]:
    session: Session = call.given["session"]
    if plates:
        session = set_backgrounds(session, _files(session, plates))
    for word in exclude:
        if word != UNUSED:
            exclude_region(session, *_region(word))
    if source is None and (call.given.get("strokes") or call.given.get("run")):
        raise FootageError("Strokes are a source of masks.", "Give --source strokes too.")
    if source is None and call.given.get("subject_at"):
        source = "subject"
    if source is None and call.given.get("knobs"):
        raise FootageError("Knobs are kept with a background.", "Give --source too, or try them on the page.")
    if source is not None:
        call(session=session, source=source, exclude_unused=UNUSED in exclude)
        session = Session(session.path)
    comparable = len(session.manifest.footage.cameras) > 1 and session.is_calibrated
    if quality or pictures or (comparable if source is not None else not plates and not exclude):
        return _answer(session, call.do(mask_quality, frames=frame_numbers(frames), pictures=pictures))
    return _answer(session, None)


def _answer(session: Session, found: MaskQuality | None) -> dict[str, object]:
    knobs = msgspec.to_builtins(session_settings(session).evidence)
    if found is None:
        return {"session": session.name, "settings": knobs, "text": f"Background of {session.name} is set."}
    lines = [
        f"{view.camera:12} agreement {view.agreement:.2f}  (covered {view.covered:.2f}, inside {view.inside:.2f})"
        f"  {view.in_words()}".rstrip()
        for view in found.views
    ]
    if not all(view.usable for view in found.views) and not _has_own_masks(session):
        lines.append(
            f"Masks that agree so little are of no use. 'studio background {session.name} --source best' tries every"
            " source and takes the one under which the views agree."
        )
    contrast = found.contrast
    if contrast is not None and contrast.low:
        lines.append(f"{sentence(contrast.in_words())}. {contrast.remedy()}")
        lines.append(f"'studio background {session.name} --quality --pictures FOLDER' draws where.")
    elif found.agreeing and not found.usable:
        lines.append(f"The views agree, but {found.why_not_confirmed()}: look at the masks yourself.")
    if found.subjects > 1:
        lines.append(
            f"{found.subjects} subjects are in view: say which one with --subject-at X,Y"
            f" ('studio subjects {session.name}' says where they stand)."
        )
    lines += [f"The calibration is in doubt: {finding}" for finding in found.doubts]
    names = ("camera", "agreement", "covered", "inside", "denied", "usable")
    return {
        "session": session.name,
        "frames": list(found.frames),
        "cameras": [
            {name: getattr(view, name) for name in names} | {"note": view.in_words()} for view in found.views
        ],
        "usable": found.usable,
        "contrast": None
        if contrast is None
        else {
            "low": contrast.low,
            "words": contrast.in_words(),
            "remedy": contrast.remedy(),
            "pose": contrast.pose,
        }
        | {"cameras": [msgspec.to_builtins(view) for view in contrast.views]},
        "subjects": found.subjects,
        "doubts": [msgspec.to_builtins(finding) for finding in found.doubts],
        "hull_litres": list(found.hull_litres),
        "settings": knobs,
        "text": "\n".join(lines),
    }


def _has_own_masks(session: Session) -> bool:
    """Whether masks were made or given, which trying other sources would replace."""
    model = read_evidence(session).knobs.get("background_model", "auto")
    given = any(source.masks for source in session.manifest.footage.cameras)
    return model == "mask" or (model == "auto" and given)


def _files(session: Session, words: Sequence[str]) -> Mapping[str, Path]:
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


def _region(word: str) -> tuple[str, Path | list[tuple[float, ...]] | None]:
    """A camera, and what does not count of it: a painted picture, a polygon, or nothing any more."""
    camera, equals, value = word.partition("=")
    if not equals:
        raise NotFoundError(f"'--exclude {word}' cannot be understood.", "Write CAMERA=MASK.png, or unused.")
    if not value or Path(value).is_file():
        return camera, Path(value) if value else None
    try:
        corners = [tuple(float(number) for number in corner.split(",")) for corner in value.split(";")]
    except ValueError:
        corners = []
    if len(corners) < 3 or any(len(corner) != 2 for corner in corners):
        raise NotFoundError(
            f"'{value}' is neither a picture nor a polygon.", "Write a PNG's path, or X,Y;X,Y;X,Y in pixels."
        )
    return camera, corners
