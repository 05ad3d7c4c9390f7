"""The thread that records live cameras: forms sets of the cameras' newest pictures and writes them down.

The first set comes at once, to get ready with; the others from when they are requested. A camera that stops is left out
of the sets until it comes back; with none left for a while, or a disk that refuses, the recording ends and says so.
"""

import errno
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from studio.footage.capture.live_cameras import CameraStanding, PictureSet, SpreadFigures
from studio.foundations.errors import FootageError, StudioError
from studio.foundations.words import counted
from studio.operations.jobs.camera_readers import CameraReaders
from studio.sessions.live_recordings import SetWriter, finish_recording
from studio.sessions.session import Session

LONGEST_SILENCE = 10.0
"""With no camera left for so long, a recording ends."""
SECONDS_TO_COME = 10.0
LOOK_SECONDS = 0.02
FULL = frozenset((errno.ENOSPC, errno.EDQUOT))


@dataclass(frozen=True, slots=True)
class CameraNotice:
    """That a camera stopped, or came back. seconds : of the recording. silent : since its last picture when it was
    noticed (how long it was away, where it came back).
    """

    camera: str
    state: str
    seconds: float
    silent: float

    @property
    def in_words(self) -> str:
        if self.state == "running":
            return f"Camera {self.camera} came back at {self.seconds:.1f} s."
        word = "stopped" if self.state == "stopped" else "ended"
        return (
            f"Camera {self.camera} {word} at {self.seconds:.1f} s (noticed {self.silent:.2f} s after its last picture);"
            " the others went on."
        )


@dataclass(frozen=True, slots=True)
class SetStanding:
    """A recording at this moment. sets : kept. seconds : since the sets began to come, 0 before. spreads : of the last
    sets. cameras : how each stands. notices : of cameras that stopped or came back. ended : why, "" while it goes on.
    """

    sets: int
    seconds: float
    spreads: SpreadFigures
    cameras: tuple[CameraStanding, ...]
    notices: tuple[CameraNotice, ...]
    ended: str

    @property
    def stopped(self) -> tuple[CameraStanding, ...]:
        """Cameras that give nothing any more."""
        return tuple(one for one in self.cameras if one.state in ("stopped", "ended"))

    @property
    def in_words(self) -> str:
        words = [
            f"{counted(self.sets, 'set')}",
            f"{self.spreads.median:.0f} ms apart" if self.spreads.sets else "",
        ]
        words += [one.in_words for one in self.stopped]
        return " · ".join(word for word in words if word)


class SetRecording:
    """Records into a session. readers : of its cameras, closed by whoever opened them. Close it when done."""

    def __init__(
        self, readers: CameraReaders, session: Session, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.session = session
        self._readers, self._cameras, self._clock = readers, readers.cameras, clock
        self._fps, self._last = session.manifest.fps, session.manifest.frame_count
        self._writer = SetWriter(session)
        self._stopping, self._first_there = threading.Event(), threading.Event()
        self._sets, self._frame, self._came, self._ended = 0, -1, float("-inf"), ""
        self._went: float | None = None
        self._states: dict[str, str] = {}
        self._notices: list[CameraNotice] = []
        self._thread = threading.Thread(target=self._run, name="take", daemon=True)
        self._thread.start()

    @property
    def standing(self) -> SetStanding:
        seconds = 0.0 if self._went is None else self._clock() - self._went
        return SetStanding(
            self._sets,
            seconds,
            self._cameras.spreads,
            self._cameras.standings,
            tuple(self._notices),
            self._ended,
        )

    def await_first(self) -> None:
        """Return when the set is there that one gets ready with. Raises FootageError where none comes."""
        self._first_there.wait(SECONDS_TO_COME)
        if not self._sets:
            raise FootageError(self._ended or "The cameras gave no complete set.", "Look at their pictures.")

    def close(self) -> Session:
        """End it; returns the session with what came. Raises SessionError where nothing came."""
        self._stopping.set()
        self._thread.join()
        notes = tuple(notice.in_words for notice in self._notices)
        return finish_recording(Session(self.session.path), notes)

    def _run(self) -> None:
        why = "a fault of the studio"
        try:
            why = self._record()
        except OSError as problem:
            full = problem.errno in FULL
            why = "the disk is full" if full else f"the disk refused ({problem.strerror or problem})"
        except StudioError as problem:
            why = problem.message
        finally:
            self._ended = why
            self._writer.end(why)
            self._first_there.set()

    def _record(self) -> str:
        """Record until the end; returns why."""
        last_sign = self._clock()
        while not self._stopping.is_set():
            if self._sets and self._went is None:
                if not self._writer.may_go:
                    self._stopping.wait(LOOK_SECONDS / 4)
                    continue
                self._go()
            pictures, states = self._cameras.newest_set(self._came, self._fps), self._watch()
            if pictures is None:
                if all(state == "ended" for state in states):
                    return "all replayed videos are over"
                if "running" in states:
                    last_sign = self._clock()
                elif self._clock() - last_sign > LONGEST_SILENCE:
                    return f"no camera gave a picture for {LONGEST_SILENCE:.0f} s"
                self._cameras.wait(LOOK_SECONDS)
                continue
            last_sign = self._clock()
            frame = self._number(pictures)
            if frame >= self._last:
                return "its time was over"
            self._writer.put(frame, pictures)
            self._frame, self._came = frame, max(shot.came for shot in pictures.shots.values())
            self._sets += 1
            self._first_there.set()
        return "it was stopped"

    def _watch(self) -> list[str]:
        """The cameras' states; what has changed since the last look is noted."""
        now = self._clock()
        for one in self._cameras.standings:
            before = self._states.get(one.name)
            self._states[one.name] = one.state
            if before not in (None, "connecting", one.state) and self._went is not None:
                self._notices.append(CameraNotice(one.name, one.state, now - self._went, one.age or 0.0))
        return list(self._states.values())

    def _go(self) -> None:
        """From now on sets are kept as they come."""
        self._went = self._came = self._clock()
        self._readers.release()

    def _number(self, pictures: PictureSet) -> int:
        """The set's number, which tells its time: a set that never became complete has none."""
        if self._went is None:
            return 0
        return max(self._frame + 1, 1 + round((pictures.moment - self._went) * self._fps))
