"""The thread that draws: it hears the search's events, keeps the clock of playback, and redraws what has
changed.

Everything that touches the scene's handles happens here, so nothing is locked; the page and viser's
callbacks only post what they wish. Redraws are held to 30 a second and pictures to 10; whatever comes in
between, the newest wins.
"""

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable

from studio.errors import StudioError
from studio.worker.events import Event
from studio.worker.watchers import Subscription

REDRAW_SECONDS = 1.0 / 30.0
PICTURE_SECONDS, LIVE_PICTURE_SECONDS = 1.0 / 10.0, 1.0 / 2.0
"""Composing pictures costs a third of a core at ten times a second: a live run needs that itself."""
_LOG = logging.getLogger(__name__)
_WAKE = Event("", "")


class Presenter:
    """events : the subscription that is read. heard, tick, draw, draw_pictures : called in the thread, see
    `_Work`.
    """

    def __init__(
        self,
        events: Subscription,
        *,
        heard: Callable[[Event], None],
        tick: Callable[[float], bool],
        draw: Callable[[], None],
        draw_pictures: Callable[[], None],
        failed: Callable[[StudioError], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """heard : takes an event. tick : lets seconds go by, says whether something moves by itself. draw,
        draw_pictures : bring the scene up to date. failed : tells the person. clock : seconds, rising."""
        self._events = events
        self._heard, self._tick, self._failed, self._clock = heard, tick, failed, clock
        self._drawings = (_Due(draw, REDRAW_SECONDS), _Due(draw_pictures, PICTURE_SECONDS))
        self._posts: deque[Callable[[], None]] = deque()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._present, name="scene-presenter", daemon=True)

    def start(self) -> None:
        """Begin drawing."""
        self._thread.start()

    def stop(self) -> None:
        """Take no more events and end the thread; returns when it has ended."""
        self._stopping.set()
        self._events.close()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join(timeout=10.0)

    def post(self, action: Callable[[], None]) -> None:
        """Do something in the drawing thread soon, then redraw. Thread-safe; returns at once."""
        self._posts.append(action)
        self._events.put(_WAKE)

    def yield_to_live(self, tracking: bool) -> None:
        """Hang pictures less often while a live run is tracked (in the drawing thread)."""
        self._drawings[1].pause = LIVE_PICTURE_SECONDS if tracking else PICTURE_SECONDS

    def redraw(self, *, pictures: bool = True) -> None:
        """Ask for a redraw (in the drawing thread)."""
        self._drawings[0].wanted = True
        self._drawings[1].wanted = self._drawings[1].wanted or pictures

    def _present(self) -> None:
        before = self._clock()
        moving = False
        while not self._stopping.is_set():
            self._listen(self._patience(moving))
            while self._posts:
                self._guarded(self._posts.popleft())
            now = self._clock()
            moving = bool(self._guarded(lambda span=now - before: self._tick(span)))
            before = now
            for drawing in self._drawings:
                if drawing.due(now):
                    drawing.done(now)
                    self._guarded(drawing.draw)

    def _patience(self, moving: bool) -> float:
        """How long to wait for events: until the next redraw that is due, or until something happens."""
        now = self._clock()
        waits = [drawing.waits(now) for drawing in self._drawings if drawing.wanted]
        return min(waits, default=REDRAW_SECONDS if moving else 0.5)

    def _listen(self, patience: float) -> None:
        try:
            event = self._events.get(timeout=max(0.0, patience))
        except queue.Empty:
            if self._events.closed:
                self._stopping.wait(REDRAW_SECONDS)
            return
        while True:
            if event is not _WAKE:
                self._guarded(lambda heard=event: self._heard(heard))
            try:
                event = self._events.get_nowait()
            except queue.Empty:
                return

    def _guarded(self, action: Callable[[], object]) -> object:
        """Do something without letting it end the thread: the scene must outlive a file that cannot be
        read.
        """
        try:
            return action()
        except StudioError as problem:
            self._failed(problem)
        except Exception:
            _LOG.exception("The scene could not be drawn.")
        return None


class _Due:
    """A drawing that is wanted or not, at most once in `pause` seconds."""

    def __init__(self, draw: Callable[[], None], pause: float) -> None:
        self.draw, self.pause = draw, pause
        self._last = float("-inf")
        self.wanted = False

    def due(self, now: float) -> bool:
        return self.wanted and now - self._last >= self.pause

    def waits(self, now: float) -> float:
        return max(0.0, self._last + self.pause - now)

    def done(self, now: float) -> None:
        self._last, self.wanted = now, False
