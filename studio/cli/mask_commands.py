"""`studio background`."""

from collections.abc import Sequence
from pathlib import Path

import click
import msgspec

from studio.cli.deriving import Call, command_of
from studio.cli.reading import frame_numbers
from studio.foundations.errors import FootageError, NotFoundError
from studio.foundations.words import sentence
from studio.operations.masks import (
    background,
    give_plates,
    mask_knobs,
    mask_quality,
    mask_settings,
    paint_region,
)
from studio.runs.setup.background_setup import SOURCES
from studio.runs.setup.mask_quality import MaskQuality
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
        help="Pictures or clips of the empty place: one a camera, or a folder named after the cameras.",
    ),
    click.option(
        "--exclude",
        multiple=True,
        metavar="CAMERA=MASK.png|CAMERA=X,Y;X,Y;X,Y|unused",
        help="What does not count: painted, a polygon, none (CAMERA=), or all that no view's hull comes near.",
    ),
    click.option(
        "--in-front",
        multiple=True,
        metavar="CAMERA=MASK.png|CAMERA=X,Y;X,Y;X,Y",
        help="Where a thing stands in front of the subject's place, so that it cannot be told what is there: painted, a"
        " polygon, none (CAMERA=).",
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
        help="With --quality: folder for one picture a camera, in which regions that are like the background are"
        " outlined.",
    ),
)


@command_of(background, *OWN, without=("source", "plates", "exclude", "exclude_unused", "in_front"))
def background_command(
    call: Call,
    source: str | None,
    plates: Sequence[str],
    quality: bool,
    frames: str,
    pictures: Path | None,
    **regions: Sequence[str],
) -> dict[str, object]:
    session: Session = call.given["session"]
    if plates:
        session = _with_plates(session, plates)
    exclude, in_front = regions["exclude"], regions["in_front"]
    for word in exclude:
        if word != UNUSED:
            paint_region(session, "exclusions", *_region("--exclude", word))
    for word in in_front:
        paint_region(session, "in_front", *_region("--in-front", word))
    if source is None and (call.given.get("strokes") or call.given.get("run")):
        raise FootageError("Strokes are a source of masks.", "Give --source strokes too.")
    if source is None and call.given.get("subject_at"):
        source = "subject"
    if source is None and call.given.get("knobs"):
        raise FootageError("Knobs are kept with a background.", "Give --source too, or try them on the page.")
    if source is not None:
        call(session=session, source=source, exclude_unused=UNUSED in exclude)
        session = Session(session.path)
    changed = plates or exclude or in_front
    if quality or pictures or (session.is_comparable if source is not None else not changed):
        return _answer(session, call.do(mask_quality, frames=frame_numbers(frames), pictures=pictures))
    return _answer(session, None)


def _answer(session: Session, measured: MaskQuality | None) -> dict[str, object]:
    knobs = msgspec.to_builtins(mask_settings(session))
    if measured is None:
        return {"session": session.name, "settings": knobs, "text": f"Background of {session.name} is set."}
    lines = [
        f"{view.camera:12} agreement {view.agreement:.2f}  (covered {view.covered:.2f}, inside {view.inside:.2f})"
        f"  {view.note}".rstrip()
        for view in measured.views
    ]
    if not all(view.usable for view in measured.views) and not _has_own_masks(session):
        lines.append(
            f"Masks that agree so little are of no use. 'studio background {session.name} --source best' tries every"
            " source and takes the one under which the views agree."
        )
    contrast = measured.contrast
    if contrast is not None and contrast.low:
        lines.append(f"{sentence(contrast.words)}. {contrast.remedy}")
        lines.append(f"'studio background {session.name} --quality --pictures FOLDER' draws where.")
    elif measured.agreeing and not measured.usable:
        lines.append(f"The views agree, but {measured.unconfirmed}: look at the masks yourself.")
    if measured.subjects > 1:
        lines.append(
            f"{measured.subjects} subjects are in view: say which one with --subject-at X,Y"
            f" ('studio subjects {session.name}' says where they stand)."
        )
    lines += [f"The calibration is in doubt: {finding}" for finding in measured.doubts]
    names = ("camera", "agreement", "covered", "inside", "denied", "usable", "note")
    return {
        "session": session.name,
        "frames": list(measured.frames),
        "cameras": [{name: getattr(view, name) for name in names} for view in measured.views],
        "usable": measured.usable,
        "contrast": contrast
        and {name: getattr(contrast, name) for name in ("low", "words", "remedy", "pose")}
        | {"cameras": [msgspec.to_builtins(view) for view in contrast.views]},
        "subjects": measured.subjects,
        "doubts": [msgspec.to_builtins(finding) for finding in measured.doubts],
        "hull_litres": list(measured.hull_litres),
        "settings": knobs,
        "text": "\n".join(lines),
    }


def _has_own_masks(session: Session) -> bool:
    """Whether masks were made or given, which trying other sources would replace."""
    model = mask_knobs(session).knobs.get("background_model", "auto")
    given = any(source.masks for source in session.manifest.footage.cameras)
    return model == "mask" or (model == "auto" and given)


def _with_plates(session: Session, words: Sequence[str]) -> Session:
    """The session with CAMERA=FILE words, or the files of one folder, as pictures or clips of the empty room."""
    folder = Path(words[0])
    if len(words) == 1 and folder.is_dir():
        return give_plates(session, {}, [path for path in sorted(folder.iterdir()) if path.is_file()])
    if len(words) == 1 and folder.is_file():
        raise NotFoundError(f"'{folder}' is a file, and no camera is named.", f"Write CAMERA={folder}.")
    if len(words) == 1 and "=" not in words[0]:
        raise NotFoundError(
            f"There is no folder '{folder}'.", "Give one that holds the plates, or CAMERA=FILE."
        )
    parted = [word.partition("=") for word in words]
    for word, (camera, _, path) in zip(words, parted, strict=True):
        if not (camera and path):
            raise NotFoundError(
                f"'--plates {word}' cannot be understood.", "Write CAMERA=FILE, or one folder."
            )
    return give_plates(session, {camera: Path(path) for camera, _, path in parted})


def _region(option: str, word: str) -> tuple[str, Path | list[tuple[float, ...]] | None]:
    """A camera, and a region of it: a painted picture, a polygon, or none any more."""
    camera, equals, value = word.partition("=")
    if not equals:
        unused = ", or unused" if option == "--exclude" else ""
        raise NotFoundError(
            f"'{option} {word}' cannot be understood.",
            f"Write CAMERA=MASK.png or CAMERA=X,Y;X,Y;X,Y{unused}.",
        )
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
