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


def _by_name(words: Sequence[str], option: str, read: Callable[[str], T], remedy: str) -> dict[str, T]:
    """NAME=VALUE words by name, each at most once."""
    found: dict[str, T] = {}
    for word in words:
        name, equals, text = word.rpartition("=")
        try:
            value = read(text) if name and equals else None
        except ValueError:
            value = None
        if value is None:
            raise FootageError(f"'{option} {word}' cannot be understood.", remedy.format(option))
        if name in found:
            raise FootageError(f"'{option}' names camera '{name}' twice.", "Give one value a name.")
        found[name] = value
    return found
