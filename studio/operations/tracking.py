"""Tracking: from footage or live cameras, gone on with, again without the clock, corrected."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Concatenate, ParamSpec, TypeVar

from pydantic import Field

from studio.foundations.declaring import (
    AllowInconsistent,
    Body,
    Knobs,
    Model,
    Seed,
    Terminal,
    Values,
    Web,
    operation,
    taking,
)
from studio.foundations.errors import RunError, SettingsError, StudioError
from studio.foundations.progress import Progress, no_progress
from studio.operations.footage import Cameras, addresses_of
from studio.operations.jobs.batch import BatchResult, track_to_end
from studio.operations.jobs.camera_tracking import LiveRecordingRequest, track_cameras
from studio.operations.jobs.live_tracking import replay_live, track_live
from studio.operations.jobs.send_addresses import SendAddress, send_address
from studio.operations.jobs.set_recording import SetStanding
from studio.operations.opening import (
    AnySession,
    RunName,
    SessionName,
    Tracked,
    keeping_in_place,
    open_run,
    open_session,
    session_of,
)
from studio.operations.progress import Reporting, reporting, say
from studio.runs.branching import prepare_branch
from studio.runs.correcting import prepare_correction, track_backwards
from studio.runs.live.live_replay import Comparison, prepare_replay
from studio.runs.live.live_request import last_of
from studio.runs.live.live_summary import LiveSummary, in_words, summary_of
from studio.runs.new_run import (
    DESPITE,
    Numbers,
    Pose,
    TrackerName,
    WeightingName,
    given_pose,
    own_knobs,
    prepare_run,
)
from studio.runs.sides import corrections_of
from studio.runs.tracks import pose_in_track, read_track
from studio.sessions.names import free_name
from studio.sessions.remote_sessions import address_of, bring_runs, free_run_name_at, put_run
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

P = ParamSpec("P")
R = TypeVar("R")


def of_new_run(
    make: Callable[Concatenate[Session, P], StoredRun],
) -> Callable[[Callable[..., R]], Callable[Concatenate[SessionName, P], R]]:
    """Let a verb take what a new run takes, with the session by its name."""
    return taking(make)


@operation
@of_new_run(prepare_run)
@keeping_in_place
def new_run(session: AnySession, *, progress: Reporting = None, **options: object) -> StoredRun:
    """Prepare a new run; what is left out is the session's own or the studio's default.

    Raises StudioError naming what is wrong; then nothing was made.
    """
    opened = open_session(session, remote=True)
    if address_of(opened):
        options["name"] = free_run_name_at(opened, str(options.get("name") or ""))
    with reporting(progress, f"{opened.name}: preparing") as report:
        return prepare_run(opened, **options, progress=report)  # pyright: ignore[reportArgumentType]


@operation
@of_new_run(prepare_run)
def track(session: AnySession, *, progress: Reporting = None, **options: object) -> Tracked:
    """Track a session and store the run. Ctrl-C cancels; frames that are tracked are kept, and the run can be
    continued.

    The same seed gives the same run.

    Raises SettingsError for an unknown knob or name, RunError or FootageError where the session cannot be tracked.
    """
    return go_on(new_run(session, progress=progress, **options), progress=progress)  # pyright: ignore[reportArgumentType]


def run_to_go_on(session: Session, name: str) -> StoredRun:
    """A run of a session by its name; of a copy of a remote session it is brought first. Raises NotFoundError."""
    bring_runs(session, name)
    return session.run(name)


@operation
@keeping_in_place
def go_on(run: RunName, *, progress: Reporting = None) -> Tracked:
    """Continue an interrupted run: bit for bit what it would have been.

    Raises RunError for a finished run, or one that another process tracks.
    """
    stored = open_run(run)
    _say_notes(stored, progress)

    def how_far() -> str:
        return f"{stored.summary().done} of {stored.record.frame_count} frames tracked."

    session = session_of(stored)
    with _reporting(stored, progress, how_far) as report:
        try:
            batch = track_to_end(session, stored, report)
        except BaseException:
            # The error that interrupted it matters, not a second one from uploading its frames.
            with suppress(StudioError):
                put_run(session, stored)
            raise
        put_run(session, stored)
        return _as_tracked(stored, batch)


@contextmanager
def _reporting(run: StoredRun, progress: Reporting, how_far: Callable[[], str]) -> Generator[Progress]:
    """The progress of tracking a run. Ctrl-C is passed on after it was said how many frames are done."""
    title = f"{run.session_name} / {run.name}"
    try:
        with reporting(progress, title) as report:
            yield report
    except KeyboardInterrupt:
        say(progress, [f"{title}: {how_far()}"])
        raise


SendTo = Annotated[
    Sequence[str],
    Field(
        description="Where the poses are sent as they are tracked: osc://HOST:PORT (VMC) or ws://HOST:PORT (JSON);"
        " without a host this machine."
    ),
    Terminal("--send", "ADDRESS"),
]


@dataclass(frozen=True, slots=True, eq=False)
class TrackedLive:
    """A live run that was tracked.

    session, run : as stored.
    summary : which frames came, and how fast.
    standing : of the cameras, if there were any; their session is then a new one.
    """

    session: Session
    run: StoredRun
    summary: LiveSummary
    standing: SetStanding | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveRequest:
    """What a live run takes."""

    tracker: TrackerName = ""
    weighting: WeightingName = ""
    body: Body = ""
    behaviour: Annotated[
        Model,
        Field(
            description="Behaviour model, by name or file; unless others are named, tracker behaviour follows it on"
            " likelihood blobs."
        ),
    ] = ""
    first: Annotated[int, Field(ge=0, description="The frame that comes first."), Terminal("--from")] = 0
    seconds: Annotated[
        float | None, Field(gt=0, le=86400, description="Seconds to track; default: to the footage's end.")
    ] = None
    repeat: Annotated[bool, Field(description="Play the footage forwards and backwards; needs seconds.")] = (
        False
    )
    seed: Seed = 0
    knobs: Annotated[
        Values, Field(description="Any other knob."), Knobs(own_knobs, others=True, with_defaults=False)
    ] = None
    name: Annotated[str, Field(description="Name of the run; default: numbered.")] = ""
    allow_inconsistent: AllowInconsistent = False
    cameras: Annotated[Cameras, Web(left_out=True)] = ()
    into: Annotated[
        str | Path | None,
        Field(description="With cameras: the session that keeps their pictures."),
        Terminal(kind=str, metavar="SESSION"),
    ] = None
    keep_start: Annotated[
        bool,
        Field(
            description="With cameras: the person begins in the session's start pose; default: the pose is"
            " searched for in the first pictures."
        ),
        Terminal("--keep-start/--seek-start"),
    ] = True
    send: Annotated[SendTo, Web(left_out=True)] = ()

    def of_run(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in OF_RUN} | {"live": True}


OF_RUN = ("tracker", "weighting", "body", "behaviour", "seed", "knobs", "name", "allow_inconsistent")


@operation
@taking(LiveRequest)
@keeping_in_place
def live(
    session: SessionName,
    *,
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> TrackedLive:
    """Track a session as its pictures come: at the footage's own rate, dropping frames rather than falling behind.

    Live cameras are tracked with the session's calibration, empty room and person, and recorded at the same time into a
    session of their own, in which `replay` tracks the run again bit for bit. Ctrl-C ends it and keeps the tracked
    frames.

    Raises SettingsError for options that exclude each other, FootageError for a camera that gives no picture, RunError.
    """
    request, opened = LiveRequest(**options), open_session(session)
    send_to = _send_addresses(request.send)
    if request.cameras:
        if request.repeat or request.first:
            raise RunError("Live cameras have no footage to begin in, repeat or continue.", "Leave that out.")
        recording = LiveRecordingRequest(
            _place(opened, request.into), request.seconds, keep_start=request.keep_start, send_to=send_to
        )
        with reporting(progress, recording.into.name) as report:
            done = track_cameras(opened, addresses_of(request.cameras), recording, request.of_run(), report)
        _say_notes(done.run, progress)
        say(progress, [notice.in_words for notice in done.standing.notices])
        return TrackedLive(done.session, done.run, done.summary, done.standing)
    if request.into or not request.keep_start:
        raise RunError("--into and --seek-start are for live cameras.", "Give them with --camera.")
    if request.repeat and request.seconds is None:
        raise RunError("Footage that repeats has no end.", "Say how long with --seconds.")
    with reporting(progress, f"{opened.name}: getting ready") as report:
        span: dict[str, Any] = {
            "first": request.first,
            "last": last_of(opened, request.first, request.seconds, request.repeat),
            "ping_pong": request.repeat,
        }
        run = prepare_run(opened, **request.of_run(), **span, progress=report)
    return resume_live(run, send=request.send, progress=progress)


@operation
@keeping_in_place
def resume_live(
    run: RunName, *, send: Annotated[SendTo, Web(left_out=True)] = (), progress: Reporting = None
) -> TrackedLive:
    """Continue a live run that was ended."""
    stored = open_run(run)
    _say_notes(stored, progress)
    opened = session_of(stored)
    with _reporting(stored, progress, lambda: live_words(summary_of(stored))) as report:
        return TrackedLive(opened, stored, track_live(opened, stored, report, send_to=_send_addresses(send)))


@dataclass(frozen=True, slots=True)
class Replayed:
    """A live run tracked again without the clock.

    run : the new run.
    of : the live run.
    compared : in which frames they differ.
    """

    run: StoredRun
    of: StoredRun
    compared: Comparison


@operation
@keeping_in_place
def replay(
    run: RunName,
    *,
    name: Annotated[str, Field(description="Name of the new run; default: numbered.")] = "",
    progress: Reporting = None,
) -> Replayed:
    """Track a live run's frames again, without the clock, and compare the two."""
    stored = open_run(run)
    opened = session_of(stored)
    made = prepare_replay(opened, stored, name)
    with reporting(progress, f"{opened.name} / {made.name}") as report:
        return Replayed(made, stored, replay_live(opened, stored, made, report))


