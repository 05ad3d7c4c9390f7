"""Numbers and lists as parts of a sentence."""

from collections.abc import Sequence


def counted(number: int, one: str, many: str = "") -> str:
    """A number with its noun: "1 camera", "4 cameras"."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def enumerated(words: Sequence[str]) -> str:
    """A list as text: "a, b and c"."""
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else "".join(words)
