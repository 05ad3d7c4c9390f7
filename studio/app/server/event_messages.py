"""The messages of `WebSocket /api/events`, described for the API's document: `EventMessage`, distinguished by `type`.

A message of the tracking process has the entries of its event (`jobs/events.py`), one of a job those of its state
(`JobKind.states`), its `key` and `at`, the address at which the same is asked for. `event_encoding` and `Job.message`
make them.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaMode, JsonSchemaValue
from pydantic_core import core_schema

from studio.app.scene.model import Selection
from studio.app.server.answers import shown_as
from studio.app.server.event_encoding import TYPES, FrameMessage, LayerMessage
from studio.app.server.scene_routes import LayersPlayed
from studio.operations.jobs.events import Acknowledged, Event, LogLine, SettingsApplied, StateChanged
from studio.operations.jobs.job_runner import JobKind

REFERENCE = "#/components/schemas/{model}"


@dataclass(frozen=True, slots=True)
class Changed(Event):
    """Something of a session or run is not as it was: ask for it again. "" for the list of sessions, for no run."""


@dataclass(frozen=True, slots=True)
class Dropped(Event):
    """count : messages that this watcher was too slow for."""

    count: int


@dataclass(frozen=True, slots=True)
class SceneMoved(Selection):
    """What a window's scene shows, after its own controls changed it. layers : whether and how they are played."""

    layers: LayersPlayed = dataclasses.field(kw_only=True)


MESSAGES: dict[str, type] = {
    **{TYPES[kind]: kind for kind in (StateChanged, Acknowledged, SettingsApplied, LogLine)},
    "layer": shown_as(LayerMessage),
    "frame": shown_as(FrameMessage),
    "scene": SceneMoved,
    "sessions": Changed,
    "notes": Changed,
    "dropped": Dropped,
}


class _AsSent(GenerateJsonSchema):
    """Every entry is sent; NaN becomes null."""

    def float_schema(self, schema: core_schema.FloatSchema) -> JsonSchemaValue:
        return {"anyOf": [{"type": "number"}, {"type": "null"}]}

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def field_is_required(
        self,
        field: core_schema.ModelField | core_schema.DataclassField | core_schema.TypedDictField,
        total: bool,
    ) -> bool:
        return True


def event_schemas(kinds: Sequence[JobKind[Any]]) -> dict[str, Any]:
    """Schemas by name: `EventMessage` of all messages, and its parts. kinds : of jobs, whose states are sent."""
    contents = MESSAGES | {kind.event: kind.states for kind in kinds}
    adapters: list[tuple[str, JsonSchemaMode, TypeAdapter[Any]]] = [
        (name, "serialization", TypeAdapter(content)) for name, content in contents.items()
    ]
    made, known = TypeAdapter.json_schemas(adapters, ref_template=REFERENCE, schema_generator=_AsSent)
    jobs = {kind.event for kind in kinds}
    messages = [
        _message(name, made[name, "serialization"], ("key", "at") if name in jobs else ())
        for name in contents
    ]
    return known["$defs"] | {"EventMessage": {"oneOf": messages}}


def _message(name: str, content: JsonSchemaValue, also: Sequence[str]) -> JsonSchemaValue:
    """The schema of a message: what all have, what else those of its kind have, and its own entries."""
    texts = ("session", "run", *also)
    head = {
        "type": "object",
        "required": ["type", *texts],
        "properties": {"type": {"const": name}, **{text: {"type": "string"} for text in texts}},
    }
    return {"allOf": [head, content]}
