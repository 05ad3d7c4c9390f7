"""Knobs, the settings of a run, and presets.

What is changed here goes the way of the sliders: `StudioControl.change_settings`, the mailbox, the next
layer. What is in use comes back as a `settings` event.
"""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query

from studio.body.catalogue import list_bodies, load_body
from studio.errors import SettingsError, StudioError
from studio.runs.behaviour_models import check_prediction, models_folder, models_in
from studio.sessions.stored_run import StoredRun
from studio.settings import (
    DEFAULT_TRACKER,
    DEFAULT_WEIGHTING,
    all_knobs,
    changed_settings,
    default_settings,
    json_schema,
    settings_from_values,
    values,
)
from studio.tracking.catalogue import TRACKERS
from studio.web.doors import Door, Doors
from studio.web.presets import all_presets, drop_preset, keep_preset, preset
from studio.web.run_routes import RUN, OpenRun, check_free
from studio.web.setting_schemas import (
    BehaviourChoice,
    BodyChoice,
    Choice,
    Choices,
    KnobList,
    PresetChoice,
    PresetList,
    PresetRequest,
    ResetRequest,
    SettingsInUse,
    TrackerChoice,
)
from studio.web.setting_views import knob_views, settings_of
from studio.weighting.catalogue import WEIGHTINGS
from studio.worker import commands

router = APIRouter(prefix="/api", tags=["settings"])

Value = bool | int | float | str


@router.get("/choices")
def choices(doors: Door) -> Choices:
    """Trackers, weightings, bodies, behaviour models and presets that a new run can be made of."""
    folder = doors.workspace.root / "bodies"
    folders = (folder,) if folder.is_dir() else ()
    stamp = tuple((path.name, path.stat().st_mtime_ns) for path in sorted(folder.glob("*.toml")))
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
            BehaviourChoice(
                name=line.name,
                body=line.body,
                clusters=line.clusters,
                states=line.states,
                frames=line.frames,
                problem=line.problem,
            )
            for line in models_in([models_folder(doors.workspace.root)])
        ],
        presets=all_presets(doors.state_folder),
        default_tracker=DEFAULT_TRACKER,
        default_weighting=DEFAULT_WEIGHTING,
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


@router.get(RUN + "/settings")
def settings_in_use(run: OpenRun) -> SettingsInUse:
    """The run's newest settings, since when they are in use, and every change before."""
    return settings_of(run)


@router.patch(RUN + "/settings")
def change_settings(
    run: OpenRun,
    changes: dict[str, Value],
    doors: Door,
    frame: Annotated[int | None, Query(ge=0, description="The frame that is shown.")] = None,
) -> SettingsInUse:
    """Change knobs by name, all or none; a `settings` event says from which layer on they are used.

    While nothing is being tracked, `frame` (else the one annealed last) is annealed again at once.
    """
    return _change(doors, run, changes, frame)


@router.post(RUN + "/settings/reset")
def reset_settings(run: OpenRun, wish: ResetRequest, doors: Door) -> SettingsInUse:
    """Bring knobs back to their defaults."""
    settings = default_settings(run.record.tracker, run.record.weighting)
    defaults = {entry.name: entry.default for entry in all_knobs(settings)}
    for name in wish.names:
        if name not in defaults:
            raise SettingsError(
                f"There is no setting '{name[:64]}'.", f"Known: {', '.join(sorted(defaults))}."
            )
    movable = [entry.name for entry in all_knobs(settings) if entry.takes_effect != "new run"]
    changes = {name: defaults[name] for name in wish.names or movable}
    return _change(doors, run, changes)


@router.post(RUN + "/settings/preset")
def use_preset(run: OpenRun, wish: PresetChoice, doors: Door) -> SettingsInUse:
    """Change the knobs that a preset sets."""
    chosen = preset(wish.name, doors.state_folder)
    return _change(doors, run, chosen.values)


@router.get("/presets")
def presets(doors: Door) -> PresetList:
    """The studio's presets, then a person's own."""
    return PresetList(presets=all_presets(doors.state_folder))


@router.put("/presets/{name}")
def put_preset(name: str, wish: PresetRequest, doors: Door) -> PresetList:
    """Keep settings under a name."""
    keep_preset(name, wish.help, wish.values, doors.state_folder)
    return presets(doors)


@router.delete("/presets/{name}")
def delete_preset(name: str, doors: Door) -> PresetList:
    """Delete a preset of a person's own."""
    drop_preset(name, doors.state_folder)
    return presets(doors)


def _change(
    doors: Doors, run: StoredRun, changes: Mapping[str, Value], frame: int | None = None
) -> SettingsInUse:
    """Check the changes here (the run may not be open yet), then hand them to the tracking process."""
    now = settings_of(run).values
    before = settings_from_values(run.record.tracker, run.record.weighting, now)
    check_prediction(changed_settings(before, changes), bool(run.record.behaviour))
    check_free(doors, run)
    chosen = -1 if frame is None else frame
    doors.control.request(
        commands.ChangeSettings(changes=dict(changes), frame=chosen, **commands.about(run.folder))
    )
    return settings_of(run)


@lru_cache(maxsize=4)
def _bodies(folders: tuple[Path, ...], _stamp: tuple[tuple[str, int], ...]) -> tuple[BodyChoice, ...]:
    """The bodies that can be read; one that cannot is told where it is used."""
    found: list[BodyChoice] = []
    for name in list_bodies(folders):
        try:
            body = load_body(name, folders)
        except StudioError:
            continue
        found.append(
            BodyChoice(name=name, label=body.title, parameters=len(body.parameters), limbs=len(body.drawn))
        )
    return tuple(found)