@operation
def correct(
    run: RunName,
    frame: Annotated[int, Field(ge=0, description="The frame that is corrected."), Terminal("--at", "K")],
    pose: Annotated[
        Pose | None,
        Field(description="Its pose: radians and mm in the body's order, or a file: a CSV row, a TRC."),
        Terminal("--pose", kind=Path),
        Web(kind=Numbers),
    ] = None,
    *,
    from_track: Annotated[
        str,
        Field(description="Take its pose from a track of the run."),
        Terminal(metavar="NAME"),
        Web("track"),
    ] = "",
    back_to: Annotated[
        int | None,
        Field(
            ge=0,
            description="Track backwards to this frame and keep all others; default: forwards to the run's end.",
        ),
        Terminal(metavar="J"),
    ] = None,
    name: Annotated[str, Field(description="Name of the corrected run; default: numbered.")] = "",
    progress: Reporting = None,
) -> Tracked:
    """Give a run the right pose in one frame and track on from there, into a new run; the old one is kept.

    Ctrl-C stops; tracked frames are kept, and a run tracked forwards can be continued.

    Raises SettingsError unless exactly one pose is given.
    """
    stored = open_run(run)
    new = set_up_correction(stored, frame, pose, from_track, back_to, name)
    if back_to is None:
        return go_on(new, progress=progress)
    done = 0

    def counted(step: str, count: int, total: int) -> None:
        nonlocal done
        done = count
        report(step, count, total)

    def how_far() -> str:
        return f"{done} frames tracked backwards, the others are the old run's."

    with _reporting(new, progress, how_far) as report:
        track_back(new, counted)
    return _as_tracked(new, None)


