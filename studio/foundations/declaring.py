"""What a verb takes, declared once: in the signature of its function.

A parameter is `name: Annotated[type, Field(description=…, ge=…)] = default`. Made from that line are the option of the
command line (`cli.deriving`), the entry of the HTTP body (`app.server.requests`), the check of a call from Python
(`operation`) and the page of the guide. `Terminal` and `Web` say where one of the two differs from the rule.
"""

import functools
import inspect
import re
import textwrap
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from annotated_types import BaseMetadata, Ge, Gt, Le
from numpy.typing import ArrayLike, NDArray
from pydantic import ConfigDict, Field, GetCoreSchemaHandler, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError
from pydantic_core.core_schema import ValidatorFunctionWrapHandler, no_info_wrap_validator_function

from studio.foundations.errors import SettingsError
from studio.foundations.knobs import Knob
from studio.foundations.registry import Registry

P = ParamSpec("P")
R = TypeVar("R")
F = TypeVar("F", bound=Callable[..., object])

REQUIRED = inspect.Parameter.empty
PROGRESS = "progress"
PROGRESS_MEANS = "A function of (step, done, total); True for a bar, False for nothing."
PACKAGE = re.compile(r"\b(?:[a-z_]+\.)+")
ARRAY_LIKE = PACKAGE.sub("", inspect.formatannotation(ArrayLike)).removeprefix("Union[").removesuffix("]")
CONFIG = ConfigDict(arbitrary_types_allowed=True)
LARGEST = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Terminal:
    """How the command line takes a parameter, where the rule (`--name`, of the parameter's type) is not meant.

    option : "--from", "--copy/--reference". metavar : of its value. kind : its type there. left_out : no option.
    required : whether it has to be given where there is no default.
    """

    option: str = ""
    metavar: str = ""
    kind: Any = None
    left_out: bool = False
    required: bool = True


@dataclass(frozen=True, slots=True)
class Web:
    """How an HTTP body takes a parameter. By the rule text is a name (letters, digits, - and _), null its default, and
    what may be a path is left out, since no one far away chooses files of this machine.

    name : of the entry. kind : its type there. left_out : no entry of the body; of a record no entry of the answer.
    """

    name: str = ""
    kind: Any = None
    left_out: bool = False


@dataclass(frozen=True, slots=True)
class Target:
    """The parameter is what the verb is about: "session" or "run"; the addresses of HTTP name it, not the body.

    remote : a session may lie in an object store.
    """

    kind: str
    remote: bool = False


@dataclass(frozen=True, slots=True)
class OneOf:
    """The parameter is the name of a member."""

    registry: Registry[Any]


@dataclass(frozen=True, slots=True)
class Knobs:
    """The parameter is knobs by name. listed : those that are options of their own on the command line. others : any
    other is taken too, as --set KNOB=VALUE. with_defaults : name them in the help.
    """

    listed: Callable[[], Iterable[Knob]] = tuple
    others: bool = False
    with_defaults: bool = True


