"""A session and one of its runs, opened for display: the source of everything that the scene draws."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from cachetools import LRUCache
from numpy.typing import NDArray

from studio.app.scene.model import LiveSearch
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, read_trc
from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import NotFoundError, SessionError, StudioError
from studio.foundations.geometry.camera import Camera
from studio.operations.results import list_tracks, read_track
from studio.operations.stored_frames import tracking_of
from studio.operations.tracks import shown_track
from studio.runs.moved_knobs import settings_with_moved
from studio.runs.tracks import RAW, Track
from studio.search.settings import RunSettings, default_settings
from studio.search.trackers.tracker import FrameResult, LayerRecord
from studio.sessions.results_store import ResultsReader
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

_KEPT_FRAMES = 8


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The content of the scene at a frame (None while there is none).

    pose : (D,) drawn as the body.
    beside : (D,) the stored result while a re-annealed one, or another track's, is shown.
    records : the layers whose clouds are drawn.
    layer_count : how many layers the frame takes.
    truth : (M, 3) mm.
    tracking : the tracking state of a stored frame, "" unknown.
    edited : whether the pose is being edited and is no result.
    """

    frame: int | None
    pose: Array | None
    beside: Array | None
    records: Sequence[LayerRecord]
    layer_count: int
    truth: Array | None
    tracking: str = ""
    edited: bool = False


