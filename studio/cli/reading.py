"""What is written on the command line, read as values."""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from studio.foundations.errors import FootageError, RunError, SettingsError

T = TypeVar("T")


def frame_range(text: str) -> tuple[int | None, int | None]:
    """A:B as numbers; either side may be left out (None). Raises RunError."""
    first, colon, last = text.partition(":")
    try:
        return int(first) if first or not colon else None, int(last) if last else (
            None if colon else int(first) + 1
        )
    except ValueError:
        raise RunError(
            f"Frames '{text}' cannot be understood.", "Write A:B, half open from 0, like 0:150."
        ) from None


def frame_numbers(text: str) -> tuple[int, ...]:
    """A,B,… as numbers, none where nothing was given. Raises RunError."""
    try:
        return tuple(int(word) for word in text.split(",") if word.strip())
    except ValueError:
        raise RunError(f"Frames '{text}' cannot be understood.", "Write numbers: 10,40,80.") from None


def camera_numbers(words: Sequence[str], option: str) -> dict[str, int]:
    """CAMERA=NUMBER words by camera. Raises FootageError."""
    return _by_name(words, option, int, "Write the camera and a whole number: {} cam1=3.")


def measured(words: Sequence[str], option: str) -> dict[str, float]:
    """NAME=NUMBER words by name. Raises FootageError."""
    return _by_name(words, option, float, "Write a name and a number: {} RHip_RKnee=420.")


def numbers(words: Sequence[str], option: str) -> tuple[float, ...]:
    """Words as numbers. Raises SettingsError."""
    try:
        return tuple(float(word) for word in words)
    except ValueError:
        raise SettingsError(
            f"'{option} {' '.join(words)}' is no number.",
            f"Write it again for more: {option} 1000 {option} 2400.",
        ) from None


def place(word: str, option: str) -> tuple[float, float]:
    """X,Y as numbers. Raises FootageError."""
    try:
        x, y = (float(number) for number in word.split(","))
    except ValueError:
        raise FootageError(
            f"'{option} {word}' cannot be understood.",
            f"Write x and y on the floor, in metres: {option} 0.4,-1.2.",
        ) from None
    return x, y


def places(words: Sequence[str], option: str) -> tuple[tuple[float, float], ...]:
    """X,Y words. Raises FootageError."""
    return tuple(place(word, option) for word in words)


def chosen_knobs(assignments: Iterable[str]) -> dict[str, str]:
    """KNOB=VALUE pairs. Raises SettingsError where there is no '='."""
    changes: dict[str, str] = {}
    for assignment in assignments:
        name, equals, value = assignment.partition("=")
        if not equals:
            raise SettingsError(f"--set '{assignment}' has no value.", "Write --set knob=value.")
        changes[name.strip()] = value.strip()
    return changes


def read_assignments(assignments: Sequence[str]) -> dict[str, dict[str, str]]:
    """`NAME.KNOB=VALUE` and `KNOB=VALUE` (for all that have it) as changes by name, those of all under "".

    Raises SettingsError where there is no '='.
    """
    changes: dict[str, dict[str, str]] = {}
    for assignment in assignments:
        left, equals, value = assignment.partition("=")
        if not equals or not left.strip():
            hint = "Write NAME.KNOB=VALUE, like annealed:eq13.adaptive_diffusion=false."
            raise SettingsError(f"'{assignment}' is not an assignment.", hint)
        name, _, knob = left.strip().rpartition(".")
        changes.setdefault(name, {})[knob] = value.strip()
    return changes


def read_grid(assignments: Sequence[str]) -> dict[str, list[str]]:
    """`KNOB=VALUE,VALUE` words as values by knob. Raises SettingsError."""
    grid: dict[str, list[str]] = {}
    for assignment in assignments:
        name, _, text = assignment.partition("=")
        values = [word.strip() for word in text.split(",") if word.strip()]
        if not name.strip() or not values:
            raise SettingsError(
                f"'{assignment}' names no values of a knob.", "Write KNOB=VALUE,VALUE, like survival=0.2,0.5."
            )
        if name.strip() in grid:
            raise SettingsError(f"Knob '{name.strip()}' is named twice.", "Give all of its values at once.")
        grid[name.strip()] = values
    return grid


def _by_name(words: Sequence[str], option: str, read: Callable[[str], T], remedy: str) -> dict[str, T]:
    """NAME=VALUE words by name, each at most once."""
    values: dict[str, T] = {}
    for word in words:
        name, equals, text = word.rpartition("=")
        try:
            value = read(text) if name and equals else None
        except ValueError:
            value = None
        if value is None:
            raise FootageError(f"'{option} {word}' cannot be understood.", remedy.format(option))
        if name in values:
            raise FootageError(f"'{option}' names camera '{name}' twice.", "Give one value a name.")
        values[name] = value
    return values
