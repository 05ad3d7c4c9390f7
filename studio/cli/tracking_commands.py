"""Tracking: `track`, `live`, `correct`, `branch`."""

import os
from pathlib import Path

import click

from studio.cli.deriving import Call, command_of
from studio.cli.footage_commands import spread_figures
from studio.cli.reading import frame_range
from studio.foundations.csv_text import poses_csv
from studio.foundations.errors import RunError
from studio.operations.opening import Tracked
from studio.operations.tracking import (
    Replayed,
    TrackedLive,
    branch,
    correct,
    go_on,
    live,
    live_words,
    new_run,
    replay,
    resume_live,
    run_to_go_on,
    track,
)
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.tracker import LIMB_LOST, LOST, NO_EVIDENCE, RECOVERED
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

FRAMES = click.option(
    "--frames",
    metavar="A:B",
    default=":",
    help="Half open, from 0; default: from the frame of the start pose to the end.",
)
POSES = click.option("--poses", type=click.Path(path_type=Path), help="Write the poses as CSV.")
RESUME = click.option(
    "--resume", metavar="RUN", help="Track a stored run on, as it was begun; same result as unbroken."
)


@command_of(track, FRAMES, POSES, RESUME, without=("first", "last"))
def track_command(call: Call, frames: str, poses: Path | None, resume: str | None) -> dict[str, object]:
    session: Session = call.given["session"]
    if poses:
        _check_place(poses)
    if resume:
        run = run_to_go_on(session, resume)
    else:
        first, last = frame_range(frames)
        run = call.do(new_run, **{**call.given, "first": first, "last": last})
    try:
        done: Tracked = call.do(go_on, run=run)
    except KeyboardInterrupt:
        if poses and run.summary().done:
            _write_poses(run, poses)
        raise
    if poses:
        _write_poses(run, poses)
    record, went = run.record, _went(run)
    result = {
        **_which(run),
        "frames": record.frame_count,
        "evaluations_per_frame": done.evaluations_per_frame,
        "seconds": round(done.seconds, 3),
        "start_pose": record.start_source,
        **went,
        "damaged": run.damage(),
    }
    text = (
        f"{session.name} / {run.name}: {record.frame_count} frames in {done.seconds:.1f} s, "
        f"seed {record.seed}{_in_words(went)}"
    )
    if done.exchanged:
        text += f"\n{done.sides_in_words}"
        result["exchanged"] = list(done.exchanged)
    if record.behaviour:
        result["behaviour"] = record.behaviour
    if TRACKERS[record.tracker].scales_likelihood:
        result["likelihood_scale"] = done.likelihood_scale
    return {**result, "text": text}


RESUME_LIVE = click.option("--resume", metavar="RUN", help="Go on with a live run that was ended.")
REPLAY = click.option(
    "--replay",
    "again",
    metavar="RUN",
    help="Track a live run's frames again, without the clock, and compare.",
)


@command_of(live, RESUME_LIVE, REPLAY)
def live_command(call: Call, resume: str | None, again: str | None) -> dict[str, object]:
    session: Session = call.given["session"]
    if (resume or again) and call.given["cameras"]:
        raise RunError("Live cameras have no footage to begin in, repeat or continue.", "Leave that out.")
    if again:
        return _replayed(session, call.do(replay, run=session.run(again), name=call.given.get("name", "")))
    done: TrackedLive = (
        call.do(resume_live, run=session.run(resume), send=call.given["send"]) if resume else call()
    )
    summary, run = done.summary, done.run
    result: dict[str, object] = {
        **_which(run),
        "frames": len(summary.tracked),
        "dropped": list(summary.dropped),
        "dropped_share": round(summary.dropped_share, 4),
        "incomplete": list(summary.incomplete),
        "frames_per_second": round(summary.frames_per_second, 2),
        "footage_frames_per_second": run.record.fps,
        "latency_ms": {
            name: round(summary.latency(share), 1)
            for name, share in (("median", 0.5), ("p95", 0.95), ("worst", 1.0))
        },
    }
    text = f"{done.session.name} / {run.name}: {live_words(summary)}"
    if done.standing is not None:
        standing = done.standing
        result |= {"sets": standing.sets, "ended": standing.ended, **spread_figures(standing.spreads)}
        result["stopped"] = [
            {"camera": one.camera, "state": one.state, "at": one.seconds, "noticed_after": one.silent}
            for one in standing.notices
        ]
        text += f"; {standing.spreads.in_words}"
    return {**result, "text": text}


