"""The tracking process as its owner sees it: started when first needed, watched, and started again after a
death.

Commands go down a pipe, events come up another into one subscription for each watcher. However the process
dies, all learn it from a `StateChanged` with state "lost", and `restart` opens the run again where its store
says it stands.
"""

import contextlib
import dataclasses
import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path

from studio.foundations.errors import (
    BodyError,
    CalibrationError,
    FootageError,
    NotFoundError,
    RunError,
    SessionError,
    SettingsError,
    StudioError,
)
from studio.foundations.knobs import Value
from studio.operations.jobs import commands
from studio.operations.jobs.events import Acknowledged, Event, RunState, StateChanged, nothing_open
from studio.operations.jobs.process import LOST_HINT, SILENT_SECONDS, OwnedProcess, ProcessDiedError
from studio.operations.jobs.watchers import Subscription, Watchers
from studio.sessions.workspace import Workspace

ANSWER_SECONDS = 180.0
"""How long an acknowledgement may take: as long as a start and the first compilation on a busy machine."""
CLOSING_SECONDS = 2.5
DIED = "died"
"""Code of an answer that no process gave."""
REFUSALS = (RunError, SettingsError, NotFoundError, SessionError, BodyError, CalibrationError, FootageError)


logger = logging.getLogger(__name__)


