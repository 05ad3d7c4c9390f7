"""The JSON files that describe a session, a run or a comparison: read whole or refused with the reason, written in one
step. Each kind has a version, and files of older versions are brought to today's when they are read.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec

from studio.foundations.errors import NotFoundError, SessionError
from studio.foundations.foreign_files import LARGEST_RECORD, read_file
from studio.foundations.typed_decoding import decode_json
from studio.sessions.atomic_files import write_bytes

Record = TypeVar("Record", bound=msgspec.Struct)
Entries = dict[str, Any]


class _Head(msgspec.Struct):
    schema: int = 1


def _nothing(_: msgspec.Struct) -> str:
    return ""


@dataclass(frozen=True, slots=True)
class RecordFile(Generic[Record]):
    """One kind of record.

    type : with the entry `schema`, the version. what, remedy : the name of the content, and the remedy for an invalid
    file. missing : cause and remedy without a file; {folder} and {name} stand for its folder. version : the newest,
    which is written; files without one are of version 1. impossible : what no such record can say, a clause; "" for
    nothing. migrations : version to what makes a file's entries those of
    the next version.
    """

    type: type[Record]
    what: str
    remedy: str
    missing: tuple[str, str]
    version: int = 1
    migrations: Mapping[int, Callable[[Entries], Entries]] = field(
        default_factory=dict[int, Callable[[Entries], Entries]]
    )
    impossible: Callable[[Record], str] = _nothing

    def read(self, path: Path, default: Record | None = None) -> Record:
        """The record in a file, `default` where there is none. Raises NotFoundError without one, SessionError."""
        try:
            content = read_file(path, LARGEST_RECORD)
        except (FileNotFoundError, NotADirectoryError):
            if default is not None:
                return default
            named = {"folder": path.parent, "name": path.parent.name}
            raise NotFoundError(*(text.format(**named) for text in self.missing)) from None
        except OSError as error:
            raise SessionError(
                f"'{path}' cannot be read ({error.strerror}).", "Check the folder's permissions."
            ) from None
        try:
            written = decode_json(content, _Head).schema
        except msgspec.DecodeError as error:
            raise SessionError(f"'{path}' cannot be read: {error}.", self.remedy) from None
        if written > self.version:
            raise SessionError(
                f"'{path}' has schema version {written}, this studio knows versions up to {self.version}.",
                "Open it with a newer studio.",
            )
        try:
            if written == self.version:
                record = decode_json(content, self.type)
            else:
                record = msgspec.convert(self._migrated(decode_json(content, Entries), written), self.type)
        except (msgspec.DecodeError, LookupError, TypeError, ValueError) as error:
            raise SessionError(f"'{path}' is not {self.what}: {error}.", self.remedy) from None
        if wrong := self.impossible(record):
            raise SessionError(f"'{path}' is not {self.what}: it says {wrong}.", self.remedy)
        return record

    def write(self, path: Path, record: Record) -> None:
        """Write a record as indented JSON that ends with a line break, in one step."""
        write_bytes(path, msgspec.json.format(msgspec.json.encode(record), indent=2) + b"\n")

    def _migrated(self, entries: Entries, written: int) -> Entries:
        for version in range(max(written, 1), self.version):
            entries = self.migrations[version](entries)
        return entries | {"schema": self.version}


def renamed(**names: str) -> Callable[[Entries], Entries]:
    """A migration that gives entries other names: renamed(old="new")."""
    return lambda entries: {names.get(name, name): value for name, value in entries.items()}
