"""What a run holds: poses and markers as arrays, and errors against the truth."""

from pathlib import Path

import numpy as np

from studio.body.forward_kinematics import marker_points
from studio.errors import TruthError
from studio.evaluation.errors import Evaluation
from studio.evaluation.errors import evaluate as evaluate_poses
from studio.motion_files.trc import MarkerMotion, read_trc
from studio.notebook.opening import RunName, open_run, session_of
from studio.runs.tracks import BEST, Track, track_names
from studio.runs.tracks import read_track as read_stored_track


def list_tracks(run: RunName) -> tuple[str, ...]:
    """Names of a run's tracks: "raw" is what the search found, the others were made of it."""
    return track_names(open_run(run))


def read_track(run: RunName, track: str = BEST) -> Track:
    """A track as arrays: name, frames (K,), poses (K, D) rad and mm, confidence (K,), states. track : default the best
    (smoothed, refined, raw). Raises NotFoundError.
    """
    return read_stored_track(open_run(run), track)


def markers(run: RunName, track: str = BEST) -> MarkerMotion:
    """The body's markers along a track: names (M), times (K,) s, positions (K, M, 3) mm, z up."""
    stored = open_run(run)
    body, chosen = stored.body(), read_stored_track(stored, track)
    return MarkerMotion(
        tuple(marker.name for marker in body.markers),
        np.asarray(chosen.frames / stored.record.fps),
        marker_points(body, chosen.poses),
        "mm",
        stored.record.fps,
    )


def evaluate(run: RunName, *, truth: str | Path | None = None, track: str = BEST) -> Evaluation:
    """Distances from the true markers, mm. truth : a TRC; default the session's own. track : default the best. Raises
    TruthError.
    """
    stored = open_run(run)
    opened = session_of(stored)
    path = Path(truth) if truth is not None else opened.truth_path
    if path is None:
        raise TruthError(f"Session '{opened.name}' has no truth.", "Give one with --truth FILE.trc.")
    chosen = read_stored_track(stored, track)
    return evaluate_poses(chosen.poses, chosen.frames, stored.body(), read_trc(path), stored.record.fps)
