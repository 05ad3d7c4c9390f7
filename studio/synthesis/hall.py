"""A hall to dance in: a wide wooden floor, a barre and mirrors along the walls, a piano, chairs at the edge."""

from studio.synthesis.office import LIGHTS
from studio.synthesis.room import CHECKS, GRAIN, PLAIN, PLANKS, POSTER, TILES, Block, Room, obstacle

HALF, HEIGHT = (4300.0, 4300.0), 3400.0
WOOD, PALE, DARK = (0.46, 0.35, 0.24), (0.72, 0.71, 0.68), (0.13, 0.12, 0.12)

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
    Block((3650, -2900, 620), (330, 780, 620), DARK, GRAIN, (0.17, 0.16, 0.15)),
    Block((3120, -2900, 250), (170, 330, 250), DARK, PLAIN),
    *(Block((x, -3900, 240), (210, 210, 240), (0.30, 0.36, 0.42), GRAIN) for x in (-2600, -1900, 300, 1000)),
    Block((-3800, -3500, 160), (280, 200, 160), (0.28, 0.42, 0.34), CHECKS, (0.22, 0.30, 0.26), 0.4),
    Block((3900, 3400, 900), (260, 500, 900), PALE, GRAIN, (0.62, 0.60, 0.57)),
)


def hall(obstacle_height: float = 0.0) -> Room:
    """The hall; with a box of the given height (mm) at the origin where one is stepped over."""
    lights = LIGHTS.copy()
    lights[0, 2] = HEIGHT - 60.0
    return Room(HALF, HEIGHT, HALL + obstacle(obstacle_height), lights)
