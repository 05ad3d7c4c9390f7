"""The short search around an edited pose, in a thread of its own, so that the scene goes on meanwhile."""

import logging
import math
import threading
from collections.abc import Callable
from pathlib import Path

from numpy import float64
from numpy.typing import NDArray

from studio.errors import StudioError
from studio.runs.pose_search import BetterPose, better_pose
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

_LOG = logging.getLogger(__name__)


class PoseRefining:
    """One search. told : with the share that is done. found : with this object, when it ended by itself, `better` or
    `problem` being there; both are called in the search's thread.
    """

    def __init__(
        self,
        session: Path,
        run: StoredRun | None,
        frame: int,
        pose: NDArray[float64],
        *,
        told: Callable[[float], None],
        found: Callable[["PoseRefining"], None],
    ) -> None:
        self.better: BetterPose | None = None
        self.problem: StudioError | None = None
        self._session, self._run, self._frame, self._pose = session, run, frame, pose.copy()
        self._told, self._found = told, found
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._search, name="pose-refining", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End it soon; nothing is told any more."""
        self._stopping.set()

    @property
    def in_words(self) -> str:
        """What came of it."""
        if self.better is None:
            return ""
        if self.better.gain <= 0.0:
            return "The pose was the best one around already."
        before, after = self.better.overlap_before, self.better.overlap
        if math.isfinite(before) and math.isfinite(after):
            return f"Overlap with the masks {100.0 * before:.0f} % → {100.0 * after:.0f} %."
        return "A better pose was found nearby."

    def _search(self) -> None:
        try:
            self.better = better_pose(
                Session(self._session),
                self._frame,
                self._pose,
                run=self._run,
                progress=lambda _, done, total: self._told(done / total),
                cancelled=self._stopping.is_set,
            )
        except StudioError as problem:
            self.problem = problem
        except Exception:
            _LOG.exception("refining a pose failed")
            self.problem = StudioError("The search around the pose failed.", "See the studio's log.")
        if not self._stopping.is_set():
            self._found(self)
