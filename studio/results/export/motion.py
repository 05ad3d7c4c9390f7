"""The motion that is exported: a track on an even grid of times, every frame filled, gaps known.

Formats that can say "missing" use `known`; those that cannot (BVH, GLB) get the poses in between: lengths linear,
angles linear along the shorter way round.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices, runs_of
from studio.foundations.errors import ExportError
from studio.results.export.options import ExportOptions
from studio.runs.tracks import Track, read_track
from studio.search.trackers.tracker import LOST, NO_EVIDENCE
from studio.sessions.stored_run import StoredRun

UNSEEN = (LOST, NO_EVIDENCE)
LATE = 1e-9
FAR_APART = math.pi / 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """K poses of a body at even times.

    fps : of the grid. frames : (K,) numbers in the footage, fractions between. times : (K,) seconds from the first.
    poses : (K, D) radians and mm, filled. known : (K,) False where the pose was made up. confidence : (K,), NaN
    unknown. states : K words, "" where the pose was made up. notes : sentences for readers of the file.
    """

    body: BodyModel
    fps: float
    frames: Array
    times: Array
    poses: Array
    known: NDArray[np.bool_]
    confidence: Array
    states: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def numbers(self) -> Indices | Array:
        """(K,) the frames' numbers, whole where all of them are."""
        whole = np.round(self.frames).astype(np.int64)
        return whole if np.array_equal(whole, self.frames) else self.frames

    @property
    def gaps(self) -> tuple[tuple[int, int], ...]:
        """Rows without a known pose, as half-open ranges."""
        return tuple(runs_of(~self.known))


def motion_of(run: StoredRun, options: ExportOptions) -> Motion:
    """A run's track as the options want it. Raises ExportError where no frame is left, NotFoundError."""
    return even_motion(run.body(), run.record.fps, read_track(run, options.track), options)


def no_motion(run: StoredRun) -> Motion:
    """No frame at all, for exports that are not of the motion."""
    body, none = run.body(), np.zeros(0)
    return Motion(
        body, run.record.fps, none, none, np.zeros((0, len(body.parameters))), none.astype(bool), none, ()
    )


def even_motion(body: BodyModel, fps: float, track: Track, options: ExportOptions) -> Motion:
    """A track cut, filled and brought to a frame rate."""
    last = options.last or int(track.frames[-1] + 1 if len(track.frames) else 0)
    chosen = (track.frames >= options.first) & (track.frames < last)
    if not chosen.any():
        had = f"{track.frames[0]} to {track.frames[-1]}" if len(track.frames) else "none"
        raise ExportError(
            f"Track '{track.name}' has no frame from {options.first} to {last - 1}; it has {had}.",
            "Choose frames that were tracked, or track further.",
        )
    filled = _fill(body, fps, track, np.flatnonzero(chosen), options.lost)
    wanted = options.fps or fps
    return filled if abs(wanted - fps) < LATE * fps else _at_rate(filled, wanted)


def _fill(body: BodyModel, fps: float, track: Track, rows: Indices, lost: str) -> Motion:
    """Every frame from the first to the last of the chosen rows. Lost frames that a smoother filled are poses."""
    first, count = int(track.frames[rows[0]]), int(track.frames[rows[-1]] - track.frames[rows[0]]) + 1
    states = [""] * count
    confidence = np.full(count, np.nan)
    poses, known = np.zeros((count, track.poses.shape[1])), np.zeros(count, dtype=bool)
    filled = set(track.made_by.get("filled", ()))
    for row in rows:
        at = int(track.frames[row]) - first
        states[at], confidence[at], poses[at] = track.states[row], track.confidence[row], track.poses[row]
        seen = track.states[row] not in UNSEEN or int(track.frames[row]) in filled
        known[at] = lost == "keep" or seen
    if not known.any():
        raise ExportError(
            f"The body is lost in every frame of track '{track.name}' that was chosen.",
            "Choose other frames, or keep the held poses (lost = keep).",
        )
    places = np.arange(count, dtype=np.float64)
    made, far = _between(body, places[known], poses[known], places[~known])
    poses[~known] = made
    notes = _gap_notes(int((~known).sum()), far)
    frames = first + places
    return Motion(body, fps, frames, places / fps, poses, known, confidence, tuple(states), notes)


def _at_rate(motion: Motion, fps: float) -> Motion:
    """The same motion at another frame rate; a pose is known where both its neighbours are."""
    length = float(motion.times[-1])
    count = math.floor(length * fps + 1e-6) + 1
    times = np.arange(count) / fps
    places = np.clip(times * motion.fps, 0.0, len(motion.times) - 1.0)
    places = np.where(np.abs(places - np.round(places)) < 1e-6, np.round(places), places)
    poses, far = _between(motion.body, np.arange(len(motion.times), dtype=np.float64), motion.poses, places)
    below, above = np.floor(places).astype(np.int64), np.ceil(places).astype(np.int64)
    known = motion.known[below] & motion.known[above]
    share = places - below
    confidence = (1.0 - share) * motion.confidence[below] + share * motion.confidence[above]
    confidence = np.where(below == above, motion.confidence[below], confidence)
    states = tuple(
        motion.states[low] if low == high or motion.states[low] == motion.states[high] else ""
        for low, high in zip(map(int, below), map(int, above), strict=True)
    )
    notes = (*motion.notes, f"Brought from {motion.fps:g} to {fps:g} frames a second by poses in between.")
    if far:
        notes = (*notes, _far_note(far))
    frames = motion.frames[0] + places
    return Motion(motion.body, fps, frames, times, poses, known, confidence, states, notes)


def _between(body: BodyModel, places: Array, poses: Array, wanted: Array) -> tuple[Array, int]:
    """Poses at wanted places, held at the ends; and how many lie between angles more than 90 degrees apart."""
    if not len(wanted):
        return np.zeros((0, poses.shape[1])), 0
    held = np.clip(wanted, places[0], places[-1])
    high = np.clip(np.searchsorted(places, held, side="left"), 1 if len(places) > 1 else 0, len(places) - 1)
    low = np.maximum(high - 1, 0)
    span = np.where(high > low, places[high] - places[low], 1.0)
    share = ((held - places[low]) / span)[:, None]
    angle = body.angles
    step = poses[high] - poses[low]
    step[:, angle] -= 2.0 * math.pi * np.round(step[:, angle] / (2.0 * math.pi))
    made = np.where(share >= 1.0, poses[high], poses[low] + share * step)
    inside = (share[:, 0] > 0.0) & (share[:, 0] < 1.0)
    far = inside & (np.abs(step[:, angle]).max(axis=1, initial=0.0) > FAR_APART)
    return made, int(far.sum())


def _gap_notes(missing: int, far: int) -> tuple[str, ...]:
    if not missing:
        return ()
    frames = "1 frame has no pose of its" if missing == 1 else f"{missing} frames have no pose of their"
    note = f"{frames} own (not tracked, or lost)."
    return (note, _far_note(far)) if far else (note,)


def _far_note(far: int) -> str:
    return f"{far} poses in between lie amid angles more than 90 degrees apart: look at them before use."
