"""The choices for a new run."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from studio.body.catalogue import body_files, list_bodies, load_body
from studio.body.dimensions import follows_height
from studio.body.subject import DEFAULT_BODY
from studio.foundations.errors import StudioError
from studio.operations.own_bodies import body_folders
from studio.operations.presets import PresetView
from studio.runs.behaviour_models import ModelSummary, models_folder, models_in
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING
from studio.search.trackers.catalogue import TRACKERS
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


@dataclass(frozen=True, slots=True)
class Choice:
    """A name with a label."""

    name: str
    label: str


@dataclass(frozen=True, slots=True)
class TrackerChoice(Choice):
    """A tracker. needs_behaviour : whether a run with it needs a behaviour model."""

    needs_behaviour: bool


@dataclass(frozen=True, slots=True)
class BodyChoice(Choice):
    """A body that runs may use. by_height : whether its lengths follow from a person's height."""

    parameters: int
    limbs: int
    by_height: bool


@dataclass(frozen=True, slots=True)
class Choices:
    """The choices for a new run. problems : faults of trackers and likelihoods that packages add."""

    trackers: list[TrackerChoice]
    weightings: list[Choice]
    bodies: tuple[BodyChoice, ...]
    behaviours: tuple[ModelSummary, ...]
    presets: list[PresetView]
    default_tracker: str
    default_weighting: str
    default_body: str
    problems: list[str]


def choices_of(workspace: Workspace, session: Session | None, presets: list[PresetView]) -> Choices:
    """Trackers, likelihoods, bodies (a session's own, too), behaviour models and presets for a new run."""
    folders = body_folders(workspace, session)
    stamp = tuple((str(path), path.stat().st_mtime_ns) for folder in folders for path in body_files(folder))
    return Choices(
        trackers=[TrackerChoice(name, one.label, one.needs_behaviour) for name, one in TRACKERS.items()],
        weightings=[Choice(name, one.label) for name, one in WEIGHTINGS.items()],
        bodies=_bodies(folders, stamp),
        behaviours=models_in([models_folder(workspace.root)]),
        presets=presets,
        default_tracker=DEFAULT_TRACKER,
        default_weighting=DEFAULT_WEIGHTING,
        default_body=DEFAULT_BODY,
        problems=[*TRACKERS.problems, *WEIGHTINGS.problems],
    )


@lru_cache(maxsize=4)
def _bodies(folders: tuple[Path, ...], _stamp: tuple[tuple[str, int], ...]) -> tuple[BodyChoice, ...]:
    """The bodies that can be read; a fault is named where the body is used."""
    bodies: list[BodyChoice] = []
    for name in list_bodies(folders):
        try:
            body = load_body(name, folders)
        except StudioError:
            continue
        sizes = len(body.parameters), len(body.drawn)
        bodies.append(BodyChoice(name, body.title, *sizes, follows_height(body)))
    return tuple(bodies)
