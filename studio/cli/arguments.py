"""Arguments that several commands understand alike."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import click

from studio.errors import FootageError, RunError

F = TypeVar("F", bound=Callable[..., object])

OFFSET_OPTION = click.option(
    "--offset",
    "offsets",
    multiple=True,
    metavar="CAMERA=FRAMES",
    help="The frame of this camera's footage that was taken with frame 0 of the others (repeatable).",
)
ROTATE_OPTION = click.option(
    "--rotate",
    "rotations",
    multiple=True,
    metavar="CAMERA=DEGREES",
    help="Turn this camera's pictures clockwise by 0, 90, 180 or 270 degrees (repeatable).",
)


def footage_options(function: F) -> F:
    """How the footage of a source is read and kept, for commands that take some in."""
    options = (
        click.option(
            "--fps", type=float, help="Frames per second, where the footage does not say (pictures)."
        ),
        click.option("--trial", metavar="NAME", help="Which trial, where a folder holds several."),
        OFFSET_OPTION,
        ROTATE_OPTION,
        click.option(
            "--despite-findings",
            is_flag=True,
            help="Take a calibration that would make results wrong (z not up, a wrong unit), with a warning.",
        ),
        click.option(
            "--copy/--reference",
            default=True,
            help="Copy the footage (default), or refer to it where it lies.",
        ),
    )
    for option in reversed(options):
        function = option(function)
    return function


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
    found: dict[str, int] = {}
    for word in words:
        camera, equals, number = word.rpartition("=")
        try:
            value = int(number)
        except ValueError:
            equals = ""
            value = 0
        if not equals or not camera:
            raise FootageError(
                f"'{option} {word}' cannot be understood.",
                f"Write the camera and a whole number: {option} cam1=3.",
            )
        if camera in found:
            raise FootageError(f"'{option}' names camera '{camera}' twice.", "Give one number a camera.")
        found[camera] = value
    return found
