"""Live cameras: a reader each, their newest pictures and states, and the sets that they form.

The caller of `LiveCamera.run` provides the reader's thread. A stream that breaks is opened again after a while
that grows; one that gives nothing for long enough counts as stopped, and the others continue without it.

Cameras take their pictures at any time; those nearest to the newest picture of the camera that is behind are paired.
So pictures of one set are at most half a frame apart unless a camera lags or loses pictures, which is reported.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from studio.footage.capture.camera_addresses import CameraAddress
from studio.footage.capture.camera_streams import Shot, Wait, open_stream
from studio.foundations.arrays import Array
from studio.foundations.errors import FootageError

APART = 0.5
"""Pictures further apart than this share of a frame's duration are reported."""


@dataclass(frozen=True, slots=True, eq=False)
class PictureSet:
    """One picture of every camera that runs, all of one moment as nearly as can be.

    shots : by camera. left_out : cameras that give no pictures now. spread : seconds between the first and the last
    picture. lagging : the camera that is furthest from the others where that is more than half a frame, else "".
    """

    shots: Mapping[str, Shot]
    left_out: tuple[str, ...]
    spread: float
    lagging: str

    @property
    def moment(self) -> float:
        """The middle of its pictures' times, seconds."""
        times = [shot.came for shot in self.shots.values()]
        return 0.5 * (min(times) + max(times))


@dataclass(frozen=True, slots=True)
class SpreadFigures:
    """Spreads of many sets, milliseconds: median, 95 % of them, worst; apart : how many lay more than half a frame
    apart, of how many; lagging : the camera that was behind most often, "" if none.
    """

    median: float
    most: float
    worst: float
    apart: int
    sets: int
    lagging: str

    @property
    def in_words(self) -> str:
        """As a person reads it."""
        if not self.sets:
            return "no complete set of pictures arrived"
        words = f"pictures {self.median:.1f} ms apart (95 %: {self.most:.1f}, worst {self.worst:.1f})"
        if self.apart:
            late = f"; camera {self.lagging} lags" if self.lagging else ""
            words += f"; {self.apart} of {self.sets} sets more than half a frame apart{late}"
        return words


def paired(
    recent: Mapping[str, Sequence[Shot]], left_out: Sequence[str], frame_seconds: float, after: float
) -> PictureSet | None:
    """The newest complete set, None where a camera has no picture above the moment `after`.

    recent : the last pictures of the cameras that run, oldest first. frame_seconds : a frame's duration.
    """
    newer = {name: [shot for shot in shots if shot.came > after] for name, shots in recent.items()}
    if not newer or not all(newer.values()):
        return None
    moment = min(shots[-1].came for shots in newer.values())
    chosen = {name: min(shots, key=lambda shot: abs(shot.came - moment)) for name, shots in newer.items()}
    times = {name: shot.came for name, shot in chosen.items()}
    spread = max(times.values()) - min(times.values())
    lagging = furthest(times) if spread > APART * frame_seconds else ""
    return PictureSet(chosen, tuple(left_out), spread, lagging)


def furthest(times: Mapping[str, float]) -> str:
    """The camera whose picture lies furthest from the middle one of all; of two the later."""
    middle = float(np.median(list(times.values())))
    return max(times, key=lambda name: (abs(times[name] - middle), times[name]))


def spread_figures(spreads: Array, lagging: Sequence[str]) -> SpreadFigures:
    """Figures of sets with these spreads (K,), seconds, and the lagging camera of each ("" where none lags)."""
    late = [name for name in lagging if name]
    worst = max(sorted(set(late)), key=late.count, default="")
    if not len(spreads):
        return SpreadFigures(float("nan"), float("nan"), float("nan"), 0, 0, "")
    median, most, largest = (1e3 * float(np.quantile(spreads, share)) for share in (0.5, 0.95, 1.0))
    return SpreadFigures(median, most, largest, len(late), len(spreads), worst)


State = Literal["connecting", "running", "stopped", "ended"]