@keeping_in_place
def track_back(
    run: RunName, progress: Progress = no_progress, cancelled: Callable[[], bool] | None = None
) -> int:
    """Track a corrected run backwards from its corrected frame; the number of frames with new poses.

    progress : called after each frame.
    cancelled : checked before each layer; True stops and keeps the frames done.

    Raises RunError for a run that was not made for this, or that another process has open.
    """
    stored = open_run(run)
    return track_backwards(session_of(stored), stored, progress, cancelled)


@operation
def branch(
    run: RunName,
    frame: Annotated[
        int, Field(ge=0, description="The first frame that is tracked again."), Terminal("--at", "K")
    ],
    *,
    knobs: Annotated[
        Values, Field(description="Any other knob."), Knobs(own_knobs, others=True, with_defaults=False)
    ] = None,
    name: Annotated[
        str, Field(description="Name of the new run; default: the old name and the changed knobs.")
    ] = "",
    progress: Reporting = None,
) -> Tracked:
    """Track a frame and all later ones again with other knobs, into a new run; the old one is kept.

    Earlier frames are the old run's. Without knobs the ones that were moved in the run are used. Ctrl-C stops; tracked
    frames are kept, and the run can be continued.

    Raises SettingsError where no knob differs.
    """
    return go_on(set_up_branch(run, frame, knobs, name), progress=progress)