class OpenedRun:
    """run : None shows the session alone (cameras, pictures, start pose, truth). Used by one thread at a time."""

    def __init__(self, session: Session, run: StoredRun | None) -> None:
        self.session = session
        self.run = run
        self.body: BodyModel = run.body() if run else session.body()
        self.cameras: tuple[Camera, ...] = session.cameras()
        self.fps: float = session.manifest.footage.fps
        self.results: ResultsReader | None = run.results() if run else None
        self.truth, self.truth_problem = _truth_of(session)
        self._results: LRUCache[int, FrameResult] = LRUCache(_KEPT_FRAMES)
        self._layers: LRUCache[int, list[LayerRecord]] = LRUCache(_KEPT_FRAMES)
        self._track: tuple[tuple[str, int], Track | None] = (RAW, 0), None

    @property
    def span(self) -> tuple[int, int]:
        """The frames to show, half open: the run's, else the footage's."""
        if self.run is not None:
            return self.run.record.first, self.run.record.last
        return 0, self.session.manifest.footage.frame_count

    def frames(self) -> list[int]:
        """The finished frames, ascending; what is not known to be damaged yet counts as intact."""
        return self.results.frames(blobs=False) if self.results else []

    def damaged_frames(self) -> set[int]:
        """The finished frames that are damaged, after all that is stored was read; from any thread."""
        if self.run is None:
            return set()
        with self.run.results() as results:
            return set(results.damaged())

    def result(self, frame: int) -> FrameResult | None:
        """The stored result of a frame, None while there is none."""
        if frame not in self._results:
            if self.results is None:
                return None
            try:
                self._results[frame] = self.results.result(frame)
            except NotFoundError:
                return None
        return self._results[frame]

    def layers(self, frame: int) -> list[LayerRecord]:
        """The stored layers of a frame; those of an unfinished frame are read again each time."""
        if frame in self._layers:
            return self._layers[frame]
        if self.results is None:
            return []
        try:
            layers = self.results.layers(frame)
        except NotFoundError:
            return []
        if self.result(frame) is not None:
            self._layers[frame] = layers
        return layers

    def forget_from(self, frame: int) -> None:
        """Forget a frame and all later ones, so that they are read again."""
        for kept in (self._results, self._layers):
            for known in [one for one in kept if one >= frame]:
                del kept[known]

    def poses(self, track: str, between: tuple[int, int]) -> tuple[NDArray[np.int64], Array]:
        """The frames (K,) of a track from the first to the last of `between` and their poses (K, D); the search's own
        where there is no such track.
        """
        if self.results is None:
            return np.zeros(0, dtype=np.int64), np.zeros((0, len(self.body.parameters)))
        derived = self._read_track(track)
        if derived is None:
            return self.results.poses(between, blobs=False)
        first, after = np.searchsorted(derived.frames, (between[0], between[1] + 1))
        return derived.frames[first:after], derived.poses[first:after]

    def tracks(self) -> tuple[str, ...]:
        """The run's tracks, raw first."""
        return (RAW,) if self.run is None else list_tracks(self.run)

    def track_key(self, track: str) -> tuple[str, int]:
        """The track shown when `track` is requested, and a number that changes when it is made again."""
        return (RAW, 0) if self.run is None else shown_track(self.run, track)

    def pose_in(self, track: str, frame: int) -> Array | None:
        """(D,) the pose of a derived track at a frame; None in a gap of it, or where there is no such track."""
        derived = self._read_track(track)
        if derived is None:
            return None
        row = int(np.searchsorted(derived.frames, frame))
        return derived.poses[row] if row < len(derived.frames) and derived.frames[row] == frame else None

    def _read_track(self, track: str) -> Track | None:
        """A derived track, read again when it was made again; None where there is none or it cannot be read."""
        key = self.track_key(track)
        if self.run is None or key[0] == RAW:
            return None
        if self._track[0] != key:
            try:
                self._track = key, read_track(self.run, track)
            except SessionError:
                self._track = key, None
        return self._track[1]

    def truth_at(self, frame: int) -> Array | None:
        """(M, 3) mm: the truth's markers at a frame (rows by time × fps, the first row being frame 0), else None."""
        if self.truth is None:
            return None
        rows = self._truth_rows
        place = int(np.searchsorted(rows, frame))
        return self.truth.positions[place] if place < len(rows) and rows[place] == frame else None

    @cached_property
    def _truth_rows(self) -> Indices:
        """(K,) the frame of each row of the truth."""
        assert self.truth is not None
        return np.round(self.truth.times * self.fps).astype(np.int64)

    def start_pose(self) -> Array:
        """(D,) where the search starts: the run's own start, the session's, else the body's rest pose."""
        if self.run is not None and self.run.record.start_pose is not None:
            return np.array(self.run.record.start_pose)
        stored = self.session.start_pose(self.body)
        return self.body.neutral if stored is None else stored

    def settings(self) -> RunSettings:
        """The settings that the run continues with, else the defaults."""
        return default_settings() if self.run is None else settings_with_moved(self.run)

    def moment(
        self,
        frame: int | None,
        live: LiveSearch,
        *,
        edited: Array | None = None,
        layers: int = 0,
        track: str = RAW,
    ) -> Moment:
        """The moment at `frame`: stored, in progress, annealed again, or a pose being edited.

        live : used if it is of this frame. edited : (D,) shown instead of a result. layers : number of a frame with
        the settings in use. track : whose poses are shown of stored frames, where it has one.
        """
        truth = None if frame is None else self.truth_at(frame)
        if edited is not None:
            return Moment(frame, edited, None, (), 0, truth, edited=True)
        if frame is None:
            return Moment(None, self.start_pose(), None, (), layers, None)
        if frame == live.frame and live.is_whole and not live.reannealed:
            return Moment(
                frame, live.pose, None, live.records, len(live.records), truth
            )  # it need not be read
        stored = self.result(frame)
        if frame == live.frame and (live.reannealed or stored is None):
            beside = stored.estimate.pose if stored is not None else None
            count = live.result.layers if live.result is not None else layers
            return Moment(frame, live.pose, beside, live.records, _at_least(count, live.records), truth)
        records = self.layers(frame)
        if stored is None:
            pose = records[-1].mean if records else self.start_pose()
            return Moment(frame, pose, None, records, _at_least(layers, records), truth)
        pose, made = stored.estimate.pose, self.pose_in(track, frame)
        count = _at_least(stored.layers, records)
        if made is None:
            return Moment(frame, pose, None, records, count, truth, tracking_of(stored))
        return Moment(frame, made, pose, records, count, truth, tracking_of(stored))

    def close(self) -> None:
        if self.results is not None:
            self.results.close()


def _truth_of(session: Session) -> tuple[MarkerMotion | None, str]:
    """The session's truth, or the reason why it cannot be shown."""
    path = session.truth_path
    if path is None:
        return None, ""
    try:
        return read_trc(path), ""
    except StudioError as problem:
        return None, str(problem)


def _at_least(count: int, records: Sequence[LayerRecord]) -> int:
    return max(count, *(record.layer + 1 for record in records)) if records else count
