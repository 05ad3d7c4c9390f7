"""A process that learns one behaviour model: sources in, the model's file and its numbers out."""

import dataclasses
import os
from collections.abc import Callable, Sequence
from concurrent.futures import wait
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from studio.body.catalogue import load_body
from studio.foundations.declaring import Body, Knobs, Seed, Terminal, Values, Web
from studio.foundations.errors import BehaviourError, SettingsError
from studio.foundations.knobs import changed, knobs_of
from studio.foundations.progress import Progress, report
from studio.operations.jobs.job_runner import JobKind, SessionJob
from studio.operations.jobs.process_executor import ProcessExecutor, ProcessLostError
from studio.operations.model_repository import place_for_model
from studio.results.motion_sources import read_sources
from studio.runs.behaviour_models import models_folder
from studio.runs.learning.learning import learn
from studio.runs.learning.oversampling import OversamplingSettings
from studio.runs.learning.recordings import FPS
from studio.search.behaviour.model_file import write_model
from studio.search.behaviour.settings import LearningSettings
from studio.sessions.session import BODIES_NAME
from studio.sessions.workspace import Workspace

READING = "reading motion"
PARTS = 1000
NICENESS = 5
CHECK_SECONDS = 0.2
Sources = Annotated[
    Sequence[str | Path],
    Field(
        max_length=500,
        description="Motion files (.amc with its .asf, .bvh, .npz, .c3d, .trc), folders of them, runs as SESSION/RUN,"
        " or recipes (their motion alone).",
    ),
    Web(kind=list[str]),
]


class LearningProgress(SessionJob):
    """How the learning stands. learnt: its numbers, and the frames that fitted badly, when it is done."""

    name: str
    body: str
    learnt: dict[str, object] = Field(default_factory=dict)


LEARNING = JobKind(
    "learning",
    "learning",
    LearningProgress,
    busy="Model '{name}' is being learnt; one is learnt at a time.",
    page="/behaviours?name={name}",
)


@dataclass(frozen=True, slots=True)
class LearningOptions:
    """How a model is learnt. tests : motion files, runs as SESSION/RUN, bundled recipes."""

    body: Annotated[
        Body, Field(description="Body of the model's poses; default: the workspace's sessions' own.")
    ] = ""
    tests: Annotated[
        Sources,
        Field(description="Sources for the test entropy; default: the last fifth of each source."),
        Terminal("--test", "SOURCES...", kind=Sequence[str]),
    ] = ()
    fps: Annotated[float, Field(ge=5.0, le=240.0, description="Frames per second.")] = FPS
    knobs: Annotated[
        Values, Knobs(lambda: (*knobs_of(LearningSettings), *knobs_of(OversamplingSettings)))
    ] = None
    seed: Seed = 0

    def settings(self) -> tuple[LearningSettings, OversamplingSettings]:
        """Knobs of learning and of the training material, distinguished by name. Raises SettingsError."""
        groups, knobs = (LearningSettings(), OversamplingSettings()), self.knobs or {}
        known = [{entry.name for entry in knobs_of(type(group))} for group in groups]
        strange = sorted(set(knobs) - known[0] - known[1])
        if strange:
            raise SettingsError(
                f"Learning has no knob '{strange[0]}'.", f"It has: {', '.join(sorted(known[0] | known[1]))}."
            )
        learning, material = (
            {name: value for name, value in knobs.items() if name in names} for names in known
        )
        return changed(groups[0], learning), changed(groups[1], material)


@dataclass(frozen=True, slots=True)
class LearningOrder:
    """What is to be learnt. root : of the workspace. name : of the model. sources : motion files, runs as SESSION/RUN,
    bundled recipes. options : their body is given.
    """

    root: Path
    name: str
    sources: tuple[str, ...]
    options: LearningOptions


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
    options, workspace = order.options, Workspace(order.root)
    body = load_body(options.body, (order.root / BODIES_NAME,))
    place = place_for_model(order.name, workspace)
    learning, material = options.settings()
    sources = (*order.sources, *options.tests)
    steps: list[str] = []

    def reading(words: str, done: int, parts: int) -> None:
        if not steps or steps[-1] != words:
            steps.append(words)
        share = (len(steps) - 1 + done / max(1, parts)) / len(sources)
        report(READING, min(PARTS - 1, round(PARTS * share)), PARTS)

    report(READING, 0, PARTS)
    read = [
        read_sources(
            [source], body, fps=options.fps, workspace=workspace, progress=_naming_sources(reading, number)
        )
        for number, source in enumerate(sources)
    ]
    training = [one for group in read[: len(order.sources)] for one in group]
    tests = [one for group in read[len(order.sources) :] for one in group]
    model, numbers = learn(
        training, body, learning, material, tests or None, seed=options.seed, progress=report
    )
    write_model(model, place)
    bad = {one.name: len(one.bad_frames) for one in (*training, *tests) if one.bad_frames}
    return {**dataclasses.asdict(numbers), "bad_frames": bad}


def _naming_sources(reading: Progress, number: int) -> Progress:
    return lambda words, done, parts: reading(f"{number} {words}", done, parts)
