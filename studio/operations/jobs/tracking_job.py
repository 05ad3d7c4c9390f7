"""What the process is doing: one open run, those that wait, and what each command does to them.

`serve` takes a command, `advance` does one layer; the process's loop calls them in turn, so every command works
between two layers of a frame. Everything that is to be known comes out as events.
"""

import contextlib
import math
import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

from studio.foundations.errors import RunError, StudioError, WorkCancelledError
from studio.operations.jobs import commands
from studio.operations.jobs.events import Acknowledged, Event, FrameFinished, LayerFinished, RunState
from studio.operations.jobs.open_live_run import opened
from studio.operations.jobs.open_run import OpenRun
from studio.operations.jobs.reporter import Place, Reporter, names_of, unforeseen
from studio.operations.jobs.search_pace import SearchPace
from studio.runs.problem_source import ProblemSource
from studio.runs.sides import can_be_looked_at, correct_clip, in_words

Say = Callable[[OpenRun, str, str], None]
"""A line for a run's log: the run, level, text."""


class SideLooking:
    """Puts sides right in a thread of its own. Close it when done: what is under way is given up."""

    def __init__(self, say: Say) -> None:
        self._say = say
        self._ended = threading.Event()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="sides")

    def add(self, run: OpenRun) -> None:
        """Look at a finished run when those before it are done. It may be closed meanwhile."""
        if can_be_looked_at(run.stored):
            self._thread.submit(self._look, run)

    def close(self) -> None:
        """End, at the next frame that is read or the next step."""
        self._ended.set()
        self._thread.shutdown(cancel_futures=True)

    def _look(self, run: OpenRun) -> None:
        try:
            with closing(ProblemSource(run.session, run.stored.body(), run.stored.cameras())) as problems:
                words = correct_clip(run.stored, problems, self._go_on, self._go_on)
        except WorkCancelledError:
            return
        except StudioError as error:
            self._say(run, "error", f"The clip was not looked at again as a whole: {error}")
        except Exception:
            if not run.stored.folder.is_dir():  # moved or deleted meanwhile
                return
            self._say(run, "error", traceback.format_exc())
        else:
            if words:
                self._say(run, "info", in_words(words))

    def _go_on(self, *_where: object) -> None:
        if self._ended.is_set():
            raise WorkCancelledError(
                "Looking at the clip as a whole was given up.", "'studio refine' does it, too."
            )


UNOPENED = (commands.Open, commands.Start, commands.Dequeue, commands.Close)
"""What opens its run itself, or needs none."""
RUN_ON, TO_FRAME_END, ONE_LAYER = "run on", "to the frame's end", "one layer"


