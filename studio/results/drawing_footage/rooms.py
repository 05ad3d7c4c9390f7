"""The rooms of footage by name: four furnished by hand, others at random."""

from dataclasses import replace

import numpy as np

from studio.results.drawing_footage.room import (
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

Colour = tuple[float, float, float]

# A cluttered room.

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

# A room like the Lee walk's: grey carpet, white desks with dark things on them, cabinets and partitions. Dark clothes
# hardly stand out from it, and one hard lamp throws shadows that background subtraction does not always detect:
# masks get holes and remnants, as real ones have.

OFFICE_LIGHTS = np.array(
    [[900.0, 250.0, 2860.0], [240.0, 0.0, 0.0], [0.50, 0.49, 0.47], [0.44, 0.445, 0.455]]
)

DARK, WHITE, GREY = (0.10, 0.10, 0.11), (0.82, 0.82, 0.80), (0.48, 0.49, 0.49)

OFFICE = (
    Block((0, 0, 3), (2895, 2595, 3), (0.27, 0.27, 0.275), CARPET, (0.31, 0.305, 0.30)),
    # desks: white tops, dark beneath, with screens, keyboards and a lamp's foot
    Block((-700, 2230, 720), (1150, 340, 18), WHITE, PLAIN),
    Block((-700, 2420, 350), (1100, 120, 350), DARK, GRAIN, (0.16, 0.16, 0.17)),
    Block((-1150, 2350, 880), (210, 40, 150), DARK, PLAIN),
    Block((-1150, 2120, 745), (200, 70, 10), (0.20, 0.20, 0.21), CHECKS, (0.12, 0.12, 0.13)),
    Block((-250, 2350, 900), (150, 120, 165), (0.30, 0.31, 0.33), PLAIN),
    Block((300, 2260, 760), (60, 60, 30), (0.14, 0.14, 0.15), PLAIN),
    Block((1250, -2200, 720), (900, 330, 18), WHITE, PLAIN),
    Block((1250, -2400, 350), (860, 100, 350), DARK, GRAIN, (0.18, 0.17, 0.16)),
    Block((1500, -2300, 870), (220, 45, 140), DARK, PLAIN),
    Block((900, -2150, 742), (230, 160, 8), (0.70, 0.70, 0.66), CHECKS, (0.35, 0.36, 0.38), 0.3),
    # chairs
    Block((-1250, 1650, 230), (210, 210, 230), (0.13, 0.13, 0.14), GRAIN, (0.20, 0.20, 0.21), 0.5),
    Block((700, -1650, 230), (210, 210, 230), (0.15, 0.15, 0.16), GRAIN, (0.22, 0.22, 0.23), 0.2),
    # cabinets, a partition, boxes
    Block((-2480, 350, 900), (380, 850, 900), (0.60, 0.60, 0.57), TILES, (0.48, 0.48, 0.46)),
    Block((-2550, -1250, 500), (300, 500, 500), GREY, GRAIN, (0.40, 0.41, 0.41)),
    Block((2500, 500, 650), (330, 900, 650), (0.56, 0.55, 0.52), TILES, (0.44, 0.43, 0.41)),
    Block((2450, 300, 1330), (150, 200, 30), (0.12, 0.12, 0.13), PLAIN),
    Block((2450, 900, 1380), (120, 160, 80), (0.55, 0.46, 0.34), CHECKS, (0.40, 0.32, 0.24), 0.2),
    Block((1500, 2450, 450), (600, 130, 450), GREY, GRAIN, (0.40, 0.41, 0.42)),
)

# A hall to dance in: a wide wooden floor, a barre and mirrors along the walls, a piano, chairs at the edge.

HALL_LIGHTS = np.array([[900.0, 250.0, 3340.0], *OFFICE_LIGHTS[1:]])
WOOD, PALE, PIANO = (0.46, 0.35, 0.24), (0.72, 0.71, 0.68), (0.13, 0.12, 0.12)

HALL = (
    Block((0, 0, 3), (4295, 4295, 3), (0.44, 0.42, 0.40), PLANKS, (0.38, 0.36, 0.345)),
    # barres
    Block((0, 4150, 1050), (3200, 25, 25), WOOD, PLAIN),
    Block((-4150, 0, 1050), (25, 3000, 25), WOOD, PLAIN),
    # mirrors, curtains, posters
    *(Block((x, 4285, 1500), (780, 12, 1100), (0.62, 0.66, 0.69), PLAIN) for x in (-1700, 0, 1700)),
    Block((-4285, -1900, 1700), (12, 900, 1600), (0.34, 0.20, 0.22), GRAIN, (0.28, 0.16, 0.18)),
    Block((-4285, 1900, 1700), (12, 900, 1600), (0.34, 0.20, 0.22), GRAIN, (0.28, 0.16, 0.18)),
    Block((1500, -4285, 1700), (450, 12, 620), (0.60, 0.58, 0.50), POSTER, (0.30, 0.34, 0.44)),
    Block((-1700, -4285, 1650), (620, 12, 420), (0.64, 0.55, 0.44), POSTER, (0.44, 0.26, 0.22)),
    Block((4285, 900, 1900), (12, 1300, 800), PALE, TILES, (0.62, 0.65, 0.68)),
    # piano with its stool, chairs, bags
    Block((3650, -2900, 620), (330, 780, 620), PIANO, GRAIN, (0.17, 0.16, 0.15)),
    Block((3120, -2900, 250), (170, 330, 250), PIANO, PLAIN),
    *(Block((x, -3900, 240), (210, 210, 240), (0.30, 0.36, 0.42), GRAIN) for x in (-2600, -1900, 300, 1000)),
    Block((-3800, -3500, 160), (280, 200, 160), (0.28, 0.42, 0.34), CHECKS, (0.22, 0.30, 0.26), 0.4),
    Block((3900, 3400, 900), (260, 500, 900), PALE, GRAIN, (0.62, 0.60, 0.57)),
)

# A robot's cell: a concrete floor, a fence of posts and panels, cabinets, a conveyor with boxes, a pallet, a tool rack.

CELL_LIGHTS = np.array([[600.0, -700.0, 3140.0], [330.0, 0.0, 0.0], [0.44, 0.44, 0.43], [0.50, 0.51, 0.53]])
STEEL, SIGNAL, CARTON = (0.42, 0.44, 0.46), (0.72, 0.60, 0.10), (0.56, 0.44, 0.30)

CELL = (
    Block((0, 0, 3), (2795, 2795, 3), (0.46, 0.46, 0.45), CARPET, (0.40, 0.40, 0.40)),
    Block((0, 0, 8), (520, 520, 8), (0.30, 0.31, 0.32), GRAIN, (0.26, 0.27, 0.28)),
    # fence
    *(Block((x, 2350, 1000), (30, 30, 1000), SIGNAL) for x in (-2300, -1150, 0, 1150, 2300)),
    *(
        Block((x, 2360, 1100), (560, 8, 850), STEEL, TILES, (0.34, 0.36, 0.38))
        for x in (-1725, -575, 575, 1725)
    ),
    *(Block((-2350, y, 1000), (30, 30, 1000), SIGNAL) for y in (-1800, -600, 600, 1800)),
    *(Block((-2360, y, 1100), (8, 580, 850), STEEL, TILES, (0.34, 0.36, 0.38)) for y in (-1200, 0, 1200)),
    # cabinet and controller
    Block((2450, 1500, 900), (250, 420, 900), (0.66, 0.66, 0.62), GRAIN, (0.60, 0.60, 0.57)),
    Block((2190, 1500, 1250), (12, 160, 110), (0.10, 0.12, 0.16)),
    Block((2400, 300, 450), (260, 350, 450), (0.24, 0.30, 0.40), GRAIN, (0.20, 0.25, 0.34)),
    # conveyor with boxes
    Block((300, -1500, 640), (1700, 260, 30), (0.16, 0.16, 0.17), GRAIN, (0.22, 0.22, 0.23)),
    *(Block((x, -1500, 300), (40, 220, 300), STEEL) for x in (-1200, 300, 1800)),
    Block((-700, -1500, 790), (170, 140, 120), CARTON, PLAIN),
    Block((100, -1480, 760), (130, 150, 90), CARTON, GRAIN, (0.48, 0.37, 0.25), 0.3),
    Block((900, -1520, 820), (160, 160, 150), (0.24, 0.36, 0.52), CHECKS, (0.70, 0.70, 0.68), 0.1),
    # pallet
    Block((-1500, 1100, 75), (500, 400, 75), (0.52, 0.40, 0.26), PLANKS, (0.40, 0.30, 0.20)),
    Block((-1650, 1050, 350), (280, 280, 200), CARTON, GRAIN, (0.50, 0.39, 0.27)),
    Block((-1250, 1200, 300), (160, 200, 150), (0.62, 0.52, 0.38), PLAIN),
    Block((-1600, 1000, 680), (200, 180, 130), (0.30, 0.42, 0.32), CHECKS, (0.56, 0.54, 0.46), 0.4),
    # tool rack, bin
    Block((700, 2100, 900), (420, 110, 60), STEEL, GRAIN, (0.36, 0.38, 0.40)),
    *(Block((400 + 200 * k, 2080, 1010), (50, 50, 60), (0.14, 0.14, 0.15)) for k in range(4)),
    Block((1700, 900, 220), (220, 260, 220), (0.55, 0.16, 0.12), GRAIN, (0.48, 0.14, 0.10), 0.5),
)

# A table top of the colour of skin before a wall of nearly that colour: what stands on it is hardly told by its colour.

TABLE_LIGHTS = np.array([[700.0, -900.0, 2840.0], [250.0, 0.0, 0.0], [0.46, 0.445, 0.42], [0.56, 0.57, 0.59]])

TABLETOP = (
    Block((0, 0, 3), (2895, 2595, 3), (0.70, 0.45, 0.345), GRAIN, (0.62, 0.39, 0.295)),
    *(
        Block(centre, half, (0.72, 0.50, 0.40), GRAIN, (0.66, 0.45, 0.355))
        for centre, half in (
            ((2890, 0, 1450), (10, 2590, 1450)),
            ((-2890, 0, 1450), (10, 2590, 1450)),
            ((0, 2590, 1450), (2880, 10, 1450)),
            ((0, -2590, 1450), (2880, 10, 1450)),
        )
    ),
    Block((1500, 1300, 60), (420, 280, 60), (0.55, 0.40, 0.32), CHECKS, (0.66, 0.50, 0.40), 0.4),
    Block((-1700, -1200, 45), (300, 420, 45), (0.72, 0.50, 0.40), GRAIN, (0.58, 0.36, 0.28), 0.9),
)

ROOMS = {
    "furnished": Room((2900.0, 2600.0), 2900.0, FURNITURE, LIGHTS),
    "office": Room((2900.0, 2600.0), 2900.0, OFFICE, OFFICE_LIGHTS),
    "hall": Room((4300.0, 4300.0), 3400.0, HALL, HALL_LIGHTS),
    "cell": Room((2800.0, 2800.0), 3200.0, CELL, CELL_LIGHTS),
    "tabletop": Room((2900.0, 2600.0), 2900.0, TABLETOP, TABLE_LIGHTS),
}

# Randomly furnished rooms.

DRAWN = "drawn-"
HALF_MM, HEIGHT_MM = (2800.0, 3700.0), (2700.0, 3300.0)
FURNITURE_HEIGHT_MM = (350.0, 1250.0)
"""Below the cameras, which hang higher along the walls."""
PIECES, PICTURES = (6, 12), (3, 7)
SKIN_OF_WALL = 12.0
FLOOR_AND_WALLS = 5
"""The first blocks of a drawn room: the floor and four walls."""


def is_room(name: str) -> bool:
    """Whether a name is a room's: one of ROOMS, or "drawn-" and a whole number."""
    return name in ROOMS or (name.startswith(DRAWN) and name.removeprefix(DRAWN).isdecimal())


def room_called(name: str, obstacle_height: float = 0.0) -> Room:
    """The room of that name; with an obstacle of the given height (mm) at the origin, if above 0."""
    room = ROOMS[name] if name in ROOMS else drawn_room(int(name.removeprefix(DRAWN)))
    return replace(room, blocks=room.blocks + obstacle(obstacle_height))


def drawn_room(seed: int) -> Room:
    """The room of a number: size, walls, floor, light and furniture follow from it."""
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
    return Room(half, height, tuple(blocks), lights)


def _walls(rng: np.random.Generator, half: tuple[float, float], height: float) -> list[Block]:
    """Panels over the walls, some of them patterned."""
    blocks: list[Block] = []
    for axis in (0, 1):
        for sign in (-1.0, 1.0):
            colour = _colour(rng, 0.35, 0.78, 0.06)
            pattern = int(rng.choice([PLAIN, PLAIN, GRAIN, TILES]))
            centre, size = [0.0, 0.0, 0.5 * height], [half[0] - 20, half[1] - 20, 0.5 * height - 40]
            centre[axis], size[axis] = sign * (half[axis] - 2.0), 2.0
            blocks.append(Block(_three(centre), _three(size), colour, pattern, _darker(colour, 0.85)))
    return blocks


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
