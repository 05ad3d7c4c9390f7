"""`studio subject` and `studio fit-subject`."""

from collections.abc import Sequence
from pathlib import Path

import click

from studio.cli.arguments import frame_numbers
from studio.cli.output import command, note, progress
from studio.errors import BodyError
from studio.notebook.preparing import subject_with_notes
from studio.runs.subject_choice import keep_fitted
from studio.runs.subject_fitting import COUNT, FitRequest, FittedSubject, fit_session_subject, keep_subject
from studio.sessions.workspace import Workspace


@click.command(name="subject")
@click.argument("session")
@click.option("--height", type=float, help="Of the person, mm; all lengths follow by published proportions.")
@click.option("--body", default="", metavar="NAME", help="Kinematic tree; default: the session's.")
@click.option(
    "--length", "lengths", multiple=True, metavar="PAIR=MM", help="A measured length, such as RHip_RKnee=420."
)
@command
def subject(session: str, height: float | None, body: str, lengths: Sequence[str]) -> dict[str, object]:
    """Write down who is in front of SESSION's cameras (new runs then have that body), or show it.

    With nothing but a height every length, hands and feet included, is its published share of it (sources: the body
    file).
    """
    opened = Workspace().resolve(session)
    found, notes = subject_with_notes(opened, height, lengths_mm=_pairs(lengths), body=body)
    for line in notes:
        note(line)
    lines = [f"{key:28} {value:8.1f}" for key, value in found.dimensions.items()]
    return {
        "session": opened.name,
        "body": found.name,
        "height_mm": height,
        "dimensions": dict(found.dimensions),
        "source": found.definition.source if found.definition else "",
        "text": "\n".join(lines),
    }


@click.command(name="fit-subject")
@click.argument("session")
@click.option("--frames", default="", metavar="A,B,…", help="To look at; default: chosen for their variety.")
@click.option("--count", type=int, default=COUNT, show_default=True, help="How many frames to choose.")
@click.option("--symmetric/--asymmetric", default=True, show_default=True, help="Left and right alike.")
@click.option("--lengths/--no-lengths", default=True, show_default=True, help="Fit lengths.")
@click.option("--radii/--no-radii", default=True, show_default=True, help="Fit radii.")
@click.option("--height", type=float, help="Known to a few centimetres, mm; default: the subject's.")
@click.option(
    "--run", "run", default="", metavar="RUN", help="Whose poses to begin with; default: the newest."
)
@click.option("--body", default="", metavar="NAME", help="Kinematic tree; default: the session's.")
@click.option("--into", type=click.Path(path_type=Path), help="File instead of the session's own subject.")
@click.option("--seed", type=int, default=0, show_default=True, help="The same seed finds the same subject.")
@command
def fit_subject_command(
    session: str,
    frames: str,
    count: int,
    symmetric: bool,
    lengths: bool,
    radii: bool,
    height: float | None,
    run: str,
    body: str,
    into: Path | None,
    seed: int,
) -> dict[str, object]:
    """Find limb lengths and radii of the person in SESSION, together with the poses of a few frames.

    The result becomes the session's subject (the old one stays beside it as subject-before.toml). ± is one
    standard deviation.
    """
    opened = Workspace().resolve(session)
    request = FitRequest(
        frames=frame_numbers(frames),
        count=count,
        symmetric=symmetric,
        lengths=lengths,
        radii=radii,
        run=run,
        body=body,
        height_mm=height,
        seed=seed,
    )
    with progress(f"{opened.name}: subject") as report:
        found = fit_session_subject(opened, request, progress=report)
    place = keep_fitted(opened, found) if into is None else keep_subject(opened, found, into)
    return {
        "session": opened.name,
        "body": found.body.name,
        "file": str(place),
        "frames": list(found.frames),
        "poses_from": found.poses_from,
        "sizes": [
            {
                "name": one.name,
                "kind": one.kind,
                "before": one.before,
                "after": one.after,
                "deviation": one.deviation,
            }
            for one in found.sizes
        ],
        "overlap_before": found.overlap_before.tolist(),
        "overlap": found.overlap.tolist(),
        "evaluations": found.evaluations,
        "text": _in_words(found, place),
    }


def _in_words(found: FittedSubject, place: Path) -> str:
    lines = [
        f"{one.name:24} {one.before:7.0f} → {one.after:5.0f} mm ± {one.deviation:.0f}" for one in found.sizes
    ]
    fit = f"silhouettes overlap by {found.overlap_before.mean():.2f} before, {found.overlap.mean():.2f} after"
    return "\n".join([*lines, f"Subject written to {place.name}; {fit}."])


def _pairs(words: Sequence[str]) -> dict[str, float]:
    found = {}
    for word in words:
        pair, equals, value = word.partition("=")
        try:
            found[pair] = float(value)
        except ValueError:
            equals = ""
        if not equals:
            raise BodyError(f"'--length {word}' cannot be understood.", "Write RHip_RKnee=420.")
    return found
