"""Commands made from the declarations of verbs: arguments, options and help are the function's signature."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import click

from studio.cli.output import MemberChoice, command, progress, shown_progress
from studio.cli.reading import camera_numbers, chosen_knobs, frame_numbers, measured, numbers, place, places
from studio.foundations.declaring import (
    PROGRESS,
    REQUIRED,
    Knobs,
    Millimetres,
    OneOf,
    Parameter,
    Target,
    alternatives,
    declared,
)
from studio.foundations.knobs import Knob, allowed
from studio.sessions.object_stores import is_address
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

READERS: dict[Any, tuple[str, Callable[[Sequence[str], str], object]]] = {
    Mapping[str, int]: ("CAMERA=NUMBER", camera_numbers),
    Mapping[str, float]: ("NAME=MM", measured),
    Sequence[tuple[float, float]]: ("X,Y", places),
    Sequence[float]: ("NUMBER", numbers),
}
"""Types whose options are repeated, by what is written and how it is read."""
SET = "changes"

Shown = Callable[..., Mapping[str, object]]


class _LengthRange(click.FloatRange):
    """A length in mm."""

    def __init__(self, length: Millimetres) -> None:
        super().__init__(length.least, length.most)
        self._length = length

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:  # noqa: ANN401
        number = click.FLOAT.convert(value, param, ctx)
        if not self._length.least <= number <= self._length.most:
            self.fail(f"{self._length.refusal(number)}.", param, ctx)
        return number


class Call:
    """A verb with its arguments from the command line. A call runs it; arguments of the call override them."""

    def __init__(
        self, verb: Callable[..., object], entries: Sequence[Parameter], options: Mapping[str, Any]
    ) -> None:
        self._verb = verb
        self.given: dict[str, Any] = {}
        for entry in entries:
            self.given |= _read_option(entry, options)

    def __call__(self, **more: object) -> Any:  # noqa: ANN401 - what the verb returns
        """Do it, with progress on standard error."""
        return self._call(self._verb, {**self.given, **more})

    def do(self, verb: Callable[..., object], **given: object) -> Any:  # noqa: ANN401 - what the verb returns
        """Do another verb to the same session or run."""
        about = [entry.name for entry in declared(verb).parameters.values() if entry.target]
        return self._call(verb, {name: self.given[name] for name in about if name in self.given} | given)

    @staticmethod
    def _call(verb: Callable[..., object], given: Mapping[str, object]) -> object:
        takes = inspect.signature(verb).parameters
        return verb(**given, **({PROGRESS: shown_progress} if PROGRESS in takes else {}))


def command_of(
    verb: Callable[..., object],
    *extra: Callable[[click.Command], object],
    name: str = "",
    without: Sequence[str] = (),
    epilog: str | None = None,
    cls: type[click.Command] = click.Command,
) -> Callable[[Shown], click.Command]:
    """Make `function(call, **own)`, which lets the verb be done and returns what is printed, a command.

    extra : options that the terminal alone has, passed as `own`. without : parameters that they stand for.
    """
    operation = declared(verb)
    entries = [entry for entry in operation.parameters.values() if entry.name not in without]

    def make(function: Shown) -> click.Command:
        def body(**options: object) -> Mapping[str, object]:
            own = {one: options.pop(one) for one in names}
            return function(Call(verb, entries, options), **own)

        body.__doc__ = operation.about
        made = click.command(name or operation.name.replace("_", "-"), cls=cls, epilog=epilog)(command(body))
        json_option = made.params.pop()
        made.params = [option for entry in entries for option in _options(entry)]
        for add in extra:
            add(made)
        names = [str(one.name) for one in made.params[len(made.params) - len(extra) :]] if extra else []
        made.params.append(json_option)
        return made

    return make


def _options(entry: Parameter) -> list[click.Parameter]:
    """A parameter as the command line takes it."""
    mark = entry.terminal
    if mark.left_out:
        return []
    if entry.target:
        parts = ("session", "run") if entry.target == "run" else ("session",)
        return [*(click.Argument([part]) for part in parts)]
    knobs = entry.mark(Knobs)
    if knobs is not None:
        return _knob_options(entry, knobs)
    kind = mark.kind or entry.kind
    required = entry.default is REQUIRED and mark.required
    option = entry.option
    if not option:
        many = kind in (Sequence[str], Sequence[str | Path])
        own: dict[str, Any] = {"nargs": -1} if many else {"type": _click_type(entry, kind)}
        return [click.Argument([entry.name], required=True, metavar=mark.metavar or None, **own)]
    shown: dict[str, Any] = {"help": entry.help, "required": required}
    if kind is bool:
        switch: dict[str, Any] = {"default": entry.default, "show_default": entry.default}
        return [click.Option([option, entry.name], is_flag=True, **shown, **switch)]
    several = next((READERS[one] for one in alternatives(kind) if one in READERS), None)
    if several is not None or Sequence[str] in alternatives(kind):
        metavar = mark.metavar or (several[0] if several else None)
        shown["help"] = f"{entry.help.removesuffix('.')}; again for more."
        return [click.Option([option, entry.name], multiple=True, metavar=metavar, **shown)]
    if Sequence[int] in alternatives(kind):
        none: dict[str, Any] = {} if required else {"default": ""}
        return [click.Option([option, entry.name], metavar="A,B,…", **none, **shown)]
    given: dict[str, Any] = {"metavar": mark.metavar or None}
    # Click takes any default, None too, for a value: an option that is required would never be missed.
    if entry.default not in (None, "", REQUIRED):
        given |= {"default": entry.default, "show_default": True}
    return [click.Option([option, entry.name], type=_click_type(entry, kind), **given, **shown)]


def _click_type(entry: Parameter, kind: Any) -> "click.ParamType[Any] | type":  # noqa: ANN401 - a type
    members = entry.mark(OneOf)
    if members is not None:
        return MemberChoice(members.registry)
    length = entry.mark(Millimetres)
    if length is not None:
        return _LengthRange(length)
    for one in alternatives(kind):
        if get_origin(one) is Literal:
            return click.Choice([word for word in get_args(one) if word])
        if one in (int, float):
            ranged = click.IntRange if one is int else click.FloatRange
            return ranged(**entry.number_range) if entry.number_range else one
        if one is Path:
            return click.Path(path_type=Path)
    return str


def knob_option(entry: Knob, with_default: bool) -> click.Option:
    """The option of a knob; numbers are passed as text, which its declaration reads."""
    option = [f"--{entry.name.replace('_', '-')}", entry.name]
    if entry.default is False:
        return click.Option(option, is_flag=True, default=None, help=entry.help)
    if entry.choices:
        return click.Option(option, type=click.Choice(entry.choices), help=entry.help)
    default = f"; default {entry.default}" if with_default else ""
    words = f"{entry.help} ({allowed(entry)}{default})"
    return click.Option(option, metavar=click.types.convert_type(entry.kind).name.upper(), help=words)


def _knob_options(entry: Parameter, knobs: Knobs) -> list[click.Parameter]:
    options: list[click.Parameter] = [knob_option(one, knobs.with_defaults) for one in knobs.listed()]
    if knobs.others:
        options.append(click.Option(["--set", SET], multiple=True, metavar="KNOB=VALUE", help=entry.help))
    return options


def _session(place: str, entry: Parameter) -> Session:
    """The session that is meant. Raises StudioError."""
    mark = entry.mark(Target)
    if mark is None or not mark.remote or not is_address(place):
        return Workspace().resolve(place)
    with progress("bringing") as report:
        return Workspace().resolve(place, remote=True, progress=report)


def _read_option(entry: Parameter, options: Mapping[str, Any]) -> dict[str, object]:
    """What was given for a parameter, {} for nothing. Raises StudioError for what cannot be read."""
    if entry.terminal.left_out:
        return {}
    if entry.target:
        session = _session(options["session"], entry)
        return {entry.name: session.run(options["run"]) if entry.target == "run" else session}
    knobs = entry.mark(Knobs)
    if knobs is not None:
        chosen: dict[str, object] = {**chosen_knobs(options.get(SET, ()))}
        own = {one.name: options[one.name] for one in knobs.listed() if options[one.name] is not None}
        return chosen | own if entry.any_name else {entry.name: chosen | own}
    value, kinds = options[entry.name], alternatives(entry.terminal.kind or entry.kind)
    several = next((READERS[one] for one in kinds if one in READERS), None)
    if several is not None:
        value = several[1](value, entry.option)
    elif Sequence[int] in kinds:
        value = frame_numbers(value)
    elif tuple[float, float] in kinds and value is not None:
        value = place(value, entry.option)
    return {} if value is None else {entry.name: value}
