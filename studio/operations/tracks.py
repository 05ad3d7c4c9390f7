"""The tracks of a run as pages show them: their jitter, their errors, and how well they fit the pictures."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from studio.foundations.knobs import changed
from studio.foundations.progress import Progress, no_progress
from studio.operations.exports import keep_file, kept_file
from studio.operations.opening import session_of
from studio.operations.person import landmarks
from studio.operations.results import evaluate
from studio.operations.run_errors import measure_or_say_why
from studio.runs.checking import RunCheck, kept_check
from studio.runs.jumps import Jump
from studio.runs.refining import REFINED, check_making, jitter
from studio.runs.tracks import BEST, RAW, best_track, read_track, track_names, track_stamp
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.smoothing import SmoothingSettings
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

LANDMARKS = "landmarks"
"""Stem of the file with a network's joints among a run's exports."""


@dataclass(frozen=True, slots=True)
class TrackLine:
    """A track of a run.

    made_by : verb, source, settings, and of a smoothed one the frames that were filled and left out; empty for raw.
    jitter_mm : root mean square second difference of the markers.
    mean_mm, worst_mm : against the session's truth. measured_frames : in how many frames.
    mean_angle_deg, mean_direction_deg : the same, of the angles between limbs and of the limbs' directions.
    """

    name: str
    frames: int
    made_by: dict[str, object] = field(default_factory=dict[str, object])
    jitter_mm: float | None = None
    mean_mm: float | None = None
    mean_angle_deg: float | None = None
    mean_direction_deg: float | None = None
    worst_mm: float | None = None
    measured_frames: int = 0


@dataclass(frozen=True, slots=True)
class LandmarksLine:
    """A track against a network's joints.

    file : of the run's exports, with the joints.
    seen : share of the frames with all of them.
    mean_mm : from them.
    without_offsets_mm : the same without each joint's constant offset.
    """

    file: str
    seen: float
    mean_mm: float
    without_offsets_mm: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckLine:
    """How well a track fits the pictures.

    inside : per checked frame and camera, the share of the model's pixels that lie in the mask.
    covered : of the mask's, under the model.
    poor : frames whose views have too little of it inside.
    turned : sudden turns.
    lost_limbs : limbs that the masks contradict in more than one of the frames, with these.
    """

    cameras: tuple[str, ...]
    frames: tuple[int, ...]
    inside: tuple[tuple[float | None, ...], ...]
    covered: tuple[tuple[float | None, ...], ...]
    poor: tuple[int, ...]
    lost: tuple[int, ...]
    doubtful: tuple[int, ...]
    turned: tuple[int, ...]
    jitter_mm: float
    jumps: tuple[Jump, ...] = ()
    lost_limbs: dict[str, tuple[int, ...]] = field(default_factory=dict[str, tuple[int, ...]])
    inside_mean: float
    good: bool
    words: str


@dataclass(frozen=True, slots=True)
class CheckAnswer:
    """The check of a track.

    track : the one that was requested.
    usual : the best, which is exported unless another is chosen.
    check : null before.
    note : on better tracks that are out of date.
    """

    track: str
    usual: str
    check: CheckLine | None
    note: str = ""


def track_lines(session: Session, run: StoredRun) -> tuple[tuple[TrackLine, ...], str]:
    """The run's tracks with how much they jitter and, where there is a truth, how far off they are; and why the truth
    cannot be used, "" if it can.
    """
    lines, problems = list[TrackLine](), list[str]()
    for name in track_names(run):
        line, problem = _line(session, run, name)
        lines.append(line)
        problems += [problem] if problem else []
    return tuple(lines), problems[0] if problems else ""


def _line(session: Session, run: StoredRun, name: str) -> tuple[TrackLine, str]:
    track = read_track(run, name, blobs=False)
    if not len(track.frames):
        return TrackLine(name, 0, dict(track.made_by)), ""
    errors, problem = measure_or_say_why(session, run, name, blobs=False)
    line = TrackLine(
        name=name,
        frames=len(track.frames),
        made_by=dict(track.made_by),
        jitter_mm=jitter(run, track),
        mean_mm=errors and errors.mean_mm,
        mean_angle_deg=errors and errors.mean_angle_deg,
        mean_direction_deg=errors and errors.mean_direction_deg,
        worst_mm=errors and errors.worst_mm,
        measured_frames=len(errors.frames) if errors else 0,
    )
    return line, problem


def shown_track(run: StoredRun, track: str) -> tuple[str, int]:
    """The track to show when `track` is requested (raw if it does not exist), and a number that a new one changes."""
    if track == RAW or track not in track_names(run):
        return RAW, 0
    return track, track_stamp(run, track)


def check_derived(
    run: StoredRun,
    usual: str,
    *,
    source: str = "",
    into: str = "",
    replace: bool = False,
    knobs: Mapping[str, object] | None = None,
) -> None:
    """Raise the errors of refining or smoothing, before it is begun. usual : the name of the track, REFINED or
    SMOOTHED.

    Raises RunError, SessionError, SettingsError.
    """
    changed(RefinementSettings() if usual == REFINED else SmoothingSettings(), knobs or {})
    check_making(run, source, into or usual, replace)


def track_check(run: StoredRun, track: str = "") -> CheckAnswer:
    """The last check of a track as it is now (empty: the best). Raises NotFoundError."""
    best = best_track(run)
    name = best.name if track in ("", BEST) else track
    read_track(run, name)
    check = kept_check(run, name)
    return CheckAnswer(name, best.name, check and _check_line(check), best.note)


def _check_line(check: RunCheck) -> CheckLine:
    own: dict[str, Any] = {"jumps": check.jumps or (), "words": check.in_words()}
    return CheckLine(
        **{
            one.name: own[one.name] if one.name in own else getattr(check, one.name)
            for one in fields(CheckLine)
        }
    )


def measure_by_landmarks(run: StoredRun, track: str, *, progress: Progress = no_progress) -> LandmarksLine:
    """Measure a track against the joints that a network sees of a person, which are kept among the run's exports.

    Raises as `landmarks` and `evaluate`.
    """
    session, seen = session_of(run), 0.0

    def write(place: Path) -> int:
        nonlocal seen
        made = landmarks(session, place, progress=progress)
        seen = made.seen
        return len(made.motion.times)

    kept = keep_file(run, LANDMARKS, "trc", session.manifest.fps, write, "A network's joints")
    errors = evaluate(run, truth=kept_file(run, kept.file), track=track, progress=no_progress)
    return LandmarksLine(kept.file, seen, errors.mean_mm, errors.without_offsets_mm)
