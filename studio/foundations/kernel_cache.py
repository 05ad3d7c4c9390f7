# pyright: standard
"""Compiled kernels, kept on this machine and found by what they are made of.

A kernel's key is its bytecode, options and argument types, with every function, constant and array that it names, and
what those name. So a kernel that a change reaches is compiled again, wherever the change was (Numba's own cache looks
at the kernel's file alone), and one that none reaches is found: by another process, another checkout, the next
version.
"""

import contextlib
import functools
import gc
import hashlib
import logging
import os
import pickle
import sqlite3
import stat
import sys
import tempfile
from collections.abc import Callable, Generator, Iterator
from enum import Enum
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType

import numba
import numpy as np
import platformdirs
from numba.core import event
from numba.core.codegen import CPUCodegen
from numba.core.compiler import CompileResult
from numba.core.cpu import CPUContext
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature
from numba.core.types import Type
from numba.core.typing.templates import Signature

CHECKSUM = hashlib.sha256().digest_size
VERSIONS = f"{numba.__version__} {np.__version__} {sys.implementation.cache_tag}"
KNOWN_BY_NAME = ("numpy", "numba", "math", "builtins")
"""Packages whose functions are what their name and version say."""
PATIENCE_S = 60.0
"""How long a process that compiles a kernel is waited for."""
OPEN = "can be written by others"
MOST_BYTES = 256 << 20
"""Size of the folder, some thirty times that of all kernels; beyond it those go that were not used for longest."""


class UnkeyedError(TypeError):
    """A kernel names something that no key can be made of."""


class KernelCache:
    """Keeps what a kernel is compiled to, in place of Numba's own cache.

    Processes that need it at once wait for the first. Where nothing can be kept (no key, no room, no right to write),
    each compiles it for itself; what is damaged is written again.
    """

    def __init__(self, kernel: Dispatcher) -> None:
        self._kernel = kernel
        self._turns: dict[Path, sqlite3.Connection] = {}

    @functools.cached_property
    def _parts(self) -> bytes:
        # Once it is called: where it is declared, what it names may stand further down in its module.
        return b"".join(parts_of(self._kernel))

    def path(self, signature: Signature | tuple[Type, ...], codegen: CPUCodegen) -> Path:
        """Where the form for these types of arguments, on this processor, is kept. Raises UnkeyedError."""
        arguments, returned = normalize_signature(signature)
        kinds = (str(arguments), str(returned), list(map(fields_of, arguments)))
        about = (kinds, codegen.magic_tuple(), VERSIONS)
        key = hashlib.sha256(self._parts + repr(about).encode()).hexdigest()
        function = self._kernel.py_func
        return folder() / f"{function.__module__.rpartition('.')[2]}.{function.__name__}-{key[:32]}.kernel"

    @property
    def cache_path(self) -> str:
        return str(folder())

    def flush(self) -> None:
        """Nothing: a form is written again when it is compiled again."""

    def load_overload(
        self, sig: Signature | tuple[Type, ...], target_context: CPUContext
    ) -> CompileResult | None:
        target_context.refresh()
        try:
            place = self.path(sig, target_context.codegen())
        except UnkeyedError:
            return None
        compiled = _rebuilt(place, target_context)
        if compiled is None and self._take_turn(place):
            compiled = _rebuilt(place, target_context)  # by the process that had its turn before
            if compiled is not None:
                self._give_up_turn(place)
        if compiled is None:
            _compiling()
        return compiled

    def save_overload(self, sig: Signature | tuple[Type, ...], data: CompileResult) -> None:
        try:
            place = self.path(sig, data.codegen)
        except UnkeyedError:
            return
        if all(one.can_cache for one in data.lifted) and not data.library.has_dynamic_globals:
            _keep(place, dumps(data._reduce()))
        self._give_up_turn(place)

    def _take_turn(self, place: Path) -> bool:
        """Wait until this process is the one that compiles it; whether that is new."""
        if place in self._turns:
            return False
        try:
            if not _is_ours(place.parent):
                return False
            turn = sqlite3.connect(
                place.with_suffix(".turn"), timeout=PATIENCE_S, isolation_level=None, check_same_thread=False
            )
            self._turns[place] = turn
            turn.execute("PRAGMA journal_mode = MEMORY")
            turn.execute("BEGIN EXCLUSIVE")
        except (OSError, sqlite3.DatabaseError):  # no place for it, or it took too long
            return False
        return True

    def _give_up_turn(self, place: Path) -> None:
        turn = self._turns.pop(place, None)
        if turn is not None:
            turn.close()
            with contextlib.suppress(OSError):
                place.with_suffix(".turn").unlink(missing_ok=True)