@dataclass(frozen=True, slots=True)
class Millimetres:
    """The number is a length in mm, held to `least` and `most` by its Field: who gives another one is told the unit,
    and which one was meant, it seems.
    """

    least: float
    most: float

    def refusal(self, value: float) -> str:
        """Why a length outside the limits is refused, without a full stop."""
        words = f"{value:g} mm is not from {self.least:g} to {self.most:g} mm"
        for unit, factor in (("centimetres", 10.0), ("metres", 1000.0)):
            if self.least <= factor * value <= self.most:
                return f"{words}. It looks like {unit}: write {factor * value:g}"
        return words

    def __get_pydantic_core_schema__(self, kind: Any, handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        return no_info_wrap_validator_function(self._read, handler(kind))

    def _read(self, value: object, read: ValidatorFunctionWrapHandler) -> object:
        """The value as it is read without this mark. Raises PydanticCustomError, ValidationError."""
        try:
            return read(value)
        except ValidationError:
            if isinstance(value, int | float) and not self.least <= value <= self.most:
                raise PydanticCustomError("length", "{words}", {"words": self.refusal(value)}) from None
            raise


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter as it is declared. kind : its type without marks. default : REQUIRED where there is none. info :
    its help and limits. marks : Terminal, Web and kin. any_name : it stands for any other keyword.
    """

    name: str
    kind: Any
    default: Any
    info: FieldInfo
    marks: tuple[Any, ...]
    any_name: bool = False

    def mark(self, kind: type[R]) -> R | None:
        """The last mark of a kind, which overrides those of the types that it is made of."""
        return next((mark for mark in reversed(self.marks) if isinstance(mark, kind)), None)

    @property
    def help(self) -> str:
        """What it means, in a sentence."""
        return self.info.description or ""

    @property
    def meaning(self) -> str:
        """The help of any parameter, also of a session, a run, or knobs."""
        if self.target:
            return "SESSION/RUN" if self.target == "run" else "Name or folder."
        knobs = self.mark(Knobs)
        return f"{self.help} {', '.join(one.name for one in knobs.listed()) if knobs else ''}".strip()

    @property
    def terminal(self) -> Terminal:
        """How the command line takes it."""
        return self.mark(Terminal) or Terminal()

    @property
    def option(self) -> str:
        """Its option on the command line: "--from"; "" for an argument."""
        mark = self.terminal
        if self.target or (self.default is REQUIRED and not mark.option):
            return ""
        option = mark.option or f"--{self.name.replace('_', '-')}"
        if self.default is True and "/" not in option:
            option += f"/--no-{option.removeprefix('--')}"
        return option

    @property
    def web(self) -> Web:
        """How HTTP takes it."""
        declared = self.mark(Web) or Web(left_out=any(kind is Path for kind in alternatives(self.kind)))
        return Web(left_out=True) if self.target else declared

    @property
    def target(self) -> str:
        """ "session" or "run" where it is what the verb is about."""
        mark = self.mark(Target)
        return mark.kind if mark else ""

    def limited(self, kind: Any) -> Any:  # noqa: ANN401 - a type
        """A type held to what the values are held to."""
        limits = [mark for mark in self.marks if isinstance(mark, BaseMetadata | Millimetres)]
        return Annotated[(kind, *limits)] if limits else kind

    @property
    def number_range(self) -> dict[str, Any]:
        """Least and greatest number, as ranges of the command line have them; {} where there are none."""
        limits: dict[str, Any] = {}
        for mark in self.marks:
            if isinstance(mark, Ge | Gt):
                limits |= {
                    "min": mark.ge if isinstance(mark, Ge) else mark.gt,
                    "min_open": isinstance(mark, Gt),
                }
            if isinstance(mark, Le) and mark.le != LARGEST:
                limits["max"] = mark.le
        return limits

    @property
    def is_plain(self) -> bool:
        """Whether Python, terminal and HTTP take it as the same type, so that one check does for all."""
        return not (self.target or self.any_name) and self.terminal.kind is None and self.web.kind is None


@dataclass(frozen=True)
class Operation:
    """A verb as it is declared. function : what does it."""

    function: Callable[..., object]

    @property
    def name(self) -> str:
        return self.function.__name__

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """All but `progress`, in order."""
        hints = get_type_hints(self.function, include_extras=True)
        parameters: dict[str, Parameter] = {}
        for name, entry in inspect.signature(self.function).parameters.items():
            if name == PROGRESS:
                continue
            given = {} if entry.default is REQUIRED else {"default": entry.default}
            info = (
                FieldInfo.from_annotated_attribute(hints[name], **given)
                if given
                else FieldInfo.from_annotation(hints[name])
            )
            any_name = entry.kind is entry.VAR_KEYWORD
            parameters[name] = Parameter(
                name, info.annotation, entry.default, info, tuple(info.metadata), any_name
            )
        return parameters

    @cached_property
    def about(self) -> str:
        """What it does, for a person at a terminal or a page: its docstring without what it raises."""
        parts = inspect.cleandoc(self.function.__doc__ or "").split("\n\n")
        return "\n\n".join(part for part in parts if not part.startswith("Raises"))

    @cached_property
    def returned(self) -> str:
        """The type of the result, and the docstring of the studio's record in it if there is one."""
        kind = get_type_hints(self.function).get("return")
        own = [one for one in (kind, *get_args(kind)) if getattr(one, "__module__", "").startswith("studio.")]
        about = "".join(f": {inspect.getdoc(one)}" for one in own)
        return f"Returns {_type_in_words(kind)}{about}"

    @property
    def signature(self) -> inspect.Signature:
        """The signature with types that a person can read."""
        shown = inspect.signature(self.function)
        kinds = {name: _type_in_words(one.kind) for name, one in self.parameters.items()}
        entries = [
            one.replace(annotation=kinds.get(name, "Progress")) for name, one in shown.parameters.items()
        ]
        return shown.replace(parameters=entries, return_annotation=inspect.Signature.empty)

    @property
    def help(self) -> str:
        """The docstring with its parameters and result, as `help` shows it."""
        raises = inspect.cleandoc(self.function.__doc__ or "").removeprefix(self.about).strip()
        means = {entry.name: entry.meaning for entry in self.parameters.values() if not entry.any_name}
        if PROGRESS in inspect.signature(self.function).parameters:
            means[PROGRESS] = PROGRESS_MEANS
        lines = [
            textwrap.fill(f"{name} : {words}", 100, subsequent_indent="    ") for name, words in means.items()
        ]
        return "\n\n".join(part for part in (self.about, "\n".join(lines), self.returned, raises) if part)

    @cached_property
    def _readers(self) -> dict[str, TypeAdapter[Any]]:
        """What reads each parameter that is taken alike everywhere."""
        plain = [entry for entry in self.parameters.values() if entry.is_plain]
        return {entry.name: TypeAdapter(entry.limited(entry.kind), config=CONFIG) for entry in plain}

    def checked(self, given: dict[str, Any]) -> dict[str, Any]:
        """Arguments by name, those of plain types read as these. Raises SettingsError."""
        values = dict(given)
        for name, reader in self._readers.items():
            if name not in given:
                continue
            try:
                values[name] = reader.validate_python(_without_numpy(given[name]))
            except ValidationError as error:
                raise SettingsError(
                    f"{self.name}: '{name}' cannot be {given[name]!r:.80}: {error.errors()[0]['msg']}.",
                    self.parameters[name].help or f"help(studio.{self.name}) says what it takes.",
                ) from None
        return values


def operation(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function a verb: its arguments are checked against what its signature declares."""
    declared = Operation(function)

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = inspect.signature(function).bind(*args, **kwargs)
        bound.arguments = declared.checked(dict(bound.arguments))
        return function(*bound.args, **bound.kwargs)

    setattr(call, DECLARED, declared)
    return call


def taking(declares: Callable[..., object], without: Sequence[str] = ()) -> Callable[[F], F]:
    """Let a function that takes any keyword take what another one, or a dataclass, declares after its own first
    parameters. without : of these. What the function declares itself overrides them.
    """

    def take(function: F) -> F:
        own, hints = inspect.signature(function), function.__annotations__
        entries = {name: one for name, one in own.parameters.items() if one.kind is not one.VAR_KEYWORD}
        for name, entry in inspect.signature(declares).parameters.items():
            if name not in entries and name not in without:
                entries[name] = entry.replace(kind=entry.KEYWORD_ONLY)
                hints[name] = declares.__annotations__[name]
        ranked = sorted(entries.values(), key=lambda one: (one.kind, one.name in own.parameters))
        setattr(function, "__signature__", own.replace(parameters=ranked))  # noqa: B010 - functions lack it in types
        return function

    return take


DECLARED = "__operation__"


def declared(function: Callable[..., object]) -> Operation:
    """What a verb declares."""
    return getattr(function, DECLARED, None) or Operation(function)


def alternatives(kind: Any) -> tuple[Any, ...]:  # noqa: ANN401 - a type, which has no type of its own
    """The types of a union; the type alone where it is none."""
    return get_args(kind) if get_origin(kind) in (Union, types.UnionType) else (kind,)


def _type_in_words(kind: Any) -> str:  # noqa: ANN401 - a type
    """A type without the packages of its parts."""
    return PACKAGE.sub("", inspect.formatannotation(kind)).replace(ARRAY_LIKE, "ArrayLike")


def _without_numpy(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return cast("np.generic[Any] | NDArray[Any]", value).tolist()
    return value


Seed = Annotated[int, Field(ge=0, le=LARGEST, description="The same seed gives the same result.")]
Body = Annotated[
    str,
    Field(
        description="Kinematic tree, by name or as a .toml, .urdf or .xml file, scaled by the session's subject;"
        " default: the session's."
    ),
    Terminal(metavar="NAME"),
]
First = Annotated[int | None, Field(ge=0, description="Default: the frame of the start pose.")]
Last = Annotated[int | None, Field(ge=1, description="The frame after the last one; default: all.")]
Model = Annotated[str, Field(description="Behaviour model, by name or file."), Terminal(metavar="MODEL")]
AllowInconsistent = Annotated[
    bool, Field(description="Track although the footage speaks against the calibration.")
]
Values = Annotated[Mapping[str, object] | None, Field(description="Knobs, by name."), Web(name="settings")]
