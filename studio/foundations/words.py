"""Numbers and lists as parts of a sentence."""

import re
from collections.abc import Sequence

CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")


def printable(text: str) -> str:
    """A text whose control characters are written out: a terminal obeys those that came with a session."""
    return CONTROL.sub(lambda one: f"\\x{ord(one[0]):02x}", text)


def counted(number: int, one: str, many: str = "") -> str:
    """A number with its noun: "1 camera", "4 cameras"."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def sentence(words: str) -> str:
    """Words as the beginning of a sentence, with a capital letter."""
    return words[:1].upper() + words[1:]


def enumerated(words: Sequence[str]) -> str:
    """A list as text: "a, b and c"."""
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else "".join(words)
