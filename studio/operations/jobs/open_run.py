"""The run that the process has in hand: its search, its settings mailbox, its footage, and a frame that is
annealed again."""

import contextlib
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from studio.foundations.errors import SessionError, SettingsError, StudioError
from studio.operations.jobs.events import RunState
from studio.runs.behaviour_models import check_prediction
from studio.runs.compiling_beside import compiling_beside
from studio.runs.derived_runs import copied_beside
from studio.runs.moved_knobs import keep_moved, moved_between, with_moved
from studio.runs.problem_source import ProblemSource
from studio.runs.reannealing import Reannealing
from studio.runs.run_footage import footage_of
from studio.runs.sides import correct_clip, in_words
from studio.runs.storing_behind import MOST_WAITING
from studio.runs.tracking_run import Stepped, TrackingRun
from studio.search.settings import RunSettings, all_knobs, changed_settings, values
from studio.sessions.run_log import append_to_log
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


class SettingsMailbox:
    """Latest wins: a reader gets the newest settings, however many changes came since its last look.

    check : raises SettingsError for settings that the run cannot have.
    """

    def __init__(
        self,
        version: int,
        settings: RunSettings,
        check: Callable[[RunSettings], None] = lambda settings: None,
    ) -> None:
        self._lock = threading.Lock()
        self._check = check
        self._latest = (version, settings)

    def latest(self) -> tuple[int, RunSettings]:
        return self._latest

    def reset(self, version: int, settings: RunSettings) -> None:
        """Put back earlier settings, dropping those that were swapped in since."""
        with self._lock:
            self._latest = (version, settings)

    def change(self, changes: Mapping[str, object]) -> tuple[str, ...]:
        """Change knobs by name and return the names of those that moved; without any, the version stays.

        All or nothing. Raises SettingsError for an unknown name, a value that is not allowed, a knob that only a
        new run can change, or what the run cannot do.
        """
        with self._lock:
            version, settings = self._latest
            following = changed_settings(settings, changes)
            before, after = values(settings), values(following)
            moved = tuple(name for name, value in after.items() if before[name] != value)
            fixed = {entry.name for entry in all_knobs(settings) if entry.takes_effect == "new run"}
            for name in moved:
                if name in fixed:
                    raise SettingsError(
                        f"Setting '{name}' cannot change inside a run.", "Start a new run with that value."
                    )
            if moved:
                self._check(following)
                self._latest = (version + 1, following)
            return moved


VIEW_THREADS = 2
"""Cameras of a frame that are decoded and masked at once."""


