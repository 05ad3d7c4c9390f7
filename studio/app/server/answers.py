"""Schemas of answers made from the records that verbs return, as bodies of requests are made from their parameters.

A route returns the record itself; its annotation says which. Numbers that are not finite are null, arrays are lists. A
property whose annotation has a Field is an entry as well, which its docstring describes; one that is marked
`Web(left_out=True)` is none.
"""

import dataclasses
import inspect
import types
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Annotated, Any, Union, cast, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from fastapi import APIRouter
from fastapi.datastructures import Default, DefaultPlaceholder
from pydantic import AllowInfNan, BaseModel, BeforeValidator, Field, GetCoreSchemaHandler, create_model
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema
from starlette.responses import Response

from studio.app.server.schemas import Answer, Number, Numbers, finite
from studio.foundations.declaring import Web
from studio.foundations.knobs import Value

Kind = Any
"""A type as an annotation has it."""


OF_ANNOTATION = Default(None)
TypeName = Annotated[str, BeforeValidator(lambda kind: kind.__name__)]


class Router(APIRouter):
    """Routes whose answers are described by what their functions are annotated to return."""

    def add_api_route(
        self,
        path: str,
        endpoint: Callable[..., Any],
        *,
        response_model: Kind = OF_ANNOTATION,
        **more: Any,  # noqa: ANN401 - as FastAPI takes it
    ) -> None:
        if isinstance(response_model, DefaultPlaceholder):
            returned = get_type_hints(endpoint, include_extras=True).get("return")
            if not (isinstance(returned, type) and issubclass(returned, Response)):
                response_model = None if returned is types.NoneType else shown_as(returned)
        super().add_api_route(path, endpoint, response_model=response_model, **more)


class Shown:
    """A mark of a model's field: `Annotated[Record, Shown]` is validated and described as an answer of that record."""

    @staticmethod
    def __get_pydantic_core_schema__(kind: Kind, handler: GetCoreSchemaHandler) -> CoreSchema:
        return handler.generate_schema(shown_as(kind))


def shown_as(kind: Kind) -> Kind:
    """The type in an answer's schema for a type of the studio: records as models, null where a number may be none (not
    for pydantic's FiniteFloat).
    """
    if kind is float:
        return Number
    if kind == Value:
        return kind
    if kind is type:
        return TypeName
    if get_origin(kind) is np.ndarray or kind is np.ndarray:
        return Numbers
    if _fields_of(kind):
        return _model_of(kind)
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        if AllowInfNan(False) in kind.__metadata__:
            return kind
        return Annotated[(shown_as(parts[0]), *kind.__metadata__)]
    if origin in (tuple, list, Sequence, frozenset, set):
        if origin is not tuple:
            return list[shown_as(parts[0])]
        return tuple[tuple(part if part is Ellipsis else shown_as(part) for part in parts)]
    if origin in (dict, Mapping):
        return dict[parts[0], shown_as(parts[1])]
    if origin in (Union, types.UnionType):
        if float in parts:
            # Numbers of numpy are read before one of the types is chosen.
            return Annotated[Union[(*parts, None)], BeforeValidator(finite)]
        return Union[tuple(shown_as(part) for part in parts)]  # noqa: UP007 - of parts known only now
    return kind


@cache
def _model_of(record: type) -> type[BaseModel]:
    """A record's model: the same entries, what it says of itself as description."""
    fields: dict[str, Any] = {
        name: (shown_as(kind), Field(...) if default is _NONE else default)
        for name, kind, default in _fields_of(record)
    }
    return create_model(
        record.__name__, __base__=Answer, __doc__=record.__doc__, __module__=record.__module__, **fields
    )


_NONE = object()


def _fields_of(kind: Kind) -> list[tuple[str, Kind, object]]:
    """Name, type and default of a record's entries; none of what is no record."""
    if not isinstance(kind, type) or issubclass(cast("type[object]", kind), BaseModel):
        return []
    record = cast("Any", kind)
    hints: dict[str, Kind] = get_type_hints(record, include_extras=True)
    if dataclasses.is_dataclass(record):
        defaults = {one.name: _default(one) for one in dataclasses.fields(record)}
    elif issubclass(record, msgspec.Struct):
        defaults = {one.name: _default(one) for one in msgspec.structs.fields(record)}
    else:
        # A NamedTuple.
        given: dict[str, object] = getattr(record, "_field_defaults", {})
        defaults = {name: given.get(name, _NONE) for name in getattr(record, "_fields", ())}
    shown = {name: hints[name] for name in defaults if not _is_left_out(hints[name])}
    own = [(name, one, defaults[name]) for name, one in shown.items()]
    return own and own + [(name, result, _NONE) for name, result in _properties(kind)]


def _is_left_out(kind: Kind) -> bool:
    return any(isinstance(mark, Web) and mark.left_out for mark in getattr(kind, "__metadata__", ()))


def _properties(record: type[object]) -> list[tuple[str, Kind]]:
    """Name and type of a record's properties whose annotation has a Field; their docstrings describe them."""
    of_class = {name: one for base in reversed(record.__mro__) for name, one in vars(base).items()}
    shown: list[tuple[str, Kind]] = []
    for name, one in of_class.items():
        if not isinstance(one, property) or one.fget is None:
            continue
        result = get_type_hints(one.fget, include_extras=True).get("return")
        if any(isinstance(mark, FieldInfo) for mark in getattr(result, "__metadata__", ())):
            shown.append((name, Annotated[result, Field(description=inspect.getdoc(one))]))
    return shown


def _default(entry: Any) -> object:  # noqa: ANN401 - a field of a dataclass or of a struct
    if entry.default_factory not in (dataclasses.MISSING, msgspec.NODEFAULT):
        return Field(default_factory=entry.default_factory)
    return _NONE if entry.default in (dataclasses.MISSING, msgspec.NODEFAULT) else entry.default
