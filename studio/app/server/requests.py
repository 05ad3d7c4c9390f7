"""Bodies of requests made from the declarations of verbs."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Annotated, Any, NamedTuple, get_args, get_origin

from fastapi import Depends
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model

from studio.app.server.schemas import RunName
from studio.foundations.declaring import LARGEST, REQUIRED, Parameter, alternatives, declared
from studio.foundations.knobs import Value

MaybeName = Annotated[RunName | None, BeforeValidator(lambda value: None if value == "" else value)]


class Made(NamedTuple):
    """A body that was made of a verb. entries : the verb's parameter by the name of the entry."""

    verb: str
    model: type[BaseModel]
    entries: dict[str, str]


MADE: dict[str, Made] = {}
"""The bodies that were made, by the names of their schemas."""


class Arguments(Mapping[str, Any]):
    """What a body gives a verb: its arguments by name, without those that it leaves to their defaults.

    more : entries of the body that are no parameters.
    """

    def __init__(self, given: Mapping[str, Any], more: Mapping[str, Any]) -> None:
        self._given, self.more = given, more

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - of the parameter's type
        return self._given[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._given)

    def __len__(self) -> int:
        return len(self._given)


def body_of(
    verb: Callable[..., object],
    name: str,
    /,
    *,
    only: Sequence[str] = (),
    without: Sequence[str] = (),
    **more: Any,  # noqa: ANN401 - as pydantic takes fields
) -> Any:  # noqa: ANN401 - a dependency of FastAPI
    """A dependency that reads a verb's request from the body. name : of the schema. only, without : of the verb's
    parameters. more : entries beside these, as (type, default).
    """
    operation = declared(verb)
    entries = {
        entry.web.name or entry.name: entry
        for entry in operation.parameters.values()
        if not entry.web.left_out and entry.name not in without and (not only or entry.name in only)
    }
    # An entry may be called what pydantic's models call something of theirs.
    own = {key: f"{key}_" if hasattr(BaseModel, key) else key for key in entries}
    fields: dict[str, Any] = {own[key]: _field(entry, key) for key, entry in entries.items()}
    model = create_model(
        name, __config__=ConfigDict(extra="forbid"), __doc__=operation.about, **{**more, **fields}
    )
    MADE[name] = Made(operation.name, model, {key: entry.name for key, entry in entries.items()})

    def read(body: BaseModel) -> Arguments:
        given = {entry.name: getattr(body, own[key]) for key, entry in entries.items()}
        return Arguments(
            {one: value for one, value in given.items() if value is not None},
            {key: getattr(body, key) for key in more},
        )

    read.__annotations__["body"] = model
    if not any(entry.is_required() for entry in model.model_fields.values()):
        read.__defaults__ = (model(),)
    return Depends(read)


def _field(entry: Parameter, key: str) -> tuple[Any, Any]:
    kind, default = entry.web.kind or _kind(entry.kind), entry.default
    if kind is RunName and default is not REQUIRED:
        kind, default = MaybeName, None
    if get_origin(kind) in (list, dict) and default is not REQUIRED:
        default = list[object]() if get_origin(kind) is list else dict[str, object]()
    return (
        # A name has limits of its own, and none at all has no length.
        kind if kind is MaybeName else entry.limited(kind),
        Field(... if default is REQUIRED else default, alias=key, description=entry.help),
    )


def _kind(kind: Any) -> Any:  # noqa: ANN401 - a type
    """What a body has for a parameter's type: lists, tables and names; one that may be left out is empty."""
    for one in alternatives(kind):
        origin, parts = get_origin(one), get_args(one)
        if origin is Sequence:
            return list[Annotated[int, Field(le=LARGEST)] if parts[0] is int else parts[0]]
        if origin is Mapping:
            return dict[parts[0], Value if parts[1] is object else parts[1]]
    if str in alternatives(kind):
        return RunName if kind is str else MaybeName
    return kind