def _replayed(session: Session, done: Replayed) -> dict[str, object]:
    compared, of = done.compared, done.of.name
    verdict = (
        f"all {compared.frames} frames of '{of}' again, bit for bit"
        if not compared.different
        else f"{len(compared.different)} of {compared.frames} frames of '{of}' came out otherwise"
    )
    return {
        "session": session.name,
        "run": done.run.name,
        "replayed": of,
        "frames": compared.frames,
        "different": list(compared.different),
        "text": f"{session.name} / {done.run.name}: {verdict}",
    }


@command_of(correct)
def correct_command(call: Call) -> dict[str, object]:
    old, frame, back_to = call.given["run"], call.given["frame"], call.given.get("back_to")
    run: StoredRun = call().run
    tracked = run.record.last - frame if back_to is None else frame - back_to + 1
    way = "on" if back_to is None else "backwards"
    where = f"{run.session_name} / {run.name}: run '{old.name}' corrected in frame {frame}"
    return {
        "session": run.session_name,
        "run": run.name,
        "made_from": old.name,
        "corrected": frame,
        "back_to": back_to,
        "frames": tracked,
        "text": f"{where}, {tracked} frames tracked {way}.",
    }


@command_of(branch)
def branch_command(call: Call) -> dict[str, object]:
    old, frame = call.given["run"], call.given["frame"]
    run: StoredRun = call().run
    tracked = run.record.last - frame
    return {
        **_which(run),
        "made_from": old.name,
        "from_frame": frame,
        "frames": tracked,
        "text": f"{run.session_name} / {run.name}: run '{old.name}' from frame {frame} on, {tracked} frames tracked.",
    }


def _which(run: StoredRun) -> dict[str, object]:
    """What `--json` says of any run: which it is."""
    record = run.record
    names = ("tracker", "weighting", "body", "seed")
    return {"session": run.session_name, "run": run.name, **{name: getattr(record, name) for name in names}}


def _went(run: StoredRun) -> dict[str, int]:
    """How many frames were lost, without evidence, and found again after."""
    with run.results() as results:
        states = results.timeline().tracking
    return {
        "frames_lost": states.count(LOST),
        "frames_with_a_limb_lost": states.count(LIMB_LOST),
        "frames_without_evidence": states.count(NO_EVIDENCE),
        "times_recovered": states.count(RECOVERED),
    }


def _in_words(went: dict[str, int]) -> str:
    """The same in words, nothing where all frames were tracked."""
    words = (
        f"{went['frames_lost']} frames lost",
        f"{went['frames_with_a_limb_lost']} with a limb lost",
        f"{went['frames_without_evidence']} without evidence",
        f"found again {went['times_recovered']} times",
    )
    return f"; {', '.join(words)}" if any(went.values()) else ""


def _check_place(poses: Path) -> None:
    """Refuse, before anything is tracked, a file that could not be written afterwards. Raises RunError."""
    if poses.is_dir() or not os.access(poses if poses.exists() else poses.parent, os.W_OK):
        raise RunError(
            f"The poses cannot be written to '{poses}'.", "Choose a file in a folder that can be written to."
        )


def _write_poses(run: StoredRun, path: Path) -> None:
    """CSV: frame, then one column a parameter in the body's order, radians and mm."""
    with run.results() as results:
        frames, rows = results.poses()
    try:
        with path.open("w", newline="\r\n", encoding="utf-8") as file:
            file.write(poses_csv(run.record.parameters, frames, rows))
    except OSError as error:
        raise RunError(
            f"'{path}' cannot be written ({error.strerror}).", "Choose another place; the run is stored."
        ) from None
