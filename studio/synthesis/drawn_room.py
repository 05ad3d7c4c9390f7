"""Rooms furnished by chance: size, walls, floor, light and furniture follow from one number."""

import numpy as np
from numpy.typing import NDArray

from studio.synthesis.room import (
    BOOKS,
    CARPET,
    CHECKS,
    GRAIN,
    PLAIN,
    PLANKS,
    POSTER,
    TILES,
    Block,
    Room,
    obstacle,
)

Array = NDArray[np.float64]
Colour = tuple[float, float, float]

DRAWN = "drawn-"
HALF_MM, HEIGHT_MM = (2800.0, 3700.0), (2700.0, 3300.0)
FURNITURE_HEIGHT_MM = (350.0, 1250.0)
"""Below the cameras, which hang higher along the walls."""
PIECES, PICTURES = (6, 12), (3, 7)
SKIN_OF_WALL = 12.0
FLOOR_AND_WALLS = 5
"""The first blocks of a drawn room: the floor and four walls."""


def drawn_room(seed: int, obstacle_height: float = 0.0) -> Room:
    """The room of a number; with a box of the given height (mm) at the origin where one is stepped over."""
    rng = np.random.default_rng((seed, 4))
    half = (float(rng.uniform(*HALF_MM)), float(rng.uniform(*HALF_MM)))
    height = float(rng.uniform(*HEIGHT_MM))
    tone = _colour(rng, 0.30, 0.72, 0.05)
    floor = Block(
        (0, 0, 3),
        (half[0] - 5, half[1] - 5, 3),
        _darker(tone, 0.8),
        int(rng.choice([PLANKS, CARPET, TILES])),
        _darker(tone, float(rng.uniform(0.62, 0.75))),
    )
    blocks = [floor, *_walls(rng, half, height)]
    blocks += [_furniture(rng, half) for _ in range(int(rng.integers(*PIECES)))]
    blocks += [_picture(rng, half) for _ in range(int(rng.integers(*PICTURES)))]
    lamp = (float(rng.uniform(-0.4, 0.4)) * half[0], float(rng.uniform(-0.4, 0.4)) * half[1], height - 60.0)
    key, warm = float(rng.uniform(0.38, 0.58)), float(rng.uniform(-0.03, 0.03))
    around = float(rng.uniform(0.42, 0.60))
    lights = np.array(
        [
            lamp,
            [float(rng.uniform(200.0, 420.0)), 0.0, 0.0],
            [key + warm, key, key - warm],
            [around - 0.5 * warm, around, around + 0.5 * warm],
        ]
    )
    return Room(half, height, tuple(blocks) + obstacle(obstacle_height), lights)


def _walls(rng: np.random.Generator, half: tuple[float, float], height: float) -> list[Block]:
    """Panels over the walls, some of them patterned."""
    found = []
    for axis in (0, 1):
        for sign in (-1.0, 1.0):
            colour = _colour(rng, 0.35, 0.78, 0.06)
            pattern = int(rng.choice([PLAIN, PLAIN, GRAIN, TILES]))
            centre, size = [0.0, 0.0, 0.5 * height], [half[0] - 20, half[1] - 20, 0.5 * height - 40]
            centre[axis], size[axis] = sign * (half[axis] - 2.0), 2.0
            found.append(Block(_three(centre), _three(size), colour, pattern, _darker(colour, 0.85)))
    return found


def _furniture(rng: np.random.Generator, half: tuple[float, float]) -> Block:
    """A box along one of the walls."""
    axis, sign = int(rng.integers(2)), float(rng.choice([-1.0, 1.0]))
    size = [float(rng.uniform(180, 380)), float(rng.uniform(250, 750)), 0.0]
    size[2] = 0.5 * float(rng.uniform(*FURNITURE_HEIGHT_MM))
    along = float(rng.uniform(-0.8, 0.8)) * (half[1 - axis] - size[1])
    centre = [sign * (half[axis] - size[0] - 40.0), along, size[2]]
    if axis == 1:
        centre, size = [centre[1], centre[0], centre[2]], [size[1], size[0], size[2]]
    first = _colour(rng, 0.08, 0.75, 0.14)
    pattern = int(rng.choice([PLAIN, GRAIN, BOOKS, CHECKS, TILES]))
    return Block(_three(centre), _three(size), first, pattern, _darker(first, 0.75))


def _picture(rng: np.random.Generator, half: tuple[float, float]) -> Block:
    """Something on a wall."""
    axis, sign = int(rng.integers(2)), float(rng.choice([-1.0, 1.0]))
    centre = [0.0, 0.0, float(rng.uniform(1350, 1750))]
    size = [0.0, 0.0, float(rng.uniform(200, 450))]
    centre[axis], size[axis] = sign * (half[axis] - 5.0), SKIN_OF_WALL
    centre[1 - axis] = float(rng.uniform(-0.7, 0.7)) * half[1 - axis]
    size[1 - axis] = float(rng.uniform(200, 700))
    pattern = int(rng.choice([POSTER, PLAIN, CHECKS]))
    return Block(
        _three(centre), _three(size), _colour(rng, 0.15, 0.8, 0.15), pattern, _colour(rng, 0.15, 0.7, 0.15)
    )


def _colour(rng: np.random.Generator, low: float, high: float, spread: float) -> Colour:
    """A brightness and a hue about it."""
    values = float(rng.uniform(low, high)) + rng.normal(0.0, spread, 3)
    return _three([float(value) for value in np.clip(values, 0.04, 0.85)])


def _darker(colour: Colour, share: float) -> Colour:
    return _three([share * value for value in colour])


def _three(values: list[float]) -> tuple[float, float, float]:
    return values[0], values[1], values[2]
