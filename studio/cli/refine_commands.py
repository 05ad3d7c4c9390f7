"""`studio refine` and `studio smooth`."""

from collections.abc import Callable
from typing import TypeVar

import click

from studio.cli.output import command, progress
from studio.knobs import allowed, changed, knobs_of
from studio.runs.refining import REFINED, SMOOTHED, MadeTrack, refine_run, smooth_run
from studio.runs.tracks import RAW
from studio.sessions.workspace import Workspace
from studio.tracking.refinement import RefinementSettings
from studio.tracking.smoothing import SmoothingSettings

F = TypeVar("F", bound=Callable[..., object])


def _knob_options(settings_type: type) -> Callable[[F], F]:
    """An option for every knob of a settings class, made from its declaration."""

    def add(function: F) -> F:
        for entry in reversed(knobs_of(settings_type)):
            text = f"{entry.help} ({allowed(entry)}; default {entry.default:g})"
            name = f"--{entry.name.replace('_', '-')}"
            function = click.option(name, entry.name, metavar=entry.kind.__name__.upper(), help=text)(
                function
            )
        return function

    return add


@click.command()
@click.argument("session")
@click.argument("run")
@click.option("--from", "source", default=RAW, show_default=True, help="The track that is refined.")
@click.option("--into", default=REFINED, show_default=True, help="Name of the track that is made.")
@click.option("--replace", is_flag=True, help="Write over a derived track of that name.")
@_knob_options(RefinementSettings)
@command
def refine(
    session: str, run: str, source: str, into: str, replace: bool, **knobs: str | None
) -> dict[str, object]:
    """Refine every frame of a RUN on its silhouettes, and keep that beside what the search found.

    Frames that follow each other are refined together. Ctrl-C ends it, and nothing is kept.
    """
    opened = Workspace().resolve(session)
    stored = opened.run(run)
    settings = changed(RefinementSettings(), _given(knobs))
    with progress(f"{opened.name} / {run}") as report:
        made = refine_run(
            opened, stored, source=source, into=into, settings=settings, replace=replace, progress=report
        )
    count = len(made.track.frames)
    text = (
        f"{opened.name} / {run}: track '{into}' made from '{source}', {made.moved} of {count} frames moved; "
        f"the silhouettes agree by {made.agreement_before:.3f} before, {made.agreement_after:.3f} after."
    )
    return {**_told(opened.name, run, made), "moved": made.moved, **_agreement(made), "text": text}


def _agreement(made: MadeTrack) -> dict[str, float]:
    return {"agreement_before": made.agreement_before, "agreement_after": made.agreement_after}


@click.command(name="smooth")
@click.argument("session")
@click.argument("run")
@click.option("--from", "source", default="", help="The track that is smoothed; default: refined, else raw.")
@click.option("--into", default=SMOOTHED, show_default=True, help="Name of the track that is made.")
@click.option("--replace", is_flag=True, help="Write over a derived track of that name.")
@_knob_options(SmoothingSettings)
@command
def smooth_command(
    session: str, run: str, source: str, into: str, replace: bool, **knobs: str | None
) -> dict[str, object]:
    """Smooth a RUN's poses in time, and keep that beside what the search found.

    Short gaps are filled and marked, long ones stay gaps.
    """
    opened = Workspace().resolve(session)
    settings = changed(SmoothingSettings(), _given(knobs))
    made = smooth_run(opened.run(run), source=source, into=into, settings=settings, replace=replace)
    text = (
        f"{opened.name} / {run}: track '{into}' made from '{made.track.made_by['from']}', second difference of the "
        f"markers {made.jitter_before:.1f} -> {made.jitter_after:.1f} mm RMS, {len(made.filled)} frames filled, "
        f"{len(made.left_out)} left out."
    )
    gaps = {"filled": list(made.filled), "left_out": list(made.left_out)}
    return {**_told(opened.name, run, made), **gaps, "text": text}


def _given(knobs: dict[str, str | None]) -> dict[str, str]:
    return {name: value for name, value in knobs.items() if value is not None}


def _told(session: str, run: str, made: MadeTrack) -> dict[str, object]:
    """What `--json` prints of a track that was made."""
    return {
        "session": session,
        "run": run,
        "track": made.track.name,
        "frames": len(made.track.frames),
        "made_by": dict(made.track.made_by),
        "jitter_before_mm": made.jitter_before,
        "jitter_after_mm": made.jitter_after,
    }
