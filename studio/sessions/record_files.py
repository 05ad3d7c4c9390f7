"""The JSON files that describe a session, a run or a comparison: read whole or refused with the reason, written in one
step.
"""

from pathlib import Path
from typing import TypeVar

import msgspec

from studio.errors import NotFoundError, SessionError
from studio.foreign_files import check_regular
from studio.sessions.atomic_files import write_bytes
from studio.typed_decoding import decode_json

Record = TypeVar("Record", bound=msgspec.Struct)


def read_record(
    path: Path, record_type: type[Record], schema: int, *, missing: tuple[str, str], what: str, remedy: str
) -> Record:
    """The record in a file.

    schema : the newest version that this studio knows. missing : cause and remedy where there is no file; what,
    remedy : what the file should be, and what to do where it is not. Raises NotFoundError, SessionError.
    """
    check_regular(path, SessionError)
    try:
        content = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        raise NotFoundError(*missing) from None
    except OSError as error:
        raise SessionError(
            f"'{path}' cannot be read ({error.strerror}).", "Check the folder's permissions."
        ) from None
    _check_schema(content, path, schema, remedy)
    try:
        return decode_json(content, record_type)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise SessionError(f"'{path}' is not {what}: {error}.", remedy) from None


def write_record(path: Path, record: msgspec.Struct) -> None:
    """Write a record as indented JSON that ends with a line break, in one step."""
    write_bytes(path, msgspec.json.format(msgspec.json.encode(record), indent=2) + b"\n")


class _SchemaOnly(msgspec.Struct):
    schema: int = 0


def _check_schema(content: bytes, path: Path, known: int, remedy: str) -> None:
    """Raises SessionError if the record was written by a newer studio, or is none."""
    try:
        found = decode_json(content, _SchemaOnly).schema
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise SessionError(f"'{path}' cannot be read: {error}.", remedy) from None
    if found > known:
        raise SessionError(
            f"'{path}' has schema version {found}, this studio knows versions up to {known}.",
            "Open it with a newer studio.",
        )
