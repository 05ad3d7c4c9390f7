"""The tracking space: the box on the floor that the cameras see."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.sight import sees

HEIGHT = 2300.0
"""mm: a tall person with raised arms."""
LEVELS = (300.0, 1000.0, 1700.0)
"""mm above the floor of knees, hips and head: a place is seen when all of these are."""
GRID = 96
LEAST_SIDE, MOST_SIDE = 1200.0, 12000.0
FEWEST_PLACES = 12
"""Least grid places of a space: fewer are too narrow for a person."""


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """An upright box of the world. lower, upper : (3,) mm.

    The octree's root is the cube that stands on the middle of the box's floor with `edge` as its side; voxels
    outside the box are never tested.
    """

    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        if not (np.isfinite([self.lower, self.upper]).all() and (self.upper > self.lower).all()):
            raise CalibrationError(
                f"A tracking space from {self.lower} to {self.upper} mm is empty.",
                "Give a lower and an upper corner in mm, the upper one greater in x, y and z.",
            )

    @property
    def edge(self) -> float:
        """Side of the octree's cube, mm."""
        return float((self.upper - self.lower).max())

    @property
    def corner(self) -> Array:
        """(3,) the cube's lower corner, mm."""
        middle = 0.5 * (self.lower[:2] + self.upper[:2])
        return np.array([*(middle - 0.5 * self.edge), self.lower[2]])


def box_of(cameras: Sequence[Camera], *, scale: float = 1.0) -> Box:
    """The space on the floor that all cameras see, else the most cameras with a common view.

    A place counts as seen when knees, hips and head of a person standing there are in the picture.
    scale : of the body beside a person, by which the heights and sides are multiplied (`scale_of`).
    Raises CalibrationError where no two cameras (of several) see a common place.
    """
    if not cameras:
        raise CalibrationError("A tracking space needs at least one camera.", "Give a calibration.")
    height = HEIGHT * scale
    middle, reach = _surroundings(cameras, 0.5 * height, scale)
    steps = np.linspace(-reach, reach, GRID)
    x, y = np.meshgrid(float(middle[0]) + steps, float(middle[1]) + steps, indexing="ij")
    seeing = np.zeros(x.shape, dtype=np.int64)
    for camera in cameras:
        places = np.stack([np.stack([x, y, np.full_like(x, scale * level)], axis=-1) for level in LEVELS])
        seeing += sees(camera, places).all(axis=0)
    for least in range(len(cameras), min(len(cameras), 2) - 1, -1):
        watched = seeing >= least
        if np.count_nonzero(watched) >= FEWEST_PLACES:
            break
    else:
        raise CalibrationError(
            "No two cameras see a common place on the floor.",
            "Check the calibration's unit and its upward direction, and that the session's body is that of the subject:"
            " its size decides how high above the floor a place must be seen.",
        )
    lower = np.array([x[watched].min(), y[watched].min()])
    upper = np.array([x[watched].max(), y[watched].max()])
    half = np.maximum(0.5 * (upper - lower), 0.5 * LEAST_SIDE * scale)
    centre = 0.5 * (lower + upper)
    return Box(np.array([*(centre - half), 0.0]), np.array([*(centre + half), height]))


def _surroundings(cameras: Sequence[Camera], height: float, scale: float) -> tuple[Array, float]:
    """The point (2,) that the optical axes pass nearest to, and the search radius around it, mm."""
    axes = np.stack([camera.rotation[2] for camera in cameras])
    centres = np.stack([camera.centre for camera in cameras])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    # Parallel axes do not meet: a weak pull to the cameras' own middle at the space's height then decides.
    pull = 1e-3 * np.eye(3)
    at = np.array([*centres[:, :2].mean(axis=0), height])
    weights: Array = across.sum(axis=0) + pull
    right: Array = np.einsum("vij,vj->i", across, centres) + pull @ at
    middle = np.asarray(np.linalg.solve(weights, right), dtype=np.float64)
    distance = np.linalg.norm(centres[:, :2] - middle[:2], axis=1)
    return middle[:2], float(np.clip(1.2 * distance.max(), 0.5 * LEAST_SIDE * scale, MOST_SIDE))