class StudioControl:
    """Owns the tracking process of a workspace. All methods may be called from any thread."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._watchers = Watchers()
        self._lock = threading.RLock()
        self._reviving = threading.RLock()
        self._process: OwnedProcess | None = None
        self._answers: dict[str, Future[Acknowledged]] = {}
        self._said = nothing_open()
        self._state = self._said
        self._places: dict[tuple[str, str], tuple[str, str]] = {}

    @property
    def state(self) -> StateChanged:
        """Where the search stands, or stood at the process's last event."""
        return self._state

    @property
    def process_identifier(self) -> int | None:
        """The process's id, None while there is none."""
        process = self._process
        return process.identifier if process else None

    def subscribe(self, wanted: Callable[[Event], bool] = lambda _: True) -> Subscription[Event]:
        """Every event from now on that is wanted, newest wins; close it when done. `wanted` is called in the thread
        that takes the events from the process.
        """
        return self._watchers.subscribe(wanted)

    # ------------------------------------------------------------------ asking

    def send(self, command: commands.Command) -> None:
        """Post a command; an `Acknowledged` event follows. One that names its run revives a process that was lost, also
        one that dies just then.

        Raises ProcessDiedError.
        """
        process = self._post(command)
        if process is not None and command.run:
            with self._reviving:
                if self._process is process:
                    self.restart(resume=False)
            process = self._post(command)
        if process is not None:
            raise _died_before(command)

    def _post(
        self, command: commands.Command, answer: Future[Acknowledged] | None = None
    ) -> OwnedProcess | None:
        """None once a process has the command; else the process that died before."""
        if command.run:
            with self._reviving:
                # Whoever comes second finds it revived.
                if self._state.state is RunState.LOST:
                    self.restart(resume=False)
        with self._lock:
            self._note(command)
            if self._process is None:
                self._process = OwnedProcess(self.take_event, self.take_silence, self.take_end)
            process = self._process
            # What waits for an answer waits for this process's.
            if answer is not None:
                self._answers[command.identifier] = answer
        try:
            process.send(command)
        except ProcessDiedError:
            return process
        return None

    def request(self, command: commands.Command, timeout: float = ANSWER_SECONDS) -> Acknowledged:
        """Post a command and wait until it is acknowledged.

        Raises what the process refused it with (RunError, SettingsError, …), RunError if no answer came in
        time, ProcessDiedError.
        """
        answer: Future[Acknowledged] = Future()
        try:
            if self._post(command, answer) is not None:
                raise _died_before(command)
            event = answer.result(timeout)
        except TimeoutError:
            raise RunError(
                f"The tracking process did not answer '{type(command).__name__}'.",
                "Wait until it has compiled, or restart it.",
            ) from None
        finally:
            with self._lock:
                self._answers.pop(command.identifier, None)
        if event.code == DIED:
            raise _died_before(command)
        if not event.ok:
            raise _refusal(event)
        return event

    def about(self, session: str, run: str) -> commands.About:
        """What makes a command one about a run of the workspace. Raises NotFoundError."""
        return commands.about(self.workspace.session(session).run(run).folder)

    def open_run(self, session: str, run: str) -> Acknowledged:
        """Make a run of the workspace the current one. Raises NotFoundError, RunError."""
        return self.request(commands.Open(**self.about(session, run)))

    def track(self, session: str, run: str) -> Acknowledged:
        """Track a run of the workspace, now or after those that are tracked already. Raises NotFoundError."""
        return self.request(commands.Start(**self.about(session, run)))

    def change_settings(self, **changes: Value) -> Acknowledged:
        """Change knobs of the open run by name. Raises SettingsError naming what is allowed."""
        return self.request(commands.ChangeSettings(changes=changes))

    # ------------------------------------------------------------------ the process

    def start(self) -> None:
        """Start the process ahead of the first command, so that no command waits for it."""
        with self._lock:
            if self._process is None:
                self._process = OwnedProcess(self.take_event, self.take_silence, self.take_end)

    def restart(self, *, resume: bool = True) -> None:
        """Start the process again and open the run that was open; runs that waited wait again.

        resume : track on if it was tracking. The search goes at the pace that it had; settings that were changed and
        not yet in use are in the run's folder. Raises StudioError if the run cannot be opened.
        """
        with self._reviving:
            self._restart(resume=resume)

    def _restart(self, *, resume: bool) -> None:
        with self._lock:
            before, old = self._said, self._process
            self._process = None
            answers, self._answers = self._answers, {}
            self._said = self._state = nothing_open(before.seconds_a_layer)
        if old is not None:
            old.end(0.0)
        _leave_unanswered(answers)
        self.start()
        if before.seconds_a_layer:
            self.request(commands.SetPace(seconds_a_layer=before.seconds_a_layer))
        place = self._places.get((before.session, before.run))
        if place is not None:
            about: commands.About = {"session": place[0], "run": place[1]}
            # What was renamed or deleted meanwhile stays closed.
            with contextlib.suppress(NotFoundError):
                if resume and before.state.searches:
                    # Refused if the process died just after its last frame: then nothing is left to go on with.
                    with contextlib.suppress(RunError):
                        self.request(commands.Start(**about))
                else:
                    self.request(commands.Open(**about))
        for names in before.waiting:
            session, run = self._places[names]
            with contextlib.suppress(NotFoundError):
                self.request(commands.Start(session=session, run=run))

    def close(self) -> None:
        """End the process, its search saved where it stands, and all subscriptions."""
        with self._lock:
            process, self._process = self._process, None
        if process is not None:
            process.end(CLOSING_SECONDS)
        self._watchers.close()

    # ------------------------------------------------------------------ hearing

    def take_event(self, process: OwnedProcess, event: Event) -> None:
        """Pass an event on to all who watch."""
        if process is not self._process:
            return
        if isinstance(event, StateChanged):
            self._said = event
            self._publish(event)
            return
        self._watchers.publish(event)
        if isinstance(event, Acknowledged):
            with self._lock:
                answer = self._answers.pop(event.identifier, None)
            if answer is not None:
                answer.set_result(event)

    def take_silence(self, process: OwnedProcess, silent: bool) -> None:
        """Say that the process does not speak, or that it speaks again."""
        if process is not self._process:
            return
        if silent:
            self._lose(f"The tracking process has been silent for {SILENT_SECONDS:g} seconds.")
        else:
            self._publish(self._said)

    def take_end(self, process: OwnedProcess) -> None:
        """Say that the process is gone, unless it was closed; callers that wait for an answer get one."""
        with self._lock:
            if process is not self._process:
                return
            answers, self._answers = self._answers, {}
            if process.exit_code == 0:
                self._process = None
                self._said = nothing_open()
        if process.exit_code == 0:
            self._publish(self._said)
        else:
            self._lose(f"The tracking process died ({process.death()}).")
        _leave_unanswered(answers)

    def _lose(self, message: str) -> None:
        logger.error("%s", message)
        self._publish(dataclasses.replace(self._said, state=RunState.LOST, message=message, hint=LOST_HINT))

    def _publish(self, state: StateChanged) -> None:
        self._state = state
        self._watchers.publish(state)

    def _note(self, command: commands.Command) -> None:
        """Remember what a restart has to bring back."""
        if command.run:
            names = (Path(command.session).name, Path(command.run).name)
            self._places[names] = (command.session, command.run)


def _leave_unanswered(answers: Mapping[str, Future[Acknowledged]]) -> None:
    for identifier, answer in answers.items():
        answer.set_result(Acknowledged("", "", identifier, "", False, "", "", DIED))


def _died_before(command: commands.Command) -> ProcessDiedError:
    """That the process is gone and never answered this command, of which it is said what it was about."""
    run = f"run '{Path(command.run).name}' of " if command.run else ""
    about = f" about {run}session '{Path(command.session).name}'" if command.session else ""
    return ProcessDiedError(f"The tracking process died before it answered{about}.", LOST_HINT)


def _refusal(event: Acknowledged) -> StudioError:
    """The error that a command was refused with, of the kind that it had in the process."""
    kinds: dict[str, type[StudioError]] = {kind.code: kind for kind in REFUSALS}
    return kinds.get(event.code, RunError)(event.message, event.hint)
