"""The room of the footage: floor, walls and furniture as textured boxes under one round lamp.

World: mm, z up, floor at z = 0, the middle of the floor at the origin.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array

IntArray = NDArray[np.int64]

PLAIN, PLANKS, GRAIN, BOOKS, CHECKS, POSTER, TILES, CARPET = range(8)


@dataclass(frozen=True, slots=True)
class Block:
    """A box in the room.

    centre, half : mm. turn : about the vertical, radians. colour, second : RGB 0...1.
    """

    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    colour: tuple[float, float, float]
    pattern: int = PLAIN
    second: tuple[float, float, float] = (0.2, 0.2, 0.2)
    turn: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """Walls at ±half (mm), height, blocks.

    lights : (4, 3) lamp position, (lamp radius, 0, 0), lamp colour, ambient colour.
    """

    half: tuple[float, float]
    height: float
    blocks: tuple[Block, ...]
    lights: Array


def obstacle(height: float) -> tuple[Block, ...]:
    """A box of the given height (mm) at the origin as an obstacle; none for height 0."""
    half = (50.0, 340.0, 0.5 * height)
    box = Block((0.0, 0.0, half[2]), half, (0.62, 0.50, 0.34), GRAIN, (0.54, 0.42, 0.28))
    return (box,) if height > 0.0 else ()


def block_tables(room: Room) -> tuple[Array, IntArray]:
    """(B, 14) centre, half sizes, colour, second colour, cos and sin of the turn; and (B,) patterns."""
    rows = [
        (*block.centre, *block.half, *block.colour, *block.second, np.cos(block.turn), np.sin(block.turn))
        for block in room.blocks
    ]
    return np.array(rows, dtype=float).reshape(len(rows), 14), np.array(
        [b.pattern for b in room.blocks], dtype=int
    )
