"""Options of commands that are made from the declarations of knobs."""

from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

import click

from studio.errors import SettingsError
from studio.knobs import Knob, allowed

F = TypeVar("F", bound=Callable[..., object])

SET_OPTION = click.option("--set", "changes", multiple=True, metavar="KNOB=VALUE", help="Any other knob.")


def knob_options(entries: Iterable[Knob], *, with_defaults: bool = True) -> Callable[[F], F]:
    """An option for every knob, passed as text; None where it was not given. with_defaults : tell them in the help."""

    def add(function: F) -> F:
        for entry in reversed(tuple(entries)):
            default = f"; default {entry.default}" if with_defaults else ""
            function = click.option(
                f"--{entry.name.replace('_', '-')}",
                entry.name,
                metavar=entry.kind.__name__.upper(),
                help=f"{entry.help} ({allowed(entry)}{default})",
            )(function)
        return function

    return add


def given(knobs: Mapping[str, str | None]) -> dict[str, str]:
    """The knobs whose option was given."""
    return {name: value for name, value in knobs.items() if value is not None}


def chosen_changes(assignments: Iterable[str]) -> dict[str, str]:
    """KNOB=VALUE pairs. Raises SettingsError where there is no '='."""
    changes: dict[str, str] = {}
    for assignment in assignments:
        name, equals, value = assignment.partition("=")
        if not equals:
            raise SettingsError(f"--set '{assignment}' has no value.", "Write --set knob=value.")
        changes[name.strip()] = value.strip()
    return changes
