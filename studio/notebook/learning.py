"""Behaviour models out of recorded motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from studio.behaviour.model import BehaviourModel
from studio.behaviour.settings import LearningSettings
from studio.body.catalogue import load_body
from studio.errors import SettingsError
from studio.knobs import changed, knobs_of
from studio.notebook.progress import Told, told
from studio.sessions.session import BODIES_NAME
from studio.sessions.workspace import Workspace
from studio.training.learning import Learnt, read_sources
from studio.training.learning import learn as learn_from
from studio.training.model_shelf import keep_model, place_for_model
from studio.training.oversampling import OversamplingSettings
from studio.training.sources import FPS, Recording


@dataclass(frozen=True, slots=True, eq=False)
class LearntModel:
    """A model that was learnt. name : by which `track` takes it. recordings : as they were read."""

    name: str
    path: Path
    model: BehaviourModel
    learnt: Learnt
    recordings: tuple[Recording, ...]


def learn(
    sources: Sequence[str | Path],
    into: str,
    *,
    body: str | None = None,
    skeleton: str | Path | None = None,
    tests: Sequence[str | Path] = (),
    fps: float = FPS,
    seed: int = 0,
    replace: bool = False,
    knobs: Mapping[str, object] | None = None,
    progress: Told = None,
) -> LearntModel:
    """Learn what a body tends to do from recorded motion.

    sources : motion files (.amc .bvh .npz .c3d .trc), folders of them, runs as "SESSION/RUN", recipes. into : a name in
    the workspace's models, or a path. body : default the one that the workspace's sessions have. tests : for the test
    entropy; default the last fifth of each source. Nothing is written before the model is whole. Raises StudioError.
    """
    workspace = Workspace()
    tree = load_body(body or workspace.usual_body(), (workspace.root / BODIES_NAME,))
    place = place_for_model(into, workspace, replace=replace)
    learning, material = settings_of(knobs or {})
    asf = Path(skeleton) if skeleton is not None else None
    with told(progress, "Learning") as report:
        read = read_sources(sources, tree, asf, fps=fps, workspace=workspace, progress=report)
        tested = None
        if tests:
            tested = read_sources(tests, tree, asf, fps=fps, workspace=workspace, progress=report)
        model, learnt = learn_from(read, tree, learning, material, tested, seed=seed, progress=report)
    keep_model(model, place)
    return LearntModel(place.stem, place, model, learnt, read)


def settings_of(knobs: Mapping[str, object]) -> tuple[LearningSettings, OversamplingSettings]:
    """Knobs of learning and of the training material, told apart by name. Raises SettingsError."""
    groups = (LearningSettings(), OversamplingSettings())
    known = [{entry.name for entry in knobs_of(type(group))} for group in groups]
    strange = sorted(set(knobs) - known[0] - known[1])
    if strange:
        raise SettingsError(
            f"Learning has no knob '{strange[0]}'.", f"It has: {', '.join(sorted(known[0] | known[1]))}."
        )
    learning, material = ({name: value for name, value in knobs.items() if name in names} for names in known)
    return changed(groups[0], learning), changed(groups[1], material)