@keeping_in_place
def set_up_branch(
    run: RunName, frame: int, knobs: Mapping[str, object] | None = None, name: str = ""
) -> StoredRun:
    """The run that `branch` tracks, not begun."""
    stored = open_run(run)
    return prepare_branch(session_of(stored), stored, frame, knobs, name)


@keeping_in_place
def set_up_correction(
    run: StoredRun,
    frame: int,
    pose: Pose | None = None,
    from_track: str = "",
    back_to: int | None = None,
    name: str = "",
    source: str = "",
) -> StoredRun:
    """The run that `correct` tracks, not begun. source : where the pose came from, in words."""
    if (pose is None) == (not from_track):
        raise SettingsError("A corrected frame needs a pose.", "Give one, or the track to take it from.")
    if pose is None:
        given, source = pose_in_track(run, from_track, frame), f"track {from_track}"
    else:
        given, source, _ = given_pose(pose, source, run.body(), run.record.fps, frame)
    return prepare_correction(
        session_of(run), run, frame, given, source=source, backwards_to=back_to, name=name
    )


def _place(session: Session, into: str | Path | None) -> Path:
    """The folder for a recording of live cameras: beside its session unless another is named."""
    if into:
        return Workspace().place_for(into)
    taken = {path.name for path in session.path.parent.iterdir()}
    return session.path.with_name(free_name(f"{session.name}-live", taken))


def _say_notes(run: StoredRun, progress: Reporting) -> None:
    """Show a run's notes: what holds for the session once, what was accepted for this run every time."""
    accepted = [line for line in run.record.notes if line.startswith(DESPITE)]
    say(progress, [line for line in run.record.notes if line not in accepted], run.folder.parent.parent)
    say(progress, accepted)


def _as_tracked(run: StoredRun, result: BatchResult | None) -> Tracked:
    fresh = StoredRun(run.folder)
    record = fresh.record
    return Tracked(
        fresh,
        read_track(fresh),
        tuple(record.parameters),
        tuple(record.notes),
        result.seconds if result else float("nan"),
        result.evaluations_per_frame if result else 0,
        result.last_beta if result else float("nan"),
        corrections_of(fresh),
    )


def _send_addresses(send: Sequence[str]) -> tuple[SendAddress, ...] | None:
    return tuple(map(send_address, send)) or None


def live_words(run: LiveSummary) -> str:
    """How a live run went, as a sentence."""
    if not run.tracked:
        return "nothing was tracked."
    words = f"{len(run.tracked)} frames tracked, {run.frames_per_second:.1f} a second"
    if run.dropped:
        words += f"; {len(run.dropped)} dropped ({run.dropped_share:.1%}): {in_words(run.dropped)}"
    else:
        words += "; none dropped"
    if run.incomplete:
        words += f"; {len(run.incomplete)} sets of pictures incomplete: {in_words(run.incomplete)}"
    latency = " / ".join(f"{run.latency(share):.0f}" for share in (0.5, 0.95, 1.0))
    return f"{words}; picture to pose {latency} ms (median / 95 % / worst)"