_waiting: list[Callable[[], None]] = []
"""What is done once something has to be compiled."""


@contextlib.contextmanager
def when_compiling(action: Callable[[], None]) -> Generator[None]:
    """Do something before the first kernel that has to be compiled within; nothing where all are found."""
    _waiting.append(action)
    try:
        yield
    finally:
        if action in _waiting:
            _waiting.remove(action)


def _compiling() -> None:
    while _waiting:
        _waiting.pop()()


class _NotCollecting(event.Listener):
    """Python's collector of garbage rests while Numba compiles, which it makes a sixth slower: there is much to look at
    and nothing to free. Numba compiles one kernel at a time, those that it calls within.
    """

    def __init__(self) -> None:
        self._collected = list[bool]()

    def on_start(self, event: event.Event) -> None:
        self._collected.append(gc.isenabled())
        gc.disable()

    def on_end(self, event: event.Event) -> None:
        if self._collected.pop():
            gc.enable()


event.register("numba:compile", _NotCollecting())


@functools.cache
def folder() -> Path:
    """Of this user alone: NUMBA_CACHE_DIR, a folder in it where others may write to it, else in the user's caches."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    place = Path(given or Path(platformdirs.user_cache_dir("capture-studio", appauthor=False)) / "kernels")
    if given and place.is_dir() and _fault_of(place.stat()):
        return place / f"kernels-of-{_user()}"
    return place


def _user() -> int:
    return os.geteuid() if hasattr(os, "geteuid") else 0


def _fault_of(status: os.stat_result) -> str:
    """Why a stored kernel, a pickle that can run anything, may be another user's, a clause; "" if it is ours."""
    if not hasattr(os, "geteuid"):
        return ""
    if status.st_uid != _user():
        return "belongs to another user"
    return OPEN if status.st_mode & 0o022 else ""


def _is_ours(room: Path) -> bool:
    """Whether kernels may be kept in and taken from a folder, which is made where it is missing. Raises OSError."""
    room.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not room.is_symlink() and _fault_of(room.lstat()) == OPEN:
        room.chmod(0o700)
    fault = "is a link" if room.is_symlink() else _fault_of(room.lstat())
    if fault:
        _say_once(
            f"Compiled kernels are not kept: '{room}' {fault}. Set NUMBA_CACHE_DIR to a folder of your own."
        )
    return not fault


@functools.cache
def _say_once(text: str) -> None:
    logging.getLogger("studio").warning(text)


def fields_of(kind: Type) -> object:
    """Names of the fields in a type, which its own text leaves out."""
    return getattr(kind, "fields", ()), [fields_of(one) for one in getattr(kind, "types", ())]


