"""Knobs, the settings of a run, and presets.

What is changed here goes the way of the sliders: `StudioControl.change_settings`, the mailbox, the next
layer. What is in use comes back as a `settings` event.
"""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import Field

from studio.app.server.app_state import App, AppState
from studio.app.server.presets import PresetView, all_presets, drop_preset, keep_preset, preset
from studio.app.server.run_routes import RUN, OpenRun, check_free
from studio.app.server.schemas import Answer, Request, RunName, Value
from studio.app.server.session_routes import OpenSession
from studio.app.server.setting_views import KnobView, SettingsInUse, knob_views, settings_of
from studio.body.catalogue import body_files, list_bodies, load_body
from studio.body.dimensions import follows_height
from studio.body.subject import DEFAULT_BODY
from studio.foundations.declaring import LARGEST
from studio.foundations.errors import SettingsError, StudioError
from studio.operations.jobs import commands
from studio.operations.own_bodies import body_folders
from studio.runs.behaviour_models import check_prediction, models_folder, models_in
from studio.runs.moved_knobs import settings_with_moved
from studio.runs.pace import stored_pace
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import (
    DEFAULT_TRACKER,
    DEFAULT_WEIGHTING,
    all_knobs,
    changed_settings,
    default_settings,
    json_schema,
    values,
)
from studio.search.trackers.catalogue import TRACKERS
from studio.sessions.stored_run import StoredRun

router = APIRouter(prefix="/api", tags=["settings"])


class KnobList(Answer):
    """The knobs of a tracker with a weighting. json_schema: the same as JSON Schema (2020-12)."""

    tracker: str
    weighting: str
    knobs: list[KnobView]
    values: dict[str, Value]
    json_schema: dict[str, object]


class StoredPaceView(Answer):
    """How long an evaluated pose takes, and beside the search each frame. run: the stored one that tells; empty, and
    the times null, where none does.
    """

    run: str
    milliseconds: float | None
    frame_milliseconds: float | None


class ResetRequest(Request):
    """Which knobs go back to their defaults; none named means all that may change inside a run."""

    names: list[str] = Field(default_factory=list)


class PresetChoice(Request):
    """A preset by its name."""

    name: str = Field(max_length=64)


class PresetList(Answer):
    """All presets, the studio's first."""

    presets: list[PresetView]


class PresetRequest(Request):
    """A preset to keep. tracker, weighting, body: that it is made for; empty fits any that has its knobs."""

    values: dict[str, Value] = Field(min_length=1, max_length=200)
    help: str = Field("", max_length=300)
    tracker: str = Field("", max_length=64)
    weighting: str = Field("", max_length=64)
    body: str = Field("", max_length=64)


class Choice(Answer):
    """Something that has a name and a label."""

    name: str
    label: str


class TrackerChoice(Choice):
    """needs_behaviour : whether a run with it has to have a behaviour model."""

    needs_behaviour: bool = False


class BodyChoice(Answer):
    """A body that runs may use. by_height: whether its lengths follow from a person's height."""

    name: str
    label: str
    parameters: int
    limbs: int
    by_height: bool


class BehaviourChoice(Answer):
    """A behaviour model of the workspace. problem : why it cannot be used, "" if it can."""

    name: str
    body: str
    clusters: int
    states: int
    frames: int
    problem: str


class Choices(Answer):
    """What a new run can be made of. problems : what is wrong with trackers and weightings that packages add."""

    trackers: list[TrackerChoice]
    weightings: list[Choice]
    bodies: list[BodyChoice]
    behaviours: list[BehaviourChoice]
    presets: list[PresetView]
    default_tracker: RunName
    default_weighting: RunName
    default_body: str
    problems: list[str]


@router.get("/choices")
def choices(
    app: App,
    session: Annotated[str, Query(max_length=64, description="Whose own bodies count too.")] = "",
) -> Choices:
    """Trackers, weightings, bodies, behaviour models and presets that a new run can be made of."""
    folders = body_folders(app.workspace, app.workspace.session(session) if session else None)
    stamp = tuple((str(path), path.stat().st_mtime_ns) for folder in folders for path in body_files(folder))
    return Choices(
        trackers=[
            TrackerChoice(
                name=name,
                label=entry.label,
                needs_behaviour=entry.needs_behaviour,
            )
            for name, entry in TRACKERS.items()
        ],
        weightings=[Choice(name=name, label=entry.label) for name, entry in WEIGHTINGS.items()],
        bodies=list(_bodies(folders, stamp)),
        behaviours=[
            BehaviourChoice.model_validate(line) for line in models_in([models_folder(app.workspace.root)])
        ],
        presets=all_presets(app.state_folder),
        default_tracker=DEFAULT_TRACKER,
        default_weighting=DEFAULT_WEIGHTING,
        default_body=DEFAULT_BODY,
        problems=[*TRACKERS.problems, *WEIGHTINGS.problems],
    )


@router.get("/knobs")
def knobs(tracker: str = DEFAULT_TRACKER, weighting: str = DEFAULT_WEIGHTING) -> KnobList:
    """Every knob of a tracker with a weighting, with its default."""
    settings = default_settings(tracker, weighting)
    return KnobList(
        tracker=tracker,
        weighting=weighting,
        knobs=knob_views(settings),
        values=values(settings),
        json_schema=json_schema(settings),
    )


