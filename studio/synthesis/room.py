"""The room that footage is made in: floor, walls and furniture as textured boxes under one round lamp.

World: mm, z up, floor at z = 0, the middle of the floor at the origin.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
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


LIGHTS = np.array([[700.0, -500.0, 2840.0], [260.0, 0.0, 0.0], [0.46, 0.445, 0.42], [0.56, 0.57, 0.59]])

FURNITURE = (
    # table with two things on it and a stool
    Block((-2300, 1650, 720), (420, 700, 22), (0.50, 0.36, 0.24), GRAIN, (0.40, 0.28, 0.18)),
    *(
        Block((-2300 + x, 1650 + y, 350), (28, 28, 350), (0.32, 0.24, 0.17))
        for x in (-370, 370)
        for y in (-640, 640)
    ),
    Block((-2350, 1400, 850), (130, 200, 110), (0.22, 0.24, 0.26), PLAIN),
    Block((-2250, 2000, 800), (90, 120, 60), (0.68, 0.55, 0.20), CHECKS, (0.55, 0.22, 0.16), 0.4),
    Block((-1750, 1750, 235), (190, 190, 235), (0.46, 0.40, 0.36), GRAIN, (0.36, 0.30, 0.27), 0.3),
    # shelf of books, cabinet, chest
    Block((0, 2480, 900), (900, 160, 900), (0.42, 0.30, 0.20), BOOKS, (0.55, 0.48, 0.38)),
    Block((2350, 1500, 500), (280, 450, 500), (0.74, 0.72, 0.68), GRAIN, (0.64, 0.62, 0.58)),
    Block((2350, 1500, 1090), (160, 260, 90), (0.25, 0.40, 0.34), CHECKS, (0.62, 0.60, 0.52), 0.2),
    Block((2250, -1900, 260), (330, 330, 260), (0.36, 0.42, 0.50), CHECKS, (0.50, 0.56, 0.62), 0.25),
    Block((-2350, -1850, 420), (260, 480, 420), (0.55, 0.50, 0.44), GRAIN, (0.47, 0.42, 0.37)),
    # rug and pictures on the walls
    Block((150, -150, 4), (1250, 900, 4), (0.50, 0.51, 0.50), TILES, (0.43, 0.44, 0.45), 0.15),
    Block((-1500, -2590, 1500), (420, 14, 320), (0.62, 0.64, 0.58), POSTER, (0.30, 0.38, 0.46)),
    Block((1200, -2590, 1450), (300, 14, 420), (0.66, 0.58, 0.46), POSTER, (0.48, 0.26, 0.22)),
    Block((2890, -300, 1500), (14, 520, 360), (0.56, 0.62, 0.68), POSTER, (0.36, 0.42, 0.36)),
    Block((-2890, -100, 1450), (14, 380, 500), (0.80, 0.82, 0.84), TILES, (0.70, 0.73, 0.76)),
)


def furnished_room(obstacle_height: float = 0.0) -> Room:
    """The cluttered room; with a box of the given height (mm) at the origin where one is stepped over."""
    return Room((2900.0, 2600.0), 2900.0, FURNITURE + obstacle(obstacle_height), LIGHTS.copy())


def obstacle(height: float) -> tuple[Block, ...]:
    """A box of the given height (mm) at the origin to be stepped over; none for height 0."""
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
