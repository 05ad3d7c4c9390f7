"""A room like the Lee walk's: grey carpet, white desks with dark things on them, cabinets and partitions.

Dark clothes hardly stand out from it, and one hard lamp throws shadows that background subtraction does not take for
shadows everywhere: masks get holes and remnants, as real ones have.
"""

import numpy as np

from studio.synthesis.room import CARPET, CHECKS, GRAIN, PLAIN, TILES, Block, Room, obstacle

HALF, HEIGHT = (2900.0, 2600.0), 2900.0
LIGHTS = np.array([[900.0, 250.0, 2860.0], [240.0, 0.0, 0.0], [0.50, 0.49, 0.47], [0.44, 0.445, 0.455]])

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


def office(obstacle_height: float = 0.0) -> Room:
    """The office; with a box of the given height (mm) at the origin where one is stepped over."""
    return Room(HALF, HEIGHT, OFFICE + obstacle(obstacle_height), LIGHTS.copy())
