"""What pictures of a board show: the pixels of its corners, camera by camera and frame by frame."""

from collections.abc import Iterable
from dataclasses import dataclass

from studio.arrays import Array, Indices


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """One board in one picture.

    camera : whose. frame : equal numbers are the same moment in all cameras. picture : what to call it in messages.
    size : width and height of the picture, pixels. ids : (K,) corners seen, indices into `Board.points`.
    pixels : (K, 2) where. mirrored : the board was found only in the mirrored picture (pixels are those of the
    mirrored one).
    """

    camera: str
    frame: int
    picture: str
    size: tuple[int, int]
    ids: Indices
    pixels: Array
    mirrored: bool = False


def of_camera(sightings: Iterable[Sighting], camera: str) -> tuple[Sighting, ...]:
    """Those of one camera, by frame."""
    found = [sighting for sighting in sightings if sighting.camera == camera]
    return tuple(sorted(found, key=lambda sighting: sighting.frame))