class TrackingJob:
    """The process's work. post : takes each event; it never waits. clock : seconds, rising."""

    def __init__(self, post: Callable[[Event], None], clock: Callable[[], float] = time.monotonic) -> None:
        self.stopped = False
        self._pace = SearchPace(clock)
        self._waiting: list[Place] = []
        self._say = Reporter(post, self._pace, self._waiting)
        self._sides = SideLooking(self._say.log)
        self._run: OpenRun | None = None
        self._goal = RUN_ON
        self._requested_at = math.nan
        self._compiled: set[str] = set()
        self._actions: dict[type[commands.Command], Callable[[Any], None]] = {
            commands.Open: self._open_run,
            commands.Start: self._start,
            commands.Dequeue: self._dequeue,
            commands.StepFrame: lambda command: self._begin(TO_FRAME_END, command.requested_at),
            commands.StepLayer: lambda command: self._begin(ONE_LAYER, command.requested_at),
            commands.Pause: self._pause,
            commands.Seek: self._seek,
            commands.Reanneal: self._reanneal,
            commands.Cancel: self._cancel,
            commands.ChangeSettings: self._change_settings,
            commands.PutBackSettings: self._put_back_settings,
            commands.SetPace: self._set_pace,
            commands.Close: self._release,
            commands.Stop: self._stop,
        }

    @property
    def busy(self) -> bool:
        """Whether `advance` has something to do."""
        return self._run is not None and (self._tracking or self._run.reannealing is not None)

    @property
    def rest(self) -> float:
        """Seconds until `advance` is due: what is left of a layer's time while a run is watched at a pace.

        Steps and re-annealing are never held back.
        """
        answering = self._run is not None and self._run.reannealing is not None
        return 0.0 if answering or self._goal != RUN_ON else self._pace.left

    @property
    def _tracking(self) -> bool:
        return self._say.state_name == RunState.TRACKING

    def serve(self, command: commands.Command) -> None:
        """Do what a command says and acknowledge it; a refusal says why."""
        refusal = ("", "", "")
        try:
            if command.run and not isinstance(command, UNOPENED):
                self._make_current(command)
            self._actions[type(command)](command)
        except StudioError as error:
            refusal = (error.message, error.hint, error.code)
        except Exception as error:
            self._say.log(self._run, "error", traceback.format_exc())
            refusal = (unforeseen(error), "See the log.", "fault")
        served = (command.identifier, type(command).__name__, not refusal[2])
        self._say.post(Acknowledged(*names_of(self._run), *served, *refusal))

    def advance(self) -> None:
        """Do one layer of what is being done. What goes wrong becomes an event."""
        run = self._run
        if run is None:
            return
        try:
            self._warm_up(run)
            if run.reannealing is not None:
                self._advance_reannealing(run)
            else:
                self._advance_tracking(run)
        except StudioError as error:
            self._fail(run, error.message, error.hint)
        except Exception as error:
            self._say.log(run, "error", traceback.format_exc())
            self._fail(run, unforeseen(error), "See the log; 'start' tries the frame again.")

    def close(self) -> None:
        """Save and close the open run, and give up what is done beside it."""
        self._sides.close()
        self._close_run()

    def _close_run(self) -> None:
        run, self._run = self._run, None
        if run is not None:
            run.close()

    # ------------------------------------------------------------------ one layer

    def _warm_up(self, run: OpenRun) -> None:
        """Say that kernels are compiled, the first time that a weighting is used in this process."""
        if run.warmed_as in self._compiled:
            return
        state = self._say.state_name
        self._state(RunState.COMPILING)
        try:
            run.warm_up()
        finally:
            self._state(state)
        self._compiled.add(run.warmed_as)

    def _advance_tracking(self, run: OpenRun) -> None:
        self._pace.begin()
        stepped = run.step_layer()
        result = stepped.result if stepped is not None else None
        if stepped is not None:
            self._say.stepped(run, stepped, self._requested_at)
        if run.tracking.finished:
            self._say.log(run, "info", f"Finished: {run.tracking.done} frames.")
            run.tracking.keep_time()
            self._sides.add(run)
            self._state(RunState.FINISHED)
            self._begin_waiting()
        elif (stepped and self._goal == ONE_LAYER) or (self._goal == TO_FRAME_END and result is not None):
            run.tracking.save()
            self._state(RunState.PAUSED)
        elif result is not None:
            self._state(RunState.TRACKING)

    def _advance_reannealing(self, run: OpenRun) -> None:
        reannealing = run.reannealing
        assert reannealing is not None
        record = reannealing.step_layer()
        if record.layer == 0:
            self._say.settings(run, reannealing.version, reannealing.settings, reannealing.frame, 0)
        self._say.post(
            LayerFinished(
                *names_of(run),
                record,
                reannealed=True,
                requested_at=self._requested_at,
                search_layers=reannealing.search_layers,
                searches=reannealing.searches,
            )
        )
        if not reannealing.finished:
            return
        result, kept = reannealing.result(), run.keep_result
        if kept:
            run.keep_reannealed()
            self._say.log(
                run,
                "info",
                f"Frame {reannealing.frame} is replaced, those after it are dropped; the old run is in the trash.",
            )
        run.reannealing, run.keep_result = None, False
        self._say.post(FrameFinished(*names_of(run), result, not kept))
        if run.reanneal_again:
            run.reanneal_again = False
            run.reanneal(reannealing.frame)
        else:
            self._state(run.resting)

    # ------------------------------------------------------------------ commands

    def _is_open(self, run_folder: str) -> bool:
        return self._run is not None and self._run.stored.folder == Path(run_folder).resolve()

    def _make_current(self, command: commands.Command) -> None:
        """Open the run that a command is about. Raises RunError while another one is tracked."""
        if self._is_open(command.run):
            return
        if self._tracking:
            now = self._require_open()
            raise RunError(
                f"Run '{now.run_name}' of session '{now.session_name}' is being tracked.",
                "Pause it first, or wait.",
            )
        self._open(command.session, command.run)

    def _open_run(self, command: commands.Open) -> None:
        self._open(command.session, command.run)
        if command.warm and self._run is not None:
            self._warm_up(self._run)

    def _open(self, session: str, run_folder: str) -> None:
        if self._is_open(run_folder):
            self._say.state_again(self._run)
            return
        # The new one is opened before the old one is closed, so that a refusal changes nothing.
        following = opened(session, run_folder)
        self._close_run()
        self._run = following
        self._say_settings(following)
        self._state(following.resting)

    def _say_settings(self, run: OpenRun) -> None:
        """Say which settings the run continues with, and since when the stored ones of them are in use."""
        version, settings = run.mailbox.latest()
        entry = run.tracking.history.entries[-1]
        self._say.settings(run, version, settings, entry.frame, entry.layer)

    def _start(self, command: commands.Start) -> None:
        place = (command.session, command.run)
        if command.run and self._tracking and not self._is_open(command.run):
            if place not in self._waiting:
                self._waiting.append(place)
            self._say.state_again(self._run)
            return
        if command.run:
            self._open(*place)
        if place in self._waiting:
            self._waiting.remove(place)
        self._begin(RUN_ON, command.requested_at)

    def _dequeue(self, command: commands.Dequeue) -> None:
        place = (command.session, command.run)
        if place not in self._waiting:
            raise RunError(f"Run '{Path(command.run).name}' does not wait.", "Cancel it if it is tracked.")
        self._waiting.remove(place)
        self._say.state_again(self._run)

    def _begin(self, goal: str, requested_at: float = math.nan) -> None:
        run = self._require_open()
        if run.tracking.finished:
            raise RunError(f"Run '{run.run_name}' has no frame left.", "Re-anneal one, or start a new run.")
        run.drop_reannealing()
        run.tracking.mark_going_on()
        self._goal, self._requested_at = goal, requested_at if goal == ONE_LAYER else math.nan
        if goal == RUN_ON:
            self._say.log(run, "info", f"Tracking from frame {run.tracking.next_frame}.")
        self._state(RunState.TRACKING)

    def _pause(self, _: commands.Pause) -> None:
        run = self._require_open()
        run.drop_reannealing()
        if self._say.state_name in (RunState.TRACKING, RunState.REANNEALING):
            self._settle(run)

    def _seek(self, command: commands.Seek) -> None:
        self._require_open().select(command.frame)
        self._say.state_again(self._run)

    def _set_pace(self, command: commands.SetPace) -> None:
        self._pace.set(command.seconds_a_layer)
        self._say.state_again(self._run)

    def _reanneal(self, command: commands.Reanneal) -> None:
        run = self._require_open()
        run.selected = run.reanneal(command.frame)
        run.tracking.save()
        run.keep_result, run.reanneal_again, self._requested_at = command.keep, False, command.requested_at
        self._state(RunState.REANNEALING)

    def _cancel(self, _: commands.Cancel) -> None:
        run = self._require_open()
        if run.tracking.finished:
            raise RunError(f"Run '{run.run_name}' is finished.", "Delete it if it is not wanted.")
        run.drop_reannealing()
        run.tracking.mark_cancelled()
        self._say.log(run, "info", f"Cancelled at frame {run.tracking.next_frame}.")
        self._state(RunState.CANCELLED)
        self._begin_waiting()

    def _change_settings(self, command: commands.ChangeSettings) -> None:
        run = self._require_open()
        if command.frame >= 0 and not self._tracking:
            run.select(command.frame)
        moved = run.mailbox.change(command.changes)
        if not moved:
            return
        run.keep_moved()
        changes = ", ".join(f"{name} = {command.changes[name]}" for name in moved)
        self._say.log(run, "info", f"Settings: {changes}")
        if self._tracking:
            return
        self._requested_at = command.requested_at
        if run.reannealing is None:
            run.reanneal()
            self._state(RunState.REANNEALING)
        else:
            # The answer on its way is let out first: a slider that is dragged would else never show one.
            run.reanneal_again = True

    def _put_back_settings(self, _: commands.PutBackSettings) -> None:
        run = self._require_open()
        run.put_back_moved()
        self._say_settings(run)
        if not self._tracking:
            self._state(run.resting)

    def _release(self, command: commands.Close) -> None:
        open_folder = self._run.stored.folder if self._run is not None else None
        named = command.run or command.session
        if named and (
            open_folder is None or Path(named).resolve() not in (open_folder, open_folder.parents[1])
        ):
            return
        if self._tracking:
            raise RunError(f"Run '{self._require_open().run_name}' is being tracked.", "Cancel it first.")
        self._close_run()
        self._state(RunState.IDLE)

    def _stop(self, _: commands.Stop) -> None:
        self.close()
        self.stopped = True

    # ------------------------------------------------------------------ in common

    def _require_open(self) -> OpenRun:
        if self._run is None:
            raise RunError("No run is open.", "Open one, or start a new one.")
        return self._run

    def _settle(self, run: OpenRun) -> None:
        """Stop where the search stands, saved whole."""
        run.tracking.save()
        self._state(run.resting)

    def _begin_waiting(self) -> None:
        """Track the first of those that wait that can be tracked."""
        while self._waiting:
            place = self._waiting.pop(0)
            try:
                self._open(*place)
                self._begin(RUN_ON)
                return
            except StudioError as error:
                self._say.log(self._run, "error", f"Run '{Path(place[1]).name}' could not start: {error}")

    def _fail(self, run: OpenRun, message: str, hint: str) -> None:
        """Say that the layer could not be done; the search stands before it, and what is stored stays."""
        self._say.log(run, "error", f"{message} {hint}".strip())
        if run.reannealing is not None:
            run.drop_reannealing()
            self._state(run.resting, message, hint)
            return
        with contextlib.suppress(StudioError):
            run.tracking.save()
        self._state(RunState.FAILED, message, hint)
        self._begin_waiting()

    def _state(self, name: RunState, message: str = "", hint: str = "") -> None:
        if self._run is not None and not name.searches:
            self._run.rest()
        self._say.state(self._run, name, message, hint)