KEPT_SHOTS = 8
"""Pictures kept of each camera, to pair."""
RATED = 90
"""Pictures that a camera's rate is measured by."""
SILENCE_SECONDS = 1.0
"""A camera that gave no picture for so long has stopped."""
BEHIND_SECONDS = 0.25
"""Sets do not wait longer than this for a camera, which is left out until its next picture."""
FIRST_WAIT, LONGEST_WAIT = 0.25, 8.0
"""Seconds before a broken stream is opened again: the first time, and at most; twice as long each time."""
USUAL_RATE = 30.0
LAST_SPREADS = 300
NEXT_BY = 1.25
"""A picture's successor should be there after so many frames' durations."""

# Called in a reader's thread with every picture that comes.
Listener = Callable[[str, Shot], None]
Open = Callable[[CameraAddress, Wait], Iterator[Shot]]


@dataclass(frozen=True, slots=True)
class CameraStanding:
    """A camera at this moment. state : "connecting" (no picture yet), "running", "stopped" (it ran, now nothing comes),
    "ended" (a replayed video is over). seconds : for how long. age : of its last picture, seconds, None before
    the first. fps : as measured. pictures : that came. width, height : pixels, 0 before the first. message : the
    error. attempts : failed ones since it last ran.
    """

    name: str
    shown: str
    state: State
    seconds: float
    age: float | None
    fps: float
    pictures: int
    width: int
    height: int
    message: str
    attempts: int

    @property
    def in_words(self) -> str:
        """The text of a status line."""
        if self.state == "running":
            return f"{self.name}: {self.fps:.1f} fps"
        words = f"{self.name}: {self.state} for {self.seconds:.1f} s"
        return f"{words}, last picture {self.age:.1f} s old" if self.age is not None else words


class LiveCamera:
    """One camera. `run` in a thread of its own until `stop`; all else from any thread."""

    def __init__(
        self,
        address: CameraAddress,
        *,
        clock: Callable[[], float] = time.monotonic,
        open_camera: Open | None = None,
        silence: float = SILENCE_SECONDS,
    ) -> None:
        self.address, self._clock, self._silence = address, clock, silence
        self._released = threading.Event()
        self._open: Open = open_camera or partial(open_stream, clock=clock, released=self._released.is_set)
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._recent: deque[Shot] = deque(maxlen=KEPT_SHOTS)
        self._times: deque[float] = deque(maxlen=RATED)
        self._listeners: list[Listener] = []
        self._began = clock()
        self._count = self._attempts = 0
        self._message, self._over = "", False

    @property
    def name(self) -> str:
        return self.address.name

    def run(self) -> None:
        """Read until stopped, reopening the stream when it breaks. Never raises."""
        delay = FIRST_WAIT
        while not self._stopping.is_set():
            before = self._count
            try:
                for shot in self._open(self.address, self._stopping.wait):
                    if self._stopping.is_set():
                        return
                    self._take(shot)
                ended = "its video is over" if self.address.kind == "replay" else "ended its stream"
                problem_text = f"Camera {self.name} ({self.address.shown}): {ended}."
            except FootageError as problem:
                problem_text = problem.message
            except Exception as problem:  # a foreign stream must not end the reader through a library's error
                problem_text = f"Camera {self.name} cannot be read ({type(problem).__name__})."
            delay = FIRST_WAIT if self._count > before else min(2.0 * delay, LONGEST_WAIT)
            with self._lock:
                self._message, self._attempts = problem_text, self._attempts + 1
                self._over = self.address.kind == "replay" and self._count > before
            if self._over or self._stopping.wait(delay):
                return

    def stop(self) -> None:
        self._stopping.set()

    def release(self) -> None:
        """Let a replayed video continue from its first picture; has no effect on cameras."""
        self._released.set()

    def listen(self, listener: Listener) -> None:
        """Hear of every picture, in the reader's thread."""
        with self._lock:
            self._listeners = [*self._listeners, listener]

    def forget(self, listener: Listener) -> None:
        """Hear of no further pictures."""
        with self._lock:
            self._listeners = [entry for entry in self._listeners if entry is not listener]

    @property
    def newest(self) -> Shot | None:
        """The last picture that came."""
        with self._lock:
            return self._recent[-1] if self._recent else None

    @property
    def recent(self) -> tuple[Shot, ...]:
        """The last pictures, oldest first."""
        with self._lock:
            return tuple(self._recent)

    @property
    def standing(self) -> CameraStanding:
        with self._lock:
            now, last = self._clock(), self._recent[-1] if self._recent else None
            age = now - last.came if last else 0.0
            state: State = "running"
            if self._over:
                state = "ended"
            elif last is None:
                state = "connecting"
            elif age > self._silence:
                state = "stopped"
            seconds = now - self._began if state in ("connecting", "running") else age
            height, width = last.pixels.shape[:2] if last else (0, 0)
            message = "" if state == "running" else self._message
            if state == "stopped" and not message:
                message = f"Camera {self.name} gave no picture for {age:.1f} s."
            return CameraStanding(
                self.name, self.address.shown, state, seconds, age if last else None, self._rate(), self._count,
                width, height, message, 0 if state == "running" else self._attempts,
            )  # fmt: skip

    def _rate(self) -> float:
        """Pictures a second; the median gap, so that a pause does not count."""
        gaps = np.diff(np.array(self._times))
        if not len(gaps):
            return 0.0
        # Bursts of a network: what came in all over the whole time, unless there was a pause in it.
        steady = gaps[gaps < self._silence]
        return len(steady) / max(float(steady.sum()), 1e-6) if len(steady) else 0.0

    def _take(self, shot: Shot) -> None:
        with self._lock:
            if not self._recent or shot.came - self._recent[-1].came > self._silence:
                self._began = shot.came
            self._recent.append(shot)
            self._times.append(shot.came)
            self._count += 1
            self._attempts, self._message = 0, ""
            listeners = self._listeners
        for listener in listeners:
            listener(self.name, shot)


