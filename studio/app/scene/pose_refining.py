"""The short search around an edited pose, in a separate thread."""

import logging
import math
import threading
from collections.abc import Callable

from numpy import float64
from numpy.typing import NDArray

from studio.foundations.errors import StudioError, WorkCancelledError
from studio.operations.poses import PoseSearch, improve_pose
from studio.runs.setup.pose_search import BetterPose
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

_LOG = logging.getLogger(__name__)


class PoseRefining:
    """A search in progress. progress : called with the share done. done : called with this object and the result, a
    `BetterPose` or an error. Both are called in the search's thread.
    """

    def __init__(
        self,
        session: Session,
        run: StoredRun | None,
        frame: int,
        pose: NDArray[float64],
        *,
        progress: Callable[[float], None],
        done: Callable[["PoseRefining", BetterPose | StudioError], None],
    ) -> None:
        self._stopping = threading.Event()

        def report(_: str, step: int, total: int) -> None:
            if self._stopping.is_set():
                raise WorkCancelledError("The search around the pose was stopped.")
            progress(step / total)

        def search() -> None:
            try:
                result = improve_pose(session, PoseSearch(frame, pose, run), report)
            except StudioError as problem:
                result = problem
            except Exception:
                _LOG.exception("refining a pose failed")
                result = StudioError("The search around the pose failed.", "See the studio's log.")
            if not self._stopping.is_set():
                done(self, result)

        threading.Thread(target=search, name="pose-refining", daemon=True).start()

    def stop(self) -> None:
        """Stop the search; nothing more is reported."""
        self._stopping.set()


def outcome(better: BetterPose) -> str:
    """The result of a search as text."""
    if better.gain <= 0.0:
        return "No better pose was found nearby."
    if math.isfinite(better.overlap_before) and math.isfinite(better.overlap):
        return (
            f"Overlap with the masks {100.0 * better.overlap_before:.0f} % → {100.0 * better.overlap:.0f} %."
        )
    return "A better pose was found nearby."
