"""Spells in which a limb is lost: rows of frames in which one of its markers is too far off."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Spell:
    """A limb lost: which, for how many frames in a row, and whether it was found again before the end."""

    limb: str
    frames: int
    found_again: bool


def spells(lost: Sequence[Collection[str]]) -> list[Spell]:
    """All spells, limb by limb. lost : the limbs that are lost in every frame."""
    found: list[Spell] = []
    for limb in sorted({limb for limbs in lost for limb in limbs}):
        length = 0
        for limbs in lost:
            if limb in limbs:
                length += 1
            elif length:
                found.append(Spell(limb, length, True))
                length = 0
        if length:
            found.append(Spell(limb, length, False))
    return found
