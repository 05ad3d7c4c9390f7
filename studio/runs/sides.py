"""Corrects a finished run as a whole (`search.trackers.clip_mending`).

The tracked poses stay. If anything was corrected, the corrected poses are the track "sides", with the corrections in
its `made_by`; otherwise there is no such track, and a record of what was looked at (`LOOKED_AT`). A run is looked at
once: who comes while another process does it waits for what that one finds.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import msgspec
import numpy as np

from studio.body.model import BodyModel
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.runs.refined_frames import MaskSettings
from studio.runs.run_watch import FrameSource
from studio.runs.tracks import (
    FOLDER,
    RAW,
    SIDES,
    SOURCE,
    SOURCE_DIGEST,
    Track,
    best_track,
    drop_track,
    read_track,
    track_digest,
    write_track,
)
from studio.search.trackers.clip_mending import mended_clip
from studio.search.trackers.frame_refinement import descent, followed_along_lines
from studio.search.trackers.hidden_areas import without_hidden
from studio.search.trackers.loss_detection import Onlooker
from studio.search.trackers.refinement import Distances, mm_at
from studio.search.trackers.tracker import LIMB_LOST
from studio.sessions.atomic_files import writing
from studio.sessions.process_lock import alone
from studio.sessions.record_files import RecordFile
from studio.sessions.stored_run import StoredRun

BORDER_POINTS = 150
EXCHANGED = "exchanged"
"""Entry of `made_by`: the corrections, a line each."""
LOOKED_AT, LOCK = "looked-at.json", "looking.lock"
"""Files beside a run's tracks."""
WAITING = "waiting for the look over the whole clip that is under way"
"""The step."""
SCHEMA_VERSION = 1


class _LookedAt(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A run in which nothing had to be corrected. digest : of its raw track (`track_digest`), "" for none."""

    schema: int = SCHEMA_VERSION
    digest: str = ""


_LOOKED_AT = RecordFile(
    _LookedAt,
    "the record of a run that was looked at as a whole",
    "Delete the file: the run is looked at again.",
    ("Run '{name}' was not looked at as a whole.", "'studio refine' does it."),
)


def correct_clip(
    run: StoredRun,
    problems: FrameSource,
    read: Callable[[int], None] = lambda frame: None,
    progress: Progress = no_progress,
) -> tuple[str, ...]:
    """Look at a run as a whole and store the track "sides" if anything is corrected; returns the corrections.

    Live runs and runs that play their footage back and forth are skipped. What was found before and is up to date
    stays. read : called with each frame read; progress : with the step at hand. The exception of either ends the work.
    Raises the errors of reading the footage.
    """
    if not can_be_looked_at(run):
        return ()
    folder = run.folder / FOLDER
    with writing("The track", folder):
        folder.mkdir(exist_ok=True)
    with alone(folder / LOCK, lambda: progress(WAITING, 0, 0)):
        if known := corrections_of(run):
            return known
        track = read_track(run, RAW)
        looked_at = _LookedAt(digest=track_digest(track))
        place = folder / LOOKED_AT
        if _LOOKED_AT.read(place, _LookedAt()) == looked_at:
            return ()
        words = _corrected(run, track, problems, read, progress)
        if not words:
            drop_track(run, SIDES)
            _LOOKED_AT.write(place, looked_at)
        return words


def _corrected(
    run: StoredRun, track: Track, problems: FrameSource, read: Callable[[int], None], progress: Progress
) -> tuple[str, ...]:
    """The corrections of a run whose raw track it is, in words; if there are any, they are stored."""
    settings = MaskSettings(run)
    evidence = partial(_look_at, problems, settings, read)
    refinement = settings.of(run.record.first).refinement
    how, kept = descent(refinement), followed_along_lines(problems.body, refinement)
    body, cameras, poses = problems.body, problems.cameras, dict(zip(track.frames, track.poses, strict=True))
    with run.results() as results:

        def silhouettes_of(frame: int) -> Mapping[str, Distances]:
            memory = results.result(frame).carried.memory
            return known_silhouettes(body, cameras, evidence(frame), poses[frame], memory)

        named = [
            results.result(int(frame)).limbs_lost if state == LIMB_LOST else ()
            for frame, state in zip(track.frames, track.states, strict=True)
        ]
        fps = run.record.fps
        corrected, words = mended_clip(
            body, cameras, track.frames, track.poses, named, fps, silhouettes_of, how, progress, kept
        )
    if not words:
        return ()
    changed = np.flatnonzero((corrected != track.poses).any(axis=1))
    confidence, onlooker = track.confidence.copy(), Onlooker(body, cameras)
    for row in changed.tolist():
        confidence[row] = onlooker.sight(evidence(int(track.frames[row])), corrected[row]).overlap
    made_by = {"verb": SIDES, SOURCE: RAW, SOURCE_DIGEST: track_digest(track), EXCHANGED: words}
    write_track(run, Track(SIDES, track.frames, corrected, confidence, track.states, made_by), replace=True)
    return words


def known_silhouettes(
    body: BodyModel,
    cameras: Sequence[Camera],
    evidence: FrameEvidence,
    pose: Array,
    memory: Mapping[str, Array],
) -> Mapping[str, Distances]:
    """A frame's silhouettes by camera, without known occlusions. pose (D,), memory : of the frame."""
    seen = silhouettes_by_camera(evidence, BORDER_POINTS)
    own = [camera for camera in cameras if camera.name in seen]
    shown = without_hidden([seen[camera.name] for camera in own], own, mm_at(body, own, pose), memory)
    return {camera.name: view for camera, view in zip(own, shown, strict=True)}


def can_be_looked_at(run: StoredRun) -> bool:
    """Whether the run's frames are those of its footage in order."""
    return not (run.record.live or run.record.ping_pong)


def corrections_of(run: StoredRun) -> tuple[str, ...]:
    """What the run's track "sides" corrects; nothing without one or if the run has changed since."""
    if best_track(run, (SIDES,)).name != SIDES:
        return ()
    return tuple(read_track(run, SIDES).made_by.get(EXCHANGED, ()))


def notes_of(run: StoredRun) -> tuple[str, ...]:
    """The run's notes, with the corrections."""
    words = corrections_of(run)
    return (*run.record.notes, *([in_words(words)] if words else []))


def in_words(words: tuple[str, ...]) -> str:
    return f"Corrected over the whole clip, in track '{SIDES}': {'; '.join(words)}. The tracked poses stay in '{RAW}'."


def _look_at(
    problems: FrameSource, settings: MaskSettings, read: Callable[[int], None], frame: int
) -> FrameEvidence:
    read(frame)
    return problems.evidence(frame, settings.of(frame))
