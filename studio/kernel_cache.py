# pyright: standard
"""Compiled kernels, kept on this machine and found by what they are made of.

A kernel's key is its bytecode, options and argument types, with every function, constant and array that it names, and
what those name. So a kernel that a change reaches is compiled anew, wherever the change was (Numba's own cache looks at
the kernel's file alone), and one that none reaches is found: by another process, another checkout, the next version.
"""

import functools
import hashlib
import os
import pickle
import sys
import tempfile
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType

import numba
import numpy as np
import platformdirs
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


class UnkeyedError(TypeError):
    """A kernel names something that no key can be made of."""


class KernelCache:
    """Keeps what a kernel is compiled to, in place of Numba's own cache.

    Where nothing can be kept (no key, no room, no right to write), each process compiles it for itself; what is damaged
    is written again.
    """

    def __init__(self, kernel: Dispatcher) -> None:
        self._kernel = kernel

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
            data = self.path(sig, target_context.codegen()).read_bytes()
        except (OSError, UnkeyedError):
            return None
        if hashlib.sha256(data[CHECKSUM:]).digest() != data[:CHECKSUM]:
            return None
        return CompileResult._rebuild(target_context, *pickle.loads(data[CHECKSUM:]))

    def save_overload(self, sig: Signature | tuple[Type, ...], data: CompileResult) -> None:
        if any(not one.can_cache for one in data.lifted) or data.library.has_dynamic_globals:
            return
        try:
            place = self.path(sig, data.codegen)
            content = dumps(data._reduce())
            place.parent.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(dir=place.parent)
            try:
                with open(handle, "wb") as file:
                    file.write(hashlib.sha256(content).digest() + content)
                os.replace(name, place)
            except OSError:
                Path(name).unlink(missing_ok=True)
        except (OSError, UnkeyedError):
            return


@functools.cache
def folder() -> Path:
    """NUMBA_CACHE_DIR, else the user's folder for caches."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    return Path(given or Path(platformdirs.user_cache_dir("capture-studio", appauthor=False)) / "kernels")


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
    elif isinstance(value, FunctionType) and not _known(value.__module__) and value not in within:
        yield from parts_of(
            (value.__defaults__, *(one.cell_contents for one in value.__closure__ or ())), within
        )
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
        if isinstance(value, ModuleType) and not _known(value.__name__):
            for name in code.co_names:
                yield from parts_of(getattr(value, name, None), within)


def _known(module: str | None) -> bool:
    return (module or "").partition(".")[0] in KNOWN_BY_NAME
