"""Behaviour models out of recorded motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, FiniteFloat

from studio.body.catalogue import list_bodies, load_body
from studio.foundations.declaring import Terminal, Web, operation, taking
from studio.foundations.errors import BehaviourError, NotFoundError
from studio.foundations.knobs import Knob, knobs_of
from studio.operations.jobs.learning_process import LearningOptions, LearningOrder, LearningProgress, Sources
from studio.operations.model_repository import list_models, place_for_model
from studio.operations.progress import Reporting, reporting, say
from studio.results.drawing_footage.recipe_file import recipe_names
from studio.results.motion_sources import read_sources
from studio.runs.behaviour_models import SUFFIX, ModelSummary, models_folder
from studio.runs.learning.learning import Learnt
from studio.runs.learning.learning import learn as learn_from
from studio.runs.learning.oversampling import OversamplingSettings
from studio.runs.learning.recordings import FPS, MOTION_FILES, Recording
from studio.runs.live.live_summary import in_words as ranges
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_file import write_model
from studio.search.behaviour.settings import LearningSettings
from studio.sessions.archives import ENDINGS, unpacked
from studio.sessions.names import checked_name
from studio.sessions.session import BODIES_NAME
from studio.sessions.workspace import Workspace

SKELETON = ".asf"
SHOWN_BAD_FRAMES = 12


@dataclass(frozen=True, slots=True, eq=False)
class LearntModel:
    """A behaviour model that was learnt.

    name : by which `track` takes it.
    path : its file.
    model : the model itself.
    learnt : counts and entropies of the learning.
    recordings : the sources as they were read.
    """

    name: str
    path: Path
    model: BehaviourModel
    learnt: Learnt
    recordings: tuple[Recording, ...]


@operation
@taking(LearningOptions)
def learn(
    sources: Annotated[Sources, Web(left_out=True)],
    into: Annotated[
        str,
        Field(description="Name in the workspace's models, or a path."),
        Terminal("--into", "MODEL"),
        Web("name"),
    ],
    *,
    skeleton: Annotated[
        str | Path | None,
        Field(description="ASF file of the .amc sources; default: NN.asf beside NN_MM.amc."),
        Terminal(metavar="FILE.asf", kind=Path),
    ] = None,
    replace: Annotated[
        bool, Field(description="Replace a model of that name."), Terminal("--force"), Web(left_out=True)
    ] = False,
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> LearntModel:
    """Learn how a body tends to move from recorded motion.

    The recordings are fitted to the body, oversampled with varied smoothing and clustered; then the order of the
    clusters is learnt (Caillette, Galata & Howard 2007, sections 3.2, 4 and 7.1). Nothing is written before the model
    is complete.

    Raises StudioError for sources that hold no motion of the body, BehaviourError for a name that is taken,
    SettingsError for an unknown knob.
    """
    wanted, workspace = LearningOptions(**options), Workspace()
    tree = load_body(wanted.body or workspace.usual_body(), (workspace.root / BODIES_NAME,))
    place = place_for_model(into, workspace, replace=replace)
    settings = wanted.settings()
    asf = Path(skeleton) if skeleton is not None else None
    with reporting(progress, "Reading motion") as report:
        read = partial(read_sources, fps=wanted.fps, workspace=workspace, progress=report)
        recordings = read(sources, tree, asf)
        tested = read(wanted.tests, tree, asf) if wanted.tests else None
    say(progress, [note for one in (*recordings, *(tested or ())) for note in one.notes])
    say(progress, [_misfits(one) for one in (*recordings, *(tested or ())) if one.bad_frames])
    with reporting(progress, "Learning") as report:
        model, learnt = learn_from(recordings, tree, *settings, tested, seed=wanted.seed, progress=report)
    write_model(model, place)
    return LearntModel(place.stem, place, model, learnt, recordings)


@dataclass(frozen=True, slots=True)
class LearningChoices:
    """What the form for learning offers.

    knobs : group after group.
    endings : of motion files.
    recipes : bundled recipes with a person.
    progress : of the learning under way or the last one; null before the first.
    """

    knobs: tuple[Knob, ...]
    bodies: tuple[str, ...]
    default_body: str
    fps: FiniteFloat
    endings: tuple[str, ...]
    recipes: tuple[str, ...]
    progress: LearningProgress | None


def learning_choices(workspace: Workspace, progress: LearningProgress | None) -> LearningChoices:
    """What the form for learning offers. progress : of the learning under way."""
    return LearningChoices(
        knobs=(*knobs_of(LearningSettings), *knobs_of(OversamplingSettings)),
        bodies=list_bodies((workspace.root / BODIES_NAME,)),
        default_body=workspace.usual_body(),
        fps=FPS,
        endings=(*MOTION_FILES, SKELETON, *ENDINGS),
        recipes=recipe_names(),
        progress=progress,
    )


def learning_order(
    workspace: Workspace, name: str, sources: Sequence[str], upload: Path | None, options: LearningOptions
) -> LearningOrder:
    """The checked order for a learning.

    sources : runs as SESSION/RUN, and recipes.
    upload : a folder of motion files.

    Raises StudioError where the name is taken, a source does not exist, or a knob is wrong.
    """
    wanted = replace(options, body=options.body or workspace.usual_body())
    if (models_folder(workspace.root) / f"{checked_name(name, 'model')}{SUFFIX}").exists():
        raise BehaviourError(
            f"There is a model '{name}' already.", "Choose another name, or delete that one first."
        )
    load_body(wanted.body, (workspace.root / BODIES_NAME,))
    for source in (*sources, *wanted.tests):
        _check_source(str(source), workspace)
    order = LearningOrder(workspace.root, name, (*sources, *(_motion_in(upload) if upload else ())), wanted)
    if not order.sources:
        raise BehaviourError("There is nothing to learn from.", "Choose runs, or motion files to upload.")
    wanted.settings()
    return order


def _check_source(source: str, workspace: Workspace) -> None:
    """A run of the workspace or a bundled recipe, never a path. Raises NotFoundError, NameRefused."""
    if source in recipe_names():
        return
    session, slash, run = source.partition("/")
    if not slash:
        raise NotFoundError(
            f"There is no source '{source[:80]}'.", "Name a run as SESSION/RUN, or upload motion files."
        )
    workspace.session(session).run(run)


def _motion_in(folder: Path) -> tuple[str, ...]:
    """The motion files of an upload, out of its archive if it is one. Raises BehaviourError where there are none."""
    files = [path for path in unpacked(folder).rglob("*") if path.is_file()]
    motion = sorted(str(path) for path in files if path.suffix.lower() in MOTION_FILES)
    if not motion:
        raise BehaviourError(
            "The uploaded files hold no motion.", f"Motion files end in {', '.join(MOTION_FILES)}."
        )
    return tuple(motion)


def models() -> tuple[ModelSummary, ...]:
    """List the behaviour models of the workspace."""
    return list_models(Workspace())


def _misfits(recording: Recording) -> str:
    """Which frames of a recording the body cannot follow."""
    bad = recording.bad_frames
    return (
        f"{recording.name}: {len(bad)} of {recording.frame_count} frames fit badly "
        f"({ranges(bad, SHOWN_BAD_FRAMES)}); the others are {recording.rms_mm:.0f} mm off in the mean."
    )
