"""`studio refine` and `studio smooth`."""

from collections.abc import Callable
from typing import TypeVar

import click

from studio.cli.knob_options import given, knob_options
from studio.cli.output import command, progress
from studio.knobs import changed, knobs_of
from studio.runs.refining import REFINED, SMOOTHED, MadeTrack, refine_run, smooth_run
from studio.sessions.workspace import Workspace
from studio.tracking.refinement import RefinementSettings
from studio.tracking.smoothing import SmoothingSettings

F = TypeVar("F", bound=Callable[..., object])


def _track_options(settings_type: type, source: str, into: str, source_help: str) -> Callable[[F], F]:
    """What a command is given that makes a track of a run: which run, from which track, under which name, knobs."""

    def add(function: F) -> F:
        options = (
            click.argument("session"),
            click.argument("run"),
            click.option("--from", "source", default=source, show_default=bool(source), help=source_help),
            click.option("--into", default=into, show_default=True, help="Name of the track that is made."),
            click.option("--replace", is_flag=True, help="Write over a derived track of that name."),
            knob_options(knobs_of(settings_type)),
        )
        for option in reversed(options):
            function = option(function)
        return function

    return add


@click.command()
@_track_options(
    RefinementSettings, "", REFINED, "The track that is refined; default: as tracked, sides put right."
)
@command
def refine(
    session: str, run: str, source: str, into: str, replace: bool, **knobs: str | None
) -> dict[str, object]:
    """Refine every frame of a RUN on its silhouettes, and keep that beside what the search found.

    Frames that follow each other are refined together. Ctrl-C ends it, and nothing is kept.
    """
    opened = Workspace().resolve(session)
    stored = opened.run(run)
    settings = changed(RefinementSettings(), given(knobs))
    with progress(f"{opened.name} / {run}") as report:
        made = refine_run(
            opened, stored, source=source, into=into, settings=settings, replace=replace, progress=report
        )
    count = len(made.track.frames)
    text = (
        f"{opened.name} / {run}: track '{into}' made from '{made.track.made_by['from']}', {made.moved} of {count} "
        f"frames moved; the silhouettes agree by {made.agreement_before:.3f} before, {made.agreement_after:.3f} after."
    )
    return {**_told(opened.name, run, made), "moved": made.moved, **_agreement(made), "text": text}


def _agreement(made: MadeTrack) -> dict[str, float]:
    return {"agreement_before": made.agreement_before, "agreement_after": made.agreement_after}


@click.command(name="smooth")
@_track_options(
    SmoothingSettings, "", SMOOTHED, "The track that is smoothed; default: refined, else sides, else raw."
)
@command
def smooth_command(
    session: str, run: str, source: str, into: str, replace: bool, **knobs: str | None
) -> dict[str, object]:
    """Smooth a RUN's poses in time, and keep that beside what the search found.

    Short gaps are filled and marked, long ones stay gaps.
    """
    opened = Workspace().resolve(session)
    settings = changed(SmoothingSettings(), given(knobs))
    made = smooth_run(opened.run(run), source=source, into=into, settings=settings, replace=replace)
    text = (
        f"{opened.name} / {run}: track '{into}' made from '{made.track.made_by['from']}', second difference of the "
        f"markers {made.jitter_before:.1f} -> {made.jitter_after:.1f} mm RMS, {len(made.filled)} frames filled, "
        f"{len(made.left_out)} left out."
    )
    gaps = {"filled": list(made.filled), "left_out": list(made.left_out)}
    return {**_told(opened.name, run, made), **gaps, "text": text}


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
