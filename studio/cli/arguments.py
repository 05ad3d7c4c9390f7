"""Arguments that several commands understand alike."""

from collections.abc import Sequence

from studio.errors import FootageError, RunError


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
