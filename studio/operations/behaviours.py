"""Behaviour models out of recorded motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from studio.body.catalogue import load_body
from studio.foundations.declaring import Body, Knobs, Seed, Terminal, Values, Web, operation
from studio.foundations.errors import SettingsError
from studio.foundations.knobs import changed, knobs_of
from studio.operations.progress import Reporting, reporting, say
from studio.results.motion_sources import read_sources
from studio.runs.learning.learning import Learnt
from studio.runs.learning.learning import learn as learn_from
from studio.runs.learning.model_repository import ModelSummary, keep_model, list_models, place_for_model
from studio.runs.learning.oversampling import OversamplingSettings
from studio.runs.learning.recordings import FPS, Recording
from studio.runs.live.live_summary import in_words as ranges
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.settings import LearningSettings
from studio.sessions.session import BODIES_NAME
from studio.sessions.workspace import Workspace

SHOWN_BAD_FRAMES = 12
Sources = Annotated[
    Sequence[str | Path],
    Field(
        max_length=500,
        description="Motion files (.amc with its .asf, .bvh, .npz, .c3d, .trc), folders of them, runs as SESSION/RUN,"
        " or recipes (their motion alone).",
    ),
    Web(kind=list[str]),
]


@dataclass(frozen=True, slots=True, eq=False)
class LearntModel:
    """A model that was learnt. name : by which `track` takes it. recordings : as they were read."""

    name: str
    path: Path
    model: BehaviourModel
    learnt: Learnt
    recordings: tuple[Recording, ...]


@operation
def learn(
    sources: Annotated[Sources, Web(left_out=True)],
    into: Annotated[
        str,
        Field(description="Name in the workspace's models, or a path."),
        Terminal("--into", "MODEL"),
        Web("name"),
    ],
    *,
    body: Annotated[
        Body, Field(description="Body of the model's poses; default: the workspace's sessions' own.")
    ] = "",
    skeleton: Annotated[
        str | Path | None,
        Field(description="ASF file of the .amc sources; default: NN.asf beside NN_MM.amc."),
        Terminal(metavar="FILE.asf", kind=Path),
    ] = None,
    tests: Annotated[
        Sources,
        Field(description="Sources for the test entropy; default: the last fifth of each source."),
        Terminal("--test", "SOURCES...", kind=Sequence[str]),
    ] = (),
    fps: Annotated[float, Field(ge=5.0, le=240.0, description="Frames per second.")] = FPS,
    knobs: Annotated[
        Values, Knobs(lambda: (*knobs_of(LearningSettings), *knobs_of(OversamplingSettings)))
    ] = None,
    seed: Seed = 0,
    replace: Annotated[
        bool, Field(description="Replace a model of that name."), Terminal("--force"), Web(left_out=True)
    ] = False,
    progress: Reporting = None,
) -> LearntModel:
    """Learn what a body tends to do from recorded motion.

    The sources are put on the body, oversampled with varied smoothing, clustered, and their order is learnt. Nothing is
    written before the model is whole.

    Raises StudioError.
    """
    workspace = Workspace()
    tree = load_body(body or workspace.usual_body(), (workspace.root / BODIES_NAME,))
    place = place_for_model(into, workspace, replace=replace)
    learning, material = settings_of(knobs or {})
    asf = Path(skeleton) if skeleton is not None else None
    with reporting(progress, "Reading motion") as report:
        read = read_sources(sources, tree, asf, fps=fps, workspace=workspace, progress=report)
        tested = None
        if tests:
            tested = read_sources(tests, tree, asf, fps=fps, workspace=workspace, progress=report)
    say(progress, [note for one in (*read, *(tested or ())) for note in one.notes])
    say(progress, [_misfits(one) for one in (*read, *(tested or ())) if one.bad_frames])
    with reporting(progress, "Learning") as report:
        model, learnt = learn_from(read, tree, learning, material, tested, seed=seed, progress=report)
    keep_model(model, place)
    return LearntModel(place.stem, place, model, learnt, read)


def models() -> tuple[ModelSummary, ...]:
    """List the behaviour models of the workspace."""
    return tuple(list_models(Workspace()))


def settings_of(knobs: Mapping[str, object]) -> tuple[LearningSettings, OversamplingSettings]:
    """Knobs of learning and of the training material, distinguished by name. Raises SettingsError."""
    groups = (LearningSettings(), OversamplingSettings())
    known = [{entry.name for entry in knobs_of(type(group))} for group in groups]
    strange = sorted(set(knobs) - known[0] - known[1])
    if strange:
        raise SettingsError(
            f"Learning has no knob '{strange[0]}'.", f"It has: {', '.join(sorted(known[0] | known[1]))}."
        )
    learning, material = ({name: value for name, value in knobs.items() if name in names} for names in known)
    return changed(groups[0], learning), changed(groups[1], material)


def _misfits(recording: Recording) -> str:
    """Which frames of a recording the body cannot follow."""
    bad = recording.bad_frames
    return (
        f"{recording.name}: {len(bad)} of {recording.frame_count} frames fit badly "
        f"({ranges(bad, SHOWN_BAD_FRAMES)}); the others are {recording.rms_mm:.0f} mm off in the mean."
    )
