"""`studio live`."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import click

from studio.cli.knob_options import SET_OPTION, chosen_changes, given
from studio.cli.output import MemberChoice, command, note, progress
from studio.cli.recording_commands import CAMERA_OPTION, addresses_of
from studio.cli.tracking_commands import (
    DESPITE_OPTION,
    own_options,
    say_run_notes,
    told_run,
    tracking_shown,
)
from studio.errors import RunError
from studio.runs.live_replay import prepare_replay
from studio.runs.live_request import last_of
from studio.runs.live_summary import LiveSummary, in_words, summary_of
from studio.runs.new_run import RunRequest, prepare_run
from studio.sessions.names import free_name
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace
from studio.tracking.catalogue import TRACKERS
from studio.weighting.catalogue import WEIGHTINGS
from studio.worker.camera_tracking import TakeWish, track_cameras
from studio.worker.live_tracking import replay_live, track_live


@click.command()
@click.argument("session")
@click.option("--tracker", type=MemberChoice(TRACKERS), default="behaviour", show_default=True)
@click.option("--weighting", type=MemberChoice(WEIGHTINGS), default="blobs", show_default=True)
@click.option("--body", default="", metavar="NAME", help="Kinematic tree; the session's subject scales it.")
@click.option("--behaviour", default="", metavar="MODEL", help="Behaviour model, by name or file.")
@own_options
@click.option("--from", "first", type=int, default=0, show_default=True, help="The frame that comes first.")
@click.option("--seconds", type=float, help="Track for so long; default: to the footage's end.")
@click.option("--repeat", is_flag=True, help="Go forth and back through the footage; needs --seconds.")
@click.option("--seed", type=int, default=0, show_default=True)
@DESPITE_OPTION
@SET_OPTION
@click.option("--name", default="", help="Name of the run; default: numbered.")
@click.option("--resume", metavar="RUN", help="Go on with a live run that was ended.")
@click.option(
    "--replay", metavar="RUN", help="Track a live run's frames again, without the clock, and compare."
)
@CAMERA_OPTION
@click.option("--into", metavar="SESSION", help="With --camera: the session that keeps what the cameras saw.")
@click.option(
    "--seek-start", is_flag=True, help="With --camera: search the start pose in the first pictures."
)
@command
def live(
    session: str,
    first: int,
    seconds: float | None,
    repeat: bool,
    resume: str | None,
    replay: str | None,
    changes: tuple[str, ...],
    cameras: tuple[str, ...],
    into: str | None,
    seek_start: bool,
    **asked: str | None,
) -> dict[str, object]:
    """Track a SESSION as its pictures come: at the footage's own rate, dropping frames rather than falling behind.

    With --camera live cameras are tracked with the session's calibration, empty room and person, and recorded at once
    into a session of their own, where the run is tracked again bit for bit with --replay.

    Ctrl-C ends it and keeps what was tracked.
    """
    opened = Workspace().resolve(session)
    if cameras:
        if repeat or resume or replay or first:
            raise RunError(
                "Live cameras have no footage to begin in, repeat or go on with.", "Leave that out."
            )
        wish = TakeWish(_place(opened, into), seconds, keep_start=not seek_start)
        return _from_cameras(opened, cameras, wish, _request(asked, changes))
    if into or seek_start:
        raise RunError("--into and --seek-start are for live cameras.", "Give them with --camera.")
    if replay:
        return _replayed(opened, opened.run(replay), asked["name"] or "")
    if repeat and seconds is None and not resume:
        raise RunError("Footage that repeats has no end.", "Say how long with --seconds.")
    if resume:
        run = opened.run(resume)
    else:
        request = dataclasses.replace(
            _request(asked, changes),
            first=first,
            last=last_of(opened, first, seconds, repeat),
            to_and_fro=repeat,
        )
        with progress(f"{opened.name}: getting ready") as report:
            run = prepare_run(opened, request, report)
    with tracking_shown(run, lambda: _in_words(summary_of(run))) as report:
        found = track_live(opened, run, report)
    return {**_told(run, found), "text": f"{opened.name} / {run.name}: {_in_words(found)}"}


def _request(asked: Mapping[str, str | None], changes: tuple[str, ...]) -> RunRequest:
    """What is asked of a live run, by the command's options."""
    named = ("tracker", "weighting", "body", "behaviour", "seed", "name", "despite_findings")
    knobs = {key: value for key, value in asked.items() if key not in named}
    return RunRequest(
        **{key: asked[key] for key in named},  # pyright: ignore[reportArgumentType]
        changes=chosen_changes(changes) | given(knobs),
        live=True,
    )


