"""The declaration of tunable numbers.

A settings class is a frozen dataclass whose fields are made by `knob(...)`. The slider, the command-line option,
the JSON schema, the range check and the guide's table are all made from that one line.
"""

import dataclasses
import functools
import inspect
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from studio.foundations.errors import SettingsError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Value = bool | int | float | str
S = TypeVar("S", bound="DataclassInstance")


@dataclass(frozen=True, slots=True)
class Knob:
    """The declaration of one setting.

    name, label : identifier and words on screen. kind : bool, int, float or str. low, high, step : inclusive range
    (numbers only). choices : allowed words (str only). takes_effect : "next layer", "next frame" or "new run".
    group : title of the settings class it belongs to.
    """

    name: str
    label: str
    kind: type
    default: Value
    low: float | None
    high: float | None
    step: float | None
    unit: str
    choices: tuple[str, ...]
    takes_effect: str
    help: str
    group: str = ""


def knob(
    default: Value,
    low: float | None = None,
    high: float | None = None,
    step: float | None = None,
    *,
    label: str = "",
    unit: str = "",
    choices: tuple[str, ...] = (),
    takes_effect: str = "next layer",
    help: str,
) -> Any:  # noqa: ANN401 - a dataclass field stands where its value's type is annotated
    """A dataclass field that carries its own range, unit, help and moment of effect.

    default : its type is the knob's.
    low, high : inclusive range of a number; None: no bound.
    step : of the slider.
    label : words on screen; default: the field's name.
    unit : such as "mm", shown behind the value.
    choices : allowed words of a text.
    takes_effect : "next layer", "next frame" or "new run".
    help : one sentence, for the slider, the option and the guide.
    """
    declared = Knob("", label, type(default), default, low, high, step, unit, choices, takes_effect, help)
    return field(default=default, metadata={"knob": declared})


next_frame_knob = functools.partial(knob, takes_effect="next frame")
"""A knob that takes effect with the next frame."""
new_run_knob = functools.partial(knob, takes_effect="new run")
"""A knob that a run keeps."""


def with_default(owner: type["DataclassInstance"], name: str, default: Value) -> Any:  # noqa: ANN401
    """A knob of a settings class declared again for a subclass, with another default."""
    declared: Knob = owner.__dataclass_fields__[name].metadata["knob"]
    return field(default=default, metadata={"knob": dataclasses.replace(declared, default=default)})


def knobs_of(settings: object) -> tuple[Knob, ...]:
    """The knobs of a settings class, or of a value of one, in the order of their lines, a class's own before those
    that it inherits; `group` is the class's `title` attribute.
    """
    return _knobs_of_class(settings if isinstance(settings, type) else type(settings))


@functools.cache
def _knobs_of_class(settings_type: type[Any]) -> tuple[Knob, ...]:
    group = getattr(settings_type, "title", settings_type.__name__)
    fields = {entry.name: entry for entry in dataclasses.fields(settings_type)}
    names = dict.fromkeys(
        name for owner in settings_type.__mro__ for name in inspect.get_annotations(owner) if name in fields
    )
    knobs: list[Knob] = []
    for entry in map(fields.__getitem__, names):
        declared = entry.metadata.get("knob")
        if declared is not None:
            label = declared.label or entry.name.replace("_", " ")
            knobs.append(dataclasses.replace(declared, name=entry.name, label=label, group=group))
    return tuple(knobs)


LONGEST_SHOWN = 80
"""Characters of a refused value that are shown."""


def checked(declared: Knob, value: object) -> Value:
    """The value as the knob's type; strings (from a command line) are read as numbers or yes/no.

    Raises SettingsError naming the knob, the value and what is allowed.
    """
    hint = f"Allowed: {allowed(declared)}."
    shown = repr(value)
    shown = shown if len(shown) <= LONGEST_SHOWN else f"{shown[:LONGEST_SHOWN]}…"
    wrong = SettingsError(f"Setting '{declared.name}' cannot be {shown}.", hint)
    if declared.kind is bool:
        word = str(value).strip().lower()
        if word not in ("true", "false", "on", "off", "yes", "no", "1", "0"):
            raise wrong
        return word in ("true", "on", "yes", "1")
    if declared.kind is str:
        if not isinstance(value, str) or (declared.choices and value not in declared.choices):
            raise wrong
        return value
    try:
        number = float(value)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError, OverflowError):
        raise wrong from None
    inside = (declared.low is None or number >= declared.low) and (
        declared.high is None or number <= declared.high
    )
    if isinstance(value, bool) or not math.isfinite(number) or not inside:
        raise wrong
    if declared.kind is int:
        if number != int(number):
            raise wrong
        return int(number)
    return number


def allowed(declared: Knob) -> str:
    """The allowed values in words, for messages and help."""
    if declared.kind is bool:
        return "true or false"
    if declared.choices:
        return ", ".join(declared.choices)
    if declared.kind is str:
        return "text"
    kind = "a whole number" if declared.kind is int else "a number"
    unit = f" {declared.unit}" if declared.unit else ""
    if declared.low is not None and declared.high is not None:
        return f"{kind} from {declared.low:g} to {declared.high:g}{unit}"
    return kind


def changed(settings: S, changes: Mapping[str, object]) -> S:
    """A copy of a settings dataclass with some knobs changed, each checked.

    Raises SettingsError for an unknown name or a value outside its range.
    """
    declared = {entry.name: entry for entry in knobs_of(settings)}
    for name in changes:
        if name not in declared:
            raise SettingsError(f"There is no setting '{name}'.", f"Known: {', '.join(sorted(declared))}.")
    checked_changes: dict[str, Any] = {
        name: checked(declared[name], value) for name, value in changes.items()
    }
    return dataclasses.replace(settings, **checked_changes)
