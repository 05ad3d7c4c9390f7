"""Practical faults of footage, for recipes: objects in front of the person, moved cameras, motion blur, missing
cameras."""

from dataclasses import replace

import msgspec
import numpy as np

from studio.body.person import PersonMotion, joint_points
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rotations import rotation_from_vector
from studio.results.drawing_footage.room import CHECKS, GRAIN, PLAIN, Block

FREE_MM = 260.0
"""mm: clearance between the joints' paths and an object in front of them."""
TRIES = 400
POST_HALF, POST_HIDES = (25.0, 55.0), (700.0, 1500.0)
BOX_HALF, BOX_HIDES = (110.0, 240.0), (250.0, 700.0)
"""Half sizes of an object, and the height of the person that it covers in its camera's view, mm."""


class Damage(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """clutter : number of objects between person and cameras, in the empty room as well. calibration_px : error of the
    stored calibration at the middle of each picture, in a separate direction for each camera. shutter : exposure time
    as a share of the time from frame to frame. missing : cameras that are calibrated but have no footage.
    """

    clutter: int = 0
    calibration_px: float = 0.0
    shutter: float = 0.0
    missing: tuple[str, ...] = ()


def turned_camera(camera: Camera, pixels: float, direction: float) -> Camera:
    """The camera turned about its own centre so that the middle of the picture moves by `pixels`.

    direction : radians.
    """
    angle = np.arctan(pixels / camera.matrix[0, 0])
    turn = rotation_from_vector(angle * np.array([np.cos(direction), np.sin(direction), 0.0]))
    rotation = turn @ camera.rotation
    return replace(camera, rotation=rotation, translation=-rotation @ camera.centre)


def misplaced(cameras: tuple[Camera, ...], pixels: float, seed: int) -> tuple[Camera, ...]:
    """Every camera turned by `pixels`, in a direction that follows from the seed."""
    rng = np.random.default_rng((seed, 7))
    return tuple(turned_camera(camera, pixels, float(rng.uniform(0.0, 2.0 * np.pi))) for camera in cameras)


def cameras_left(cameras: tuple[Camera, ...], missing: tuple[str, ...]) -> tuple[Camera, ...]:
    """The cameras that have footage. Raises StudioError for an unknown name, and where none is left."""
    names = [camera.name for camera in cameras]
    unknown = sorted(set(missing) - set(names))
    if unknown:
        raise StudioError(
            f"damage.missing names '{unknown[0]}'; the cameras are {', '.join(names)}.", "Correct the entry."
        )
    if len(set(missing)) == len(names):
        raise StudioError("damage.missing leaves no camera.", "Leave at least one of them out of it.")
    return tuple(camera for camera in cameras if camera.name not in missing)


def clutter_in_front(
    count: int, cameras: tuple[Camera, ...], motion: PersonMotion, seed: int
) -> tuple[Block, ...]:
    """Posts and boxes between the person's path and the cameras, one camera after the other, clear of the person.

    Raises StudioError where the person leaves no room for them.
    """
    points = np.stack(list(joint_points(motion).values()), axis=1)
    return clutter_before(count, cameras, points, motion.root[:, :2], seed)


def clutter_before(
    count: int, cameras: tuple[Camera, ...], points: Array, way: Array, seed: int
) -> tuple[Block, ...]:
    """The same for any body. points : (F, K, 3) that stay clear of the objects, mm. way : (F, 2) its middle's path."""
    rng, blocks = np.random.default_rng((seed, 9)), list[Block]()
    for number in range(count):
        camera = cameras[number % len(cameras)]
        for _ in range(TRIES):
            block = _thing(rng, way[rng.integers(len(way))], camera.centre, post=number % 2 == 0)
            if _is_free(block, points):
                blocks.append(block)
                break
        else:
            raise StudioError(
                f"There is no room for {count} things in front of the person.",
                "Give fewer in damage.clutter, or choose a motion that needs less room.",
            )
    return tuple(blocks)


def _thing(rng: np.random.Generator, person: Array, camera: Array, *, post: bool) -> Block:
    """A post or a box on the floor, on the line from the person to a camera."""
    share, aside = float(rng.uniform(0.3, 0.65)), float(rng.uniform(-90.0, 90.0))
    towards = camera[:2] - person
    along = towards / np.linalg.norm(towards)
    x, y = person + share * towards + aside * np.array([-along[1], along[0]])
    half, hides = (POST_HALF, POST_HIDES) if post else (BOX_HALF, BOX_HIDES)
    tall = (1.0 - share) * float(rng.uniform(*hides)) + share * camera[2]
    size = (float(rng.uniform(*half)), float(rng.uniform(*half)), 0.5 * float(tall))
    colour, second = (tuple(float(value) for value in rng.uniform(0.1, 0.7, 3)) for _ in range(2))
    pattern = int(rng.choice([PLAIN, GRAIN, CHECKS]))
    centre, turn = (float(x), float(y), size[2]), float(rng.uniform(0.0, np.pi))
    return Block(centre, size, _three(colour), pattern, _three(second), turn)


def _is_free(block: Block, points: Array) -> bool:
    """Whether a block is clear of all points (F, K, 3)."""
    away = points[..., :2] - np.array(block.centre[:2])
    cosine, sine = np.cos(block.turn), np.sin(block.turn)
    local = np.stack(
        [cosine * away[..., 0] + sine * away[..., 1], cosine * away[..., 1] - sine * away[..., 0]]
    )
    outside = np.maximum(np.abs(local) - np.array(block.half[:2])[:, None, None], 0.0)
    return bool(np.hypot(*outside).min() > FREE_MM)


def _three(values: tuple[float, ...]) -> tuple[float, float, float]:
    return values[0], values[1], values[2]