def parts_of(value: object, within: tuple[FunctionType, ...] = ()) -> Iterator[bytes]:
    """What a value is made of: the same in any process. within : functions that lead here. Raises UnkeyedError."""
    yield type(value).__name__.encode() + b"("
    if isinstance(value, Dispatcher):
        for name, option in sorted(value.targetoptions.items()):
            yield f"{name}={sorted(option) if isinstance(option, set) else option!r} ".encode()
        yield from parts_of(value.py_func, within)
    elif isinstance(value, _Intrinsic):
        yield from parts_of(value._defn, within)
    elif isinstance(value, FunctionType) and not _is_versioned(value.__module__) and value not in within:
        yield from parts_of(
            (value.__defaults__, *(one.cell_contents for one in value.__closure__ or ())), within
        )
        # What is kept names its functions by their modules.
        yield value.__module__.encode()
        yield from _parts_of_code(value.__code__, value, (*within, value))
    elif isinstance(value, tuple | list):
        for one in value:
            yield from parts_of(one, within)
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype.str} {value.shape}".encode() + np.ascontiguousarray(value).tobytes()
    elif isinstance(value, type | FunctionType | BuiltinFunctionType | np.ufunc):
        yield f"{value.__module__}.{value.__name__} {getattr(value, '_fields', '')}".encode()
    elif isinstance(value, ModuleType):
        yield value.__name__.encode()
    elif isinstance(value, bool | int | float | complex | str | bytes | np.generic | None | Type | Enum):
        yield repr(value).encode()
    else:
        raise UnkeyedError(f"no key of {value!r}")
    yield b")"


def _parts_of_code(
    code: CodeType, function: FunctionType, within: tuple[FunctionType, ...]
) -> Iterator[bytes]:
    """A code object, those inside it, and what is named there of the function's module."""
    yield code.co_code
    yield repr((code.co_names, code.co_varnames, code.co_argcount, code.co_flags)).encode()
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _parts_of_code(constant, function, within)
        elif isinstance(constant, frozenset):
            yield repr(sorted(map(repr, constant))).encode()
        else:
            yield from parts_of(constant, within)
    for value in (function.__globals__[name] for name in code.co_names if name in function.__globals__):
        yield from parts_of(value, within)
        if isinstance(value, ModuleType) and not _is_versioned(value.__name__):
            for name in code.co_names:
                yield from parts_of(getattr(value, name, None), within)


def _is_versioned(module: str | None) -> bool:
    return (module or "").partition(".")[0] in KNOWN_BY_NAME


def _rebuilt(place: Path, context: CPUContext) -> CompileResult | None:
    """The kernel that is kept there; None where there is none that can be used."""
    data = _read_kernel(place)
    if data is None:
        return None
    try:
        return CompileResult._rebuild(context, *pickle.loads(data))
    except Exception as problem:  # whatever a wrong pickle raises, the kernel is compiled again
        _say_once(f"'{place.name}' is no compiled kernel ({type(problem).__name__}) and is made again.")
        return None


def _read_kernel(place: Path) -> bytes | None:
    """What is kept there; None where there is nothing, it is damaged, or it is not this user's alone."""
    try:
        if not _is_ours(place.parent):
            return None
        with place.open("rb") as file:
            status = os.fstat(file.fileno())
            fault = _fault_of(status) if stat.S_ISREG(status.st_mode) else "is no file"
            if fault:
                _say_once(f"The compiled kernel '{place}' {fault} and is not used.")
                return None
            data = file.read()
    except OSError:
        return None
    with contextlib.suppress(OSError):
        os.utime(place)
    return data[CHECKSUM:] if hashlib.sha256(data[CHECKSUM:]).digest() == data[:CHECKSUM] else None


def _keep(place: Path, content: bytes) -> None:
    try:
        handle, name = tempfile.mkstemp(dir=place.parent)
        try:
            with open(handle, "wb") as file:
                file.write(hashlib.sha256(content).digest() + content)
            os.replace(name, place)
        except OSError:
            Path(name).unlink(missing_ok=True)
        _forget_unused(place.parent)
    except OSError:
        return


def _forget_unused(room: Path) -> None:
    """Remove what was not used for longest, until the rest is not larger than MOST_BYTES."""
    kept: list[tuple[int, int, Path]] = []
    for place in room.glob("*.kernel"):
        with contextlib.suppress(OSError):  # another process removed it
            about = place.stat()
            kept.append((about.st_mtime_ns, about.st_size, place))
    size = 0
    for _, bytes_here, place in sorted(kept, reverse=True):
        size += bytes_here
        if size > MOST_BYTES:
            place.unlink(missing_ok=True)