@router.get("/sessions/{session}/pace")
def pace(
    session: OpenSession,
    tracker: str = DEFAULT_TRACKER,
    weighting: str = DEFAULT_WEIGHTING,
    evaluations: Annotated[int, Query(ge=1, description="Of a frame.")] = 1000,
) -> StoredPaceView:
    """How long an evaluated pose and a frame take, judged by a stored run of the session with that likelihood."""
    found = stored_pace(session, tracker, weighting, evaluations)
    if found is None:
        return StoredPaceView(run="", milliseconds=None, frame_milliseconds=None)
    return StoredPaceView(
        run=found.run, milliseconds=found.milliseconds, frame_milliseconds=found.frame_milliseconds
    )


@router.get(RUN + "/settings")
def settings_in_use(run: OpenRun) -> SettingsInUse:
    """The run's newest settings, since when they are in use, and every change before."""
    return settings_of(run)


@router.patch(RUN + "/settings")
def change_settings(
    run: OpenRun,
    changes: dict[str, Value],
    app: App,
    frame: Annotated[int | None, Query(ge=0, le=LARGEST, description="The frame that is shown.")] = None,
) -> SettingsInUse:
    """Change knobs by name, all or none; a `settings` event says from which layer on they are used.

    While nothing is being tracked, `frame` (else the one annealed last) is annealed again at once.
    """
    return _change(app, run, changes, frame)


@router.delete(RUN + "/settings/moved")
def put_back_settings(run: OpenRun, app: App) -> SettingsInUse:
    """Put the knobs that were moved, and that no stored frame uses, back to the run's newest settings."""
    check_free(app, run)
    app.control.request(commands.PutBackSettings(**commands.about(run.folder)))
    return settings_of(run)


@router.post(RUN + "/settings/reset")
def reset_settings(run: OpenRun, request: ResetRequest, app: App) -> SettingsInUse:
    """Bring knobs back to their defaults."""
    settings = default_settings(run.record.tracker, run.record.weighting)
    defaults = {entry.name: entry.default for entry in all_knobs(settings)}
    for name in request.names:
        if name not in defaults:
            raise SettingsError(
                f"There is no setting '{name[:64]}'.", f"Known: {', '.join(sorted(defaults))}."
            )
    movable = [entry.name for entry in all_knobs(settings) if entry.takes_effect != "new run"]
    changes = {name: defaults[name] for name in request.names or movable}
    return _change(app, run, changes)


@router.post(RUN + "/settings/preset")
def use_preset(run: OpenRun, request: PresetChoice, app: App) -> SettingsInUse:
    """Change the knobs that a preset sets, but for those that a run keeps; refused where it is made for another tracker
    or likelihood.
    """
    chosen = preset(request.name, app.state_folder)
    tracker, weighting = run.record.tracker, run.record.weighting
    if not chosen.fits(tracker, weighting):
        made_for = " with ".join(name for name in (chosen.tracker, chosen.weighting) if name)
        raise SettingsError(
            f"The preset '{chosen.name}' is made for {made_for}, this run is tracked by {tracker} with {weighting}.",
            "Begin a new run with the preset.",
        )
    known = {entry.name: entry for entry in all_knobs(default_settings(tracker, weighting))}
    kept = {name for name, entry in known.items() if entry.takes_effect == "new run"}
    return _change(app, run, {name: value for name, value in chosen.values.items() if name not in kept})


@router.get("/presets")
def presets(app: App) -> PresetList:
    """The studio's presets, then a person's own."""
    return PresetList(presets=all_presets(app.state_folder))


@router.put("/presets/{name}")
def put_preset(name: str, request: PresetRequest, app: App) -> PresetList:
    """Keep settings under a name."""
    made_for = {"tracker": request.tracker, "weighting": request.weighting, "body": request.body}
    keep_preset(name, request.help, request.values, app.state_folder, **made_for)
    return presets(app)


@router.delete("/presets/{name}")
def delete_preset(name: str, app: App) -> PresetList:
    """Delete a preset of a person's own."""
    drop_preset(name, app.state_folder)
    return presets(app)


def _change(
    app: AppState, run: StoredRun, changes: Mapping[str, Value], frame: int | None = None
) -> SettingsInUse:
    """Check the changes here (the run may not be open yet), then hand them to the tracking process."""
    check_prediction(changed_settings(settings_with_moved(run), changes), bool(run.record.behaviour))
    check_free(app, run)
    chosen = -1 if frame is None else frame
    app.control.request(
        commands.ChangeSettings(changes=dict(changes), frame=chosen, **commands.about(run.folder))
    )
    return settings_of(run)


@lru_cache(maxsize=4)
def _bodies(folders: tuple[Path, ...], _stamp: tuple[tuple[str, int], ...]) -> tuple[BodyChoice, ...]:
    """The bodies that can be read; one that cannot is named where it is used."""
    found: list[BodyChoice] = []
    for name in list_bodies(folders):
        try:
            body = load_body(name, folders)
        except StudioError:
            continue
        found.append(
            BodyChoice(
                name=name,
                label=body.title,
                parameters=len(body.parameters),
                limbs=len(body.drawn),
                by_height=follows_height(body),
            )
        )
    return tuple(found)
