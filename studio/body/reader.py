"""Body files: reading, with errors that name the file, the entry and the remedy."""

import re
from pathlib import Path

import msgspec

from studio.body.assembly import assemble
from studio.body.definition import BodyDefinition
from studio.body.model import BodyModel
from studio.body.validation import check_definition
from studio.errors import BodyError
from studio.foreign_files import foreign_file
from studio.typed_decoding import decode_toml


def read_body(path: Path) -> BodyModel:
    """The body of a TOML file (format: `definition.py`), named like the file, with the file's own dimensions.

    Raises BodyError when the file cannot be read, is no TOML, or does not describe a body.
    """
    with foreign_file(path, BodyError, "a body file", "Check that it is a text file, or correct it."):
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as problem:
            hint = "Check the path and that it is a text file."
            raise BodyError(f"Body file {path} cannot be read ({problem}).", hint) from None
        return parse_body(text, path.stem, path.name)


def parse_body(text: str, name: str, file: str) -> BodyModel:
    """The body of a TOML text; `file` is what errors call it."""
    try:
        definition = decode_toml(text, BodyDefinition)
    except msgspec.ValidationError as problem:
        cause = f"Body file {file}: {_with_names(text, str(problem))}."
        raise BodyError(
            cause, "The format is described in the guide and in studio/body/definition.py."
        ) from None
    except msgspec.DecodeError as problem:
        raise BodyError(
            f"Body file {file} is not valid TOML: {problem}.", "Correct the line it names."
        ) from None
    check_definition(definition, file)
    dimensions = {key: entry.value for key, entry in definition.dimensions.items()}
    return assemble(definition, name, dimensions)


def _with_names(text: str, problem: str) -> str:
    """msgspec's message with "$.joints[3].parent" written as "joint 'left_shin', parent"."""
    place = re.search(r"\$\.(\w+)\[(\d+)\]\.?(\S*)$", problem.replace("`", ""))
    if place is None:
        return problem.replace("`", "'")
    group, index, rest = place.group(1), int(place.group(2)), place.group(3)
    entries = msgspec.toml.decode(text).get(group)
    name = entries[index].get("name", f"number {index + 1}") if isinstance(entries, list) else index
    cause = problem.replace("`", "'").split(" - at ")[0]
    return f"{group.removesuffix('s')} '{name}'{', ' + rest if rest else ''}: {cause}"
