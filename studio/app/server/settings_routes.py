"""Knobs, the settings of a run, and presets.

What is changed here goes the way of the sliders: `StudioControl.change_settings`, the mailbox, the next
layer. What is in use comes back as a `settings` event.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from fastapi import Query
from pydantic import Field

from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState
from studio.app.server.run_routes import RUN, RunInPath, check_free
from studio.app.server.schemas import Request
from studio.app.server.session_routes import OpenSession
from studio.foundations.declaring import LARGEST
from studio.foundations.knobs import Value
from studio.operations.jobs import commands
from studio.operations.presets import PresetView, all_presets, drop_preset, keep_preset
from studio.operations.run_choices import Choices, choices_of
from studio.operations.run_settings import (
    KnobList,
    SettingsInUse,
    check_changes,
    defaults_of,
    expected_pace,
    knobs_of_tracker,
    settings_of,
    values_of_preset,
)
from studio.runs.pace import StoredPace
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING
from studio.sessions.stored_run import StoredRun

router = Router(prefix="/api", tags=["settings"])


class ResetRequest(Request):
    """Which knobs go back to their defaults; none named means all that may change inside a run."""

    names: list[str] = Field(default_factory=list)


class PresetChoice(Request):
    """A preset by its name."""

    name: str = Field(max_length=64)


@dataclass(frozen=True, slots=True)
class PresetList:
    """All presets, the studio's first."""

    presets: list[PresetView]


class PresetRequest(Request):
    """A preset to keep. tracker, weighting, body: that it is made for; empty fits any that has its knobs."""

    values: dict[str, Value] = Field(min_length=1, max_length=200)
    help: str = Field("", max_length=300)
    tracker: str = Field("", max_length=64)
    weighting: str = Field("", max_length=64)
    body: str = Field("", max_length=64)


@router.get("/choices")
def choices(
    app: App, session: Annotated[str, Query(max_length=64, description="Whose own bodies count too.")] = ""
) -> Choices:
    """Trackers, weightings, bodies, behaviour models and presets that a new run can be made of."""
    opened = app.workspace.session(session) if session else None
    return choices_of(app.workspace, opened, all_presets(app.state_folder))


@router.get("/knobs")
def knobs(tracker: str = DEFAULT_TRACKER, weighting: str = DEFAULT_WEIGHTING) -> KnobList:
    """Every knob of a tracker with a weighting, with its default."""
    return knobs_of_tracker(tracker, weighting)


@router.get("/sessions/{session}/pace")
def pace(
    session: OpenSession,
    tracker: str = DEFAULT_TRACKER,
    weighting: str = DEFAULT_WEIGHTING,
    evaluations: Annotated[int, Query(ge=1, description="Of a frame.")] = 1000,
) -> StoredPace:
    """How long a pose and a frame take, by a stored run of the session with that likelihood; null without one."""
    return expected_pace(session, tracker, weighting, evaluations)


@router.get(RUN + "/settings")
def settings_in_use(run: RunInPath) -> SettingsInUse:
    """The run's newest settings, since when they are in use, and every change before."""
    return settings_of(run)


@router.patch(RUN + "/settings")
def change_settings(
    run: RunInPath,
    changes: dict[str, Value],
    app: App,
    frame: Annotated[int | None, Query(ge=0, le=LARGEST, description="The frame that is shown.")] = None,
) -> SettingsInUse:
    """Change knobs by name, all or none; a `settings` event says from which layer on they are used.

    While nothing is being tracked, `frame` (else the one annealed last) is annealed again at once.
    """
    return _change(app, run, changes, frame)


@router.delete(RUN + "/settings/moved")
def put_back_settings(run: RunInPath, app: App) -> SettingsInUse:
    """Put the knobs that were moved, and that no stored frame uses, back to the run's newest settings."""
    check_free(app, run)
    app.control.request(commands.PutBackSettings(**commands.about(run.folder)))
    return settings_of(run)


@router.post(RUN + "/settings/reset")
def reset_settings(run: RunInPath, request: ResetRequest, app: App) -> SettingsInUse:
    """Bring knobs back to their defaults."""
    return _change(app, run, defaults_of(run, request.names))


@router.post(RUN + "/settings/preset")
def use_preset(run: RunInPath, request: PresetChoice, app: App) -> SettingsInUse:
    """Change the knobs of a preset that a run allows; refused where it is made for another tracker or likelihood."""
    return _change(app, run, values_of_preset(run, request.name, app.state_folder))


@router.get("/presets")
def presets(app: App) -> PresetList:
    """The studio's presets, then a person's own."""
    return PresetList(all_presets(app.state_folder))


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
    check_changes(run, changes)
    check_free(app, run)
    chosen = -1 if frame is None else frame
    app.control.request(
        commands.ChangeSettings(changes=dict(changes), frame=chosen, **commands.about(run.folder))
    )
    return settings_of(run)
