"""Files behind an address such as s3://bucket/folder, through fsspec: listed, copied, put, and refused in words.

`file://` addresses are folders of this machine (`folder_of`) and need nothing of this.
"""

import importlib
import importlib.util
import re
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote, urlsplit
from urllib.request import url2pathname

from studio.foundations.errors import NotFoundError, SessionError, StudioError
from studio.sessions.atomic_files import PARTIAL_PREFIX
from studio.sessions.names import place_in, relative_path

ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
INSTALL = 'Install it on all machines: pip install "capture-studio[remote]"'
TOGETHER = 32
"""Files copied at once: a folder of pictures would wait for each otherwise."""
STAMPS = ("ETag", "etag", "md5Hash", "md5", "mtime", "LastModified", "last_modified", "updated", "created")
"""What stores call that which another content of a file changes, the surest first."""


@dataclass(frozen=True, slots=True)
class Listed:
    """A file of a store. size : bytes. stamp : another one where the content is another."""

    size: int
    stamp: str


def is_address(place: str | Path) -> bool:
    """Whether a place is an address of a store; `file://` is one of a folder."""
    return bool(ADDRESS.match(str(place)))


def folder_of(place: str) -> str:
    """The folder that a `file://` address means; any other place as it is."""
    if not place.lower().startswith("file://"):
        return place
    return url2pathname(unquote(urlsplit(place).path))


def below(address: str, *parts: str) -> str:
    """An address further down."""
    return "/".join((address.rstrip("/"), *parts))


def above(place: str) -> str:
    """The folder that holds a path, the address that holds another; a bucket's is its own."""
    if not is_address(place):
        return str(Path(place).parent)
    scheme, _, path = place.partition("://")
    parent = str(PurePosixPath(path).parent)
    return place if parent in (".", "/") else f"{scheme}://{parent}"


