"""Live cameras in hand: their readers' threads, from opening to closing."""

import threading
import time
from collections.abc import Callable, Sequence
from types import TracebackType

from studio.footage.capture.camera_addresses import CameraAddress, check_names
from studio.footage.capture.live_cameras import SILENCE_SECONDS, LiveCamera, LiveCameras, Open
from studio.foundations.errors import FootageError

SECONDS_TO_COME = 10.0
SECONDS_TO_END = 8.0
"""Longer than a read takes at most, after which a reader sees that it is to stop."""
LOOK_SECONDS = 0.05
USUAL_RATES = (10.0, 12.5, 15.0, 20.0, 24.0, 25.0, 30.0, 50.0, 60.0, 90.0, 100.0, 120.0)
NEAR_RATE = 0.06
RATED_PICTURES, RATED_SECONDS = 40, 2.0
"""A measured rate is taken for a usual one that is so near, in parts: what is measured in a second is not exact."""


class CameraReaders:
    """A reader a camera. Close it when done. Raises FootageError for two cameras of one name."""

    def __init__(
        self,
        addresses: Sequence[CameraAddress],
        *,
        clock: Callable[[], float] = time.monotonic,
        open_camera: Open | None = None,
        silence: float = SILENCE_SECONDS,
    ) -> None:
        check_names(addresses)
        self._clock, self._threads = clock, list[threading.Thread]()
        self.cameras = LiveCameras(
            tuple(
                LiveCamera(address, clock=clock, open_camera=open_camera, silence=silence)
                for address in addresses
            ),
            clock,
        )
        self.cameras.start(self._start)

    def await_pictures(self, patience: float = SECONDS_TO_COME) -> None:
        """Return when every camera gave a picture. Raises FootageError naming those that do not, and why."""
        until = self._clock() + patience
        while True:
            silent = [one for one in self.cameras.standings if not one.pictures]
            if not silent:
                return
            if self._clock() > until:
                break
            self.cameras.wait(LOOK_SECONDS)
        first = silent[0]
        raise FootageError(
            first.message or f"Camera {first.name} ({first.shown}) gave no picture for {patience:.0f} s.",
            "Check that it is switched on and its address, or leave that camera out.",
        )

    def await_rate(self) -> float:
        """Pictures a second of the slowest camera, once each gave RATED_PICTURES, or after RATED_SECONDS.

        The usual rate that is near, if one is.
        """
        until = self._clock() + RATED_SECONDS
        while min(one.pictures for one in self.cameras.standings) < RATED_PICTURES and self._clock() < until:
            self.cameras.wait(LOOK_SECONDS)
        measured = self.cameras.fps
        usual = min(USUAL_RATES, key=lambda rate: abs(rate - measured))
        return usual if abs(usual / measured - 1.0) < NEAR_RATE else round(measured, 2)

    def release(self) -> None:
        """Let replayed videos continue after their first picture."""
        for camera in self.cameras.cameras:
            camera.release()

    def stop(self) -> None:
        """Tell all readers to end, and wait for none."""
        self.cameras.stop()

    def close(self) -> None:
        """End all readers; one that hangs in a read is left to its time-out."""
        self.cameras.stop()
        until = time.monotonic() + SECONDS_TO_END
        for thread in self._threads:
            thread.join(max(0.0, until - time.monotonic()))

    def __enter__(self) -> "CameraReaders":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _start(self, run: Callable[[], None], name: str) -> None:
        thread = threading.Thread(target=run, name=name, daemon=True)
        self._threads.append(thread)
        thread.start()