def _place(session: Session, into: str | None) -> Path:
    """Where the take of live cameras is made: beside its session unless said otherwise."""
    if into:
        return Workspace().place_for(into)
    taken = {path.name for path in session.path.parent.iterdir()}
    return session.path.with_name(free_name(f"{session.name}-live", taken))


def _from_cameras(
    session: Session, cameras: tuple[str, ...], wish: TakeWish, request: RunRequest
) -> dict[str, object]:
    with progress(f"{wish.into.name}") as report:
        found = track_cameras(session, addresses_of(cameras), wish, request, report)
    say_run_notes(found.run)
    for notice in found.standing.notices:
        note(notice.in_words)
    spreads = found.standing.spreads
    return {
        **_told(found.run, found.summary),
        "sets": found.standing.sets,
        "ended": found.standing.ended,
        "spread_ms": {"median": spreads.median, "p95": spreads.most, "worst": spreads.worst},
        "apart": spreads.apart,
        "lagging": spreads.lagging,
        "stopped": [
            {"camera": one.camera, "state": one.state, "at": one.seconds, "noticed_after": one.silent}
            for one in found.standing.notices
        ],
        "text": f"{found.session.name} / {found.run.name}: {_in_words(found.summary)}; {spreads.in_words}",
    }


def _replayed(session: Session, run: StoredRun, name: str) -> dict[str, object]:
    made = prepare_replay(session, run, name)
    with progress(f"{session.name} / {made.name}") as report:
        found = replay_live(session, run, made, report)
    verdict = (
        f"all {found.frames} frames of '{run.name}' again, bit for bit"
        if not found.different
        else f"{len(found.different)} of {found.frames} frames of '{run.name}' came out otherwise"
    )
    return {
        "session": session.name,
        "run": made.name,
        "replayed": run.name,
        "frames": found.frames,
        "different": list(found.different),
        "text": f"{session.name} / {made.name}: {verdict}",
    }


def _told(run: StoredRun, found: LiveSummary) -> dict[str, object]:
    """What `--json` prints of a live run."""
    return {
        **told_run(run),
        "frames": len(found.tracked),
        "dropped": list(found.dropped),
        "dropped_share": round(found.dropped_share, 4),
        "incomplete": list(found.incomplete),
        "frames_per_second": round(found.frames_per_second, 2),
        "footage_frames_per_second": run.record.fps,
        "latency_ms": {
            name: round(found.latency(share), 1)
            for name, share in (("median", 0.5), ("p95", 0.95), ("worst", 1.0))
        },
    }


def _in_words(found: LiveSummary) -> str:
    """How a live run went, for a person."""
    if not found.tracked:
        return "nothing was tracked."
    words = f"{len(found.tracked)} frames tracked, {found.frames_per_second:.1f} a second"
    if found.dropped:
        words += f"; {len(found.dropped)} dropped ({found.dropped_share:.1%}): {in_words(found.dropped)}"
    else:
        words += "; none dropped"
    if found.incomplete:
        words += f"; {len(found.incomplete)} sets of pictures incomplete: {in_words(found.incomplete)}"
    latency = " / ".join(f"{found.latency(share):.0f}" for share in (0.5, 0.95, 1.0))
    return f"{words}; picture to pose {latency} ms (median / 95 % / worst)"
