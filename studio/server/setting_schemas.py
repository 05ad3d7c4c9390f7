"""Knobs, settings and presets, as OpenAPI shows them."""

from pydantic import Field

from studio.server.schemas import Answer, Request, RunName, Value


class KnobView(Answer):
    """The declaration of one knob: all that a slider needs."""

    name: str
    label: str
    kind: str = Field(description="bool, int, float or str.")
    default: Value
    low: float | None
    high: float | None
    step: float | None
    unit: str
    choices: list[str]
    takes_effect: str = Field(description="next layer, next frame or new run.")
    help: str
    group: str


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


class SettingsChange(Answer):
    """When a version of the settings came into use, and which knobs moved."""

    version: int
    frame: int
    layer: int
    changed: list[str]


class SettingsInUse(Answer):
    """A run's settings: the newest version that its frames used, since when it is in use, and all changes before.

    moved : knobs that were moved since and that no stored frame uses; the search goes on with these values.
    """

    tracker: str
    weighting: str
    version: int
    frame: int
    layer: int
    values: dict[str, Value]
    knobs: list[KnobView]
    changes: list[SettingsChange]
    moved: dict[str, Value]


class ResetRequest(Request):
    """Which knobs go back to their defaults; none named means all that may change inside a run."""

    names: list[str] = Field(default_factory=list)


class PresetChoice(Request):
    """A preset by its name."""

    name: str = Field(max_length=64)


class PresetView(Answer):
    """Ready-made settings: a handful of knobs. own: made by a person, so that it can be deleted."""

    name: str
    label: str
    help: str
    values: dict[str, Value]
    own: bool = False


class PresetList(Answer):
    """All presets, the studio's first."""

    presets: list[PresetView]


class PresetRequest(Request):
    """A preset to keep."""

    values: dict[str, Value] = Field(min_length=1, max_length=200)
    help: str = Field("", max_length=300)


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
