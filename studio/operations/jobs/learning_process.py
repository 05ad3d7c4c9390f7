"""A process that learns one behaviour model: sources in, the model's file and its numbers out."""

import dataclasses
import os
from collections.abc import Callable, Mapping
from concurrent.futures import wait
from dataclasses import dataclass, field
from pathlib import Path

from studio.body.catalogue import load_body
from studio.foundations.errors import BehaviourError
from studio.foundations.knobs import Value, changed, knobs_of
from studio.foundations.progress import Progress, report
from studio.operations.jobs.process_executor import ProcessExecutor, ProcessLostError
from studio.results.motion_sources import read_sources
from studio.runs.behaviour_models import models_folder
from studio.runs.learning.learning import learn
from studio.runs.learning.model_repository import keep_model, place_for_model
from studio.runs.learning.oversampling import OversamplingSettings
from studio.runs.learning.recordings import FPS
from studio.search.behaviour.settings import LearningSettings
from studio.sessions.session import BODIES_NAME
from studio.sessions.workspace import Workspace

READING = "reading motion"
PARTS = 1000
NICENESS = 5
CHECK_SECONDS = 0.2


@dataclass(frozen=True, slots=True)
class LearningOrder:
    """What is to be learnt. root : of the workspace. name : of the model. sources, tests : motion files, runs as
    SESSION/RUN, bundled recipes; without tests the last fifth of each source is the test. knobs : of LearningSettings
    and OversamplingSettings, those that were changed.
    """

    root: Path
    name: str
    body: str
    sources: tuple[str, ...]
    tests: tuple[str, ...] = ()
    fps: float = FPS
    seed: int = 0
    knobs: Mapping[str, Value] = field(default_factory=dict[str, Value])

    def settings(self) -> tuple[LearningSettings, OversamplingSettings]:
        """The knobs as settings. Raises SettingsError for one that there is not, or a value outside its range."""
        material = {entry.name for entry in knobs_of(OversamplingSettings)}
        # A name that is neither's is refused with the others of learning.
        learning = {name: value for name, value in self.knobs.items() if name not in material}
        others = {name: value for name, value in self.knobs.items() if name in material}
        return changed(LearningSettings(), learning), changed(OversamplingSettings(), others)


def learn_in_process(
    order: LearningOrder, report: Progress, check: Callable[[], None] = lambda: None
) -> dict[str, object]:
    """Learn and keep a model in a process of its own; its numbers. Nothing is written before the model is whole.

    check : called often; what it raises ends the work. Raises StudioError.
    """
    running = ProcessExecutor(1, on_report=report, niceness=NICENESS)
    process = running.submit(os.getpid)
    learning = running.submit(learn_to_order, order)
    try:
        while not learning.done():
            check()
            wait([learning], CHECK_SECONDS)
        return learning.result()
    except ProcessLostError as lost:
        raise BehaviourError(lost.message, "Try again with fewer frames.") from None
    finally:
        learning.cancel()
        running.shutdown(cancel_futures=True)
        if process.done() and not process.cancelled():
            for left in models_folder(order.root).glob(f"*.{process.result()}.partial"):
                left.unlink(missing_ok=True)


def learn_to_order(order: LearningOrder) -> dict[str, object]:
    """Learn and keep the model, reporting its progress; its numbers. Raises StudioError."""
    workspace, body = Workspace(order.root), load_body(order.body, (order.root / BODIES_NAME,))
    place_for_model(order.name, workspace)
    learning, material = order.settings()
    total = len(order.sources) + len(order.tests)
    heard: list[str] = []

    def reading(words: str, done: int, parts: int) -> None:
        if not heard or heard[-1] != words:
            heard.append(words)
        share = (len(heard) - 1 + done / max(1, parts)) / total
        report(READING, min(PARTS - 1, round(PARTS * share)), PARTS)

    report(READING, 0, PARTS)
    read = [
        read_sources([source], body, fps=order.fps, workspace=workspace, progress=_named(reading, number))
        for number, source in enumerate((*order.sources, *order.tests))
    ]
    training = [one for group in read[: len(order.sources)] for one in group]
    tests = [one for group in read[len(order.sources) :] for one in group]
    model, numbers = learn(
        training, body, learning, material, tests or None, seed=order.seed, progress=report
    )
    keep_model(model, place_for_model(order.name, workspace))
    bad = {one.name: len(one.bad_frames) for one in (*training, *tests) if one.bad_frames}
    return {**dataclasses.asdict(numbers), "bad_frames": bad}


def _named(reading: Progress, number: int) -> Progress:
    return lambda words, done, parts: reading(f"{number} {words}", done, parts)