class Store:
    """The files below an address. Names are relative to it, with forward slashes.

    Raises SessionError where what speaks its protocol is missing; every method raises it where the store refuses.
    """

    def __init__(self, address: str) -> None:
        self.address = address.rstrip("/")
        if importlib.util.find_spec("fsspec") is None:
            raise SessionError(f"'{address}' needs fsspec, which is not installed.", INSTALL)
        try:
            self._files, self._root = importlib.import_module("fsspec.core").url_to_fs(self.address)
        except ImportError as problem:
            raise SessionError(
                f"'{address}' needs a package that is not installed ({problem}).",
                f"That of S3 comes with the studio. {INSTALL}",
            ) from None
        except ValueError as problem:
            raise SessionError(
                f"'{address}' is no address of a store ({problem}).",
                "Write one that fsspec knows, such as s3://BUCKET/sessions/NAME.",
            ) from None

    def listed(self) -> dict[str, Listed]:
        """All files by name, but those that are being worked with (`.partial-…`). Empty where there is nothing.

        Raises PathRefused for a name that leads elsewhere.
        """
        with self._talking():
            self._files.invalidate_cache()
            try:
                files: Mapping[str, Mapping[str, Any]] = self._files.find(self._root, detail=True)
            except FileNotFoundError:
                return {}
        start = len(self._root.rstrip("/")) + 1
        # A store may list the folder itself, as an empty file of its name.
        names = {path: path[start:] for path in files if path[start:] and not path.endswith("/")}
        names = {path: name for path, name in names.items() if f"/{PARTIAL_PREFIX}" not in f"/{name}"}
        return {
            str(relative_path(name)): Listed(int(files[path].get("size") or 0), _stamp(files[path]))
            for path, name in names.items()
        }

    def folders(self) -> tuple[str, ...]:
        """Names of the folders directly below."""
        with self._talking():
            self._files.invalidate_cache()
            try:
                inside: Iterable[Mapping[str, Any]] = self._files.ls(self._root, detail=True)
            except FileNotFoundError:
                raise NotFoundError(f"There is nothing at '{self.address}'.", "Check the address.") from None
            return tuple(
                sorted(
                    PurePosixPath(one["name"].rstrip("/")).name
                    for one in inside
                    if one["type"] == "directory"
                )
            )

    def has(self, name: str) -> bool:
        """Whether there is a file of that name now."""
        with self._talking():
            self._files.invalidate_cache()
            return bool(self._files.exists(below(self._root, name)))

    def read(self, name: str) -> bytes:
        """A small file's content. Raises NotFoundError."""
        with self._talking():
            try:
                return self._files.cat_file(below(self._root, name))
            except FileNotFoundError:
                raise NotFoundError(
                    f"There is no '{below(self.address, name)}'.", "Check the address."
                ) from None

    def write(self, name: str, content: bytes) -> None:
        """Write a small file; on an object store it appears completely or not at all."""
        with self._talking():
            self._files.pipe_file(below(self._root, name), content)

    def remove(self, names: Iterable[str]) -> None:
        """Delete files; missing ones are ignored."""
        with self._talking():
            for name in names:
                try:
                    self._files.rm_file(below(self._root, name))
                except FileNotFoundError:
                    continue

    def bring(self, files: Mapping[str, Listed], folder: Path, on_bytes: Callable[[int], None]) -> None:
        """Copy files into a folder of this machine. on_bytes : called with how many came.

        Raises SessionError where one did not come whole.
        """
        places = {name: place_in(folder, PurePosixPath(name)) for name in files}
        for names in _portions(list(files)):
            for name in names:
                places[name].parent.mkdir(parents=True, exist_ok=True)
            with self._talking():
                self._files.get(
                    [below(self._root, name) for name in names], [str(places[name]) for name in names]
                )
            for name in names:
                came = places[name].stat().st_size if places[name].is_file() else 0
                if came != files[name].size:
                    raise SessionError(
                        f"'{below(self.address, name)}' came with {came} of {files[name].size} bytes.",
                        "Somebody puts it there just now, or the line broke: try again.",
                    )
            on_bytes(sum(files[name].size for name in names))

    def put(self, files: Mapping[str, Path], on_bytes: Callable[[int], None]) -> None:
        """Copy files of this machine to the store, by their names there."""
        for names in _portions(list(files)):
            with self._talking():
                self._files.put(
                    [str(files[name]) for name in names], [below(self._root, name) for name in names]
                )
            on_bytes(sum(files[name].stat().st_size for name in names))

    @contextmanager
    def _talking(self) -> Generator[None]:
        """What a store refuses, in words."""
        try:
            yield
        except StudioError:
            raise
        except Exception as problem:
            raise _refused(self.address, problem) from None


def _refused(address: str, problem: Exception) -> SessionError:
    kind, text = type(problem).__name__, str(problem).strip().partition("\n")[0][:200]
    if "Credential" in kind or "Token" in kind or isinstance(problem, PermissionError):
        return SessionError(
            f"The store of '{address}' refuses access ({text or kind}).",
            "Give every machine the credentials that the store's own tools use (AWS_ACCESS_KEY_ID and"
            " AWS_SECRET_ACCESS_KEY, or a profile), with the right to read and write there.",
        )
    if isinstance(problem, FileNotFoundError):
        return NotFoundError(
            f"There is no such bucket or folder: '{address}' ({text or kind}).",
            "Make the bucket with the store's own tools, or check the address and AWS_ENDPOINT_URL.",
        )
    return SessionError(
        f"The store of '{address}' does not do what it should ({kind}: {text}).",
        "Check that it can be reached (for S3: AWS_ENDPOINT_URL), then try again.",
    )


def _stamp(entry: Mapping[str, Any]) -> str:
    known = next((str(entry[name]) for name in STAMPS if entry.get(name)), "")
    return f"{entry.get('size')}-{known}"


def _portions(names: list[str]) -> Iterable[list[str]]:
    return (names[at : at + TOGETHER] for at in range(0, len(names), TOGETHER))