class LiveCameras:
    """Several cameras and the sets that they make. clock : seconds, the same as the cameras'."""

    def __init__(self, cameras: tuple[LiveCamera, ...], clock: Callable[[], float] = time.monotonic) -> None:
        self.cameras, self._clock = cameras, clock
        self.names = tuple(camera.name for camera in cameras)
        self._changed = threading.Condition()
        self._spreads: deque[tuple[float, str]] = deque(maxlen=LAST_SPREADS)
        for camera in cameras:
            camera.listen(self._take_shot)

    def start(self, start: Callable[[Callable[[], None], str], None]) -> None:
        """Start every camera's reader. start : makes a thread of a function and a name."""
        for camera in self.cameras:
            start(camera.run, f"camera-{camera.name}")

    def stop(self) -> None:
        for camera in self.cameras:
            camera.stop()
        with self._changed:
            self._changed.notify_all()

    @property
    def standings(self) -> tuple[CameraStanding, ...]:
        return tuple(camera.standing for camera in self.cameras)

    @property
    def spreads(self) -> SpreadFigures:
        """Of the last sets that were taken."""
        taken = tuple(self._spreads)
        return spread_figures(np.array([spread for spread, _ in taken]), [name for _, name in taken])

    @property
    def fps(self) -> float:
        """The rate of the slowest camera that runs: more complete sets a second there cannot be."""
        rates = [one.fps for one in self.standings if one.state == "running" and one.fps > 0.0]
        return min(rates, default=USUAL_RATE)

    def newest_set(self, after: float, fps: float = 0.0) -> PictureSet | None:
        """The newest complete set whose pictures all came after a moment; cameras that have stopped or hang are left
        out.

        fps : of the sets; 0: as measured. None where a camera that runs (or never ran yet) has no such picture, and
        where nearer ones may still come.
        """
        left_out = tuple(
            one.name
            for one in self.standings
            if one.state in ("stopped", "ended")
            or (one.state == "running" and (one.age or 0.0) > BEHIND_SECONDS)
        )
        recent = {camera.name: camera.recent for camera in self.cameras if camera.name not in left_out}
        frame_seconds = 1.0 / (fps or self.fps)
        newest = paired(recent, left_out, frame_seconds, after)
        if newest is None:
            return None
        first = min(shot.came for shot in newest.shots.values())
        if newest.lagging and self._clock() - first < NEXT_BY * frame_seconds:
            # The next picture of the camera that was first may lie nearer.
            return None
        self._spreads.append((newest.spread, newest.lagging))
        return newest

    def wait(self, seconds: float) -> None:
        """Return when a picture comes, or after so many seconds."""
        with self._changed:
            self._changed.wait(seconds)

    def _take_shot(self, name: str, shot: Shot) -> None:
        with self._changed:
            self._changed.notify_all()