class OpenRun:
    """One run, opened for tracking. Closing it saves it whole and frees its memory.

    keep_result : what re-annealing finds becomes the run's own. reanneal_again : once more, with newer settings.
    makes_ahead : whether the next frame is made ready while this one is searched.
    """

    makes_ahead = True

    def __init__(
        self, session_folder: str, run_folder: str, beside: "OpenRun | None" = None, runs: int = 1
    ) -> None:
        """beside : a run of the same body, cameras and footage, which is closed later and whose frames this one has.
        runs : how many are open.
        """
        self.session = Session(Path(session_folder))
        self.stored = self.session.run(Path(run_folder).name)
        self._ahead = ThreadPoolExecutor(1, thread_name_prefix="next-frame")
        self._views = ThreadPoolExecutor(VIEW_THREADS, thread_name_prefix="view")
        self._storing = ThreadPoolExecutor(1, thread_name_prefix="storing")
        self._beside, self._waiting = beside, max(MOST_WAITING // runs, 1)
        self._problems = beside._problems if beside else self._problem_source()
        try:
            self.tracking = self._tracking_run(self._problems)
        except StudioError:
            self._close_problems()
            raise
        self.mailbox = SettingsMailbox(
            *self.tracking.latest_settings(),
            lambda settings: check_prediction(settings, bool(self.stored.record.behaviour)),
        )
        self._take_moved()
        self.tracking.settings_source = self.mailbox.latest
        self.selected = -1
        self.reannealing: Reannealing | None = None
        self.keep_result = self.reanneal_again = False

    @property
    def session_name(self) -> str:
        return self.session.name

    @property
    def run_name(self) -> str:
        return self.stored.name

    @property
    def warmed_as(self) -> str:
        """What is warmed up once in a process: the weighting, whose kernels compile when they are first used."""
        return self.stored.record.weighting

    @property
    def resting(self) -> RunState:
        """The state of the run while nothing is done to it: finished, cancelled or paused."""
        if self.tracking.finished:
            return RunState.FINISHED
        return RunState.CANCELLED if self.tracking.ended == RunState.CANCELLED else RunState.PAUSED

    def warm_up(self) -> None:
        """Weigh one pose, so that what has to be compiled is compiled before a frame's time is taken."""
        frame = min(self.tracking.next_frame, self.stored.record.last - 1)
        start = self.stored.record.start_pose
        pose = np.array(start) if start is not None else self.stored.body().neutral
        with compiling_beside(self.stored):
            self._problems.problem(frame, self.mailbox.latest()[1]).log_likelihood(pose[None])

    def step_layer(self) -> Stepped | None:
        """Do the next layer of the run; None where a live run has no picture yet."""
        return self.tracking.step_layer()

    def conclude(self, read: Callable[[int], None] = lambda frame: None) -> str:
        """Look at a finished run as a whole; returns in words what that changed. read : called with each frame.

        What goes wrong is said in these words: the run itself is stored.
        """
        began = time.perf_counter()
        try:
            words = correct_clip(self.stored, self._problems, read)
        except StudioError as error:
            return f"The clip was not looked at again as a whole: {error}"
        finally:
            self.tracking.keep_time(time.perf_counter() - began)
        return in_words(words) if words else ""

    def rest(self) -> None:
        """Nothing is tracked for now."""

    def when_stored(self, action: Callable[[], None]) -> None:
        """Do something once all that is finished is stored."""
        self.tracking.when_stored(action)

    def target(self, frame: int = -1) -> int:
        """The frame to anneal again: the one named, else the selected, else the unfinished or last one."""
        if frame >= 0:
            return frame
        if self.selected >= 0:
            return self.selected
        first = self.stored.record.first
        if self.tracking.layers_done or self.tracking.next_frame == first:
            return self.tracking.next_frame
        return self.tracking.next_frame - 1

    def reanneal(self, frame: int = -1) -> int:
        """Begin to anneal a frame again with the newest settings; one that is unfinished is dropped.

        Returns the frame. Raises NotFoundError if it cannot be annealed yet.
        """
        target = self.target(frame)
        version, settings = self.mailbox.latest()
        self.reannealing = Reannealing(self.tracking, target, version, settings)
        return target

    def keep_reannealed(self) -> None:
        """Make the finished re-annealing the run's own frame. The run as it was goes to the workspace's trash, because
        the old frame and all after it are dropped.
        """
        assert self.reannealing is not None
        copy = copied_beside(self.stored, self.stored.record)
        Workspace(self.session.path.parent).to_trash(copy, f"{self.session_name}--{self.run_name}")
        self.reannealing.keep()
        self.keep_moved()

    def drop_reannealing(self) -> None:
        """Leave the re-annealing unfinished."""
        self.reannealing, self.keep_result, self.reanneal_again = None, False, False

    def select(self, frame: int) -> None:
        """Make `frame` the one to anneal again. Raises NotFoundError if it cannot be annealed yet."""
        self.tracking.search_again(frame)
        self.selected = frame

    def log(self, level: str, text: str) -> float:
        """Write a line into the run's log; returns its time, seconds since the epoch."""
        return append_to_log(self.stored.folder, level, text).time

    def keep_moved(self) -> None:
        """Keep the knobs that were moved and that no frame uses yet, for the next opening of the run."""
        version, stored = self.tracking.latest_settings()
        # A disk that refuses them is no reason to refuse the knobs.
        with contextlib.suppress(SessionError):
            keep_moved(self.stored, version, moved_between(stored, self.mailbox.latest()[1]))

    def put_back_moved(self) -> None:
        """Go back to the settings stored last, and drop a frame that is annealed with others."""
        self.drop_reannealing()
        self.mailbox.reset(*self.tracking.latest_settings())
        self.keep_moved()

    def _take_moved(self) -> None:
        version, stored = self.tracking.latest_settings()
        with contextlib.suppress(SettingsError):
            self.mailbox.change(moved_between(stored, with_moved(self.stored, version, stored)))

    def close(self) -> None:
        """Save the search where it stands and release files, pictures and threads."""
        self.reannealing = None
        try:
            self.tracking.close()
        finally:
            self._close_problems()

    def _problem_source(self) -> ProblemSource:
        record = self.stored.record
        return ProblemSource(
            self.session,
            self.stored.body(),
            self.stored.cameras(),
            last=record.last,
            executor=self._ahead if self.makes_ahead else None,
            views=self._views,
            footage=footage_of(self.session, self.stored),
        )

    def _tracking_run(self, problems: ProblemSource) -> TrackingRun:
        return TrackingRun(self.stored, problems, self._storing, self._waiting)

    def _close_problems(self) -> None:
        if self._beside is None:
            self._problems.close()
        self._ahead.shutdown()
        self._views.shutdown()
        self._storing.shutdown()
