"""A body as the text of a body file."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, cast

import msgspec

from studio.body.definition import BodyDefinition
from studio.body.model import BodyModel
from studio.foundations.errors import BodyError

GROUPS = ("parameters", "joints", "limbs", "markers", "meshes")


def body_text(body: BodyModel) -> str:
    """The body as a file for the reader, with its present dimensions. Raises BodyError without a definition."""
    definition = sized_definition(body)
    entries = {
        key: value
        for key, value in _plain(definition).items()
        if key not in GROUPS and key not in ("dimensions", "title")
    }
    lines = [f"title = {_toml(definition.title)}"]
    lines += [f"{key} = {_toml(value)}" for key, value in entries.items()]
    for group in GROUPS:
        rows = [f"    {_toml(_plain(entry))}," for entry in getattr(definition, group)]
        lines += ["", f"{group} = [", *rows, "]"] if rows else []
    if definition.dimensions:
        lines += ["", "[dimensions]"]
        lines += [f"{name} = {_toml(_plain(entry))}" for name, entry in definition.dimensions.items()]
    return "\n".join(lines) + "\n"


def sized_definition(body: BodyModel) -> BodyDefinition:
    """The body's entries, with its present dimensions as the file's own."""
    if body.definition is None:
        raise BodyError(f"Body '{body.name}' was not read from a file.", "Begin with a body that was.")
    sized = {
        name: msgspec.structs.replace(entry, **{unit_of(entry): body.dimensions[name]})
        for name, entry in body.definition.dimensions.items()
    }
    return msgspec.structs.replace(body.definition, dimensions=sized)


def unit_of(entry: Any) -> str:  # noqa: ANN401 - a DimensionEntry
    return "mm" if entry.mm is not None else "ratio"


def _plain(entry: Any) -> dict[str, Any]:  # noqa: ANN401 - any struct of the definition
    """A struct as a table, without what is as it would be if left out."""
    entries: dict[str, Any] = {}
    for one in msgspec.structs.fields(entry):
        value = getattr(entry, one.name)
        default = one.default if one.default is not msgspec.NODEFAULT else None
        if one.default_factory is not msgspec.NODEFAULT:
            default = one.default_factory()
        if value is None or (not one.required and value == default):
            continue
        entries[one.name] = value
    if "by" in entries:  # of a step, which reads: move, by
        entries["by"] = entries.pop("by")
    return entries


def _toml(value: Any) -> str:  # noqa: ANN401 - of a body file
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, int | float):
        number = float(value)
        return repr(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)
    if isinstance(value, msgspec.Struct):
        return _toml(_plain(value))
    if isinstance(value, Mapping):
        table = cast("Mapping[str, Any]", value)
        inside = ", ".join(f"{key} = {_toml(one)}" for key, one in table.items())
        return f"{{ {inside} }}"
    several: Sequence[Any] = value
    return f"[{', '.join(map(_toml, several))}]"
