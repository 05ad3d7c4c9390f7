"""Arguments that several commands understand alike."""

from studio.errors import RunError


def frame_range(text: str) -> tuple[int, int | None]:
    """A:B as numbers; either side may be left out. Raises RunError."""
    first, colon, last = text.partition(":")
    try:
        return int(first or 0), int(last) if last else (None if colon else int(first) + 1)
    except ValueError:
        raise RunError(
            f"Frames '{text}' cannot be understood.", "Write A:B, half open from 0, like 0:150."
        ) from None
