"""A network's joints in space: sides that it exchanges, a camera that is wrong, and a rendered person's true joints."""

from dataclasses import dataclass

import numpy as np
import pytest
from rendered_people import FPS, Rendered, rendered_walk

from studio.body.person import marker_motion
from studio.evidence.person_network import INPUT, Crop, Detection
from studio.foundations.arrays import Array, Bytes
from studio.foundations.errors import FootageError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.progress import no_progress
from studio.results.drawing_footage.cameras import RIGS
from studio.runs.setup.person_landmarks import (
    LEFT_AND_RIGHT,
    NAMES,
    RIGHT_AND_LEFT,
    _joints,
    person_landmarks,
)

FRAMES = 3
CAMERAS = RIGS["corners"]((480, 360), np.random.default_rng(1))
JOINTS = np.random.default_rng(2).uniform((-300.0, -300.0, 100.0), (300.0, 300.0, 1500.0), (12, 3))


def detection(camera: Camera, exchanged: bool = False, wrong: int | None = None) -> Detection:
    """What a camera sees of JOINTS. wrong : a joint that it sees elsewhere."""
    pixels = project(camera, JOINTS)[0]
    if wrong is not None:
        pixels[wrong] += 90.0
    points = np.zeros((39, 2))
    points[RIGHT_AND_LEFT if exchanged else LEFT_AND_RIGHT] = pixels
    points[33], points[34] = (240.0, 180.0), (240.0, 60.0)
    return Detection(1.0, np.ones((INPUT, INPUT), np.float32), points, Crop(240.0, 180.0, 300.0))


def found(seen: dict[str, Detection], before: Array | None = None) -> Array:
    joints = _joints({camera.name: camera for camera in CAMERAS}, seen, before)
    return joints[0]


def test_joints_lie_where_the_rays_meet() -> None:
    seen = {camera.name: detection(camera) for camera in CAMERAS}
    np.testing.assert_allclose(found(seen), JOINTS, atol=0.1)


def test_a_camera_that_exchanges_sides_is_put_right() -> None:
    seen = {camera.name: detection(camera, number == 2) for number, camera in enumerate(CAMERAS)}
    np.testing.assert_allclose(found(seen), JOINTS, atol=0.1)


@pytest.mark.parametrize("wrong", range(len(CAMERAS)))
@pytest.mark.parametrize("always", [True, False])
def test_the_left_side_is_what_most_cameras_call_left_in_all_frames(
    monkeypatch: pytest.MonkeyPatch, wrong: int, always: bool
) -> None:
    """One camera exchanges the sides, the first one too: in every frame, or all of them in the first frame alone."""

    def seen(frame: int) -> dict[str, Detection]:
        return {
            camera.name: detection(camera, number == wrong if always else frame == 0)
            for number, camera in enumerate(CAMERAS)
        }

    frames = [(frame, seen(frame)) for frame in range(FRAMES)]
    monkeypatch.setattr("studio.runs.setup.person_landmarks.followed_person", lambda *_: iter(frames))
    footage = RenderedFootage(None)  # pyright: ignore[reportArgumentType]
    motion = person_landmarks(CAMERAS, footage, no_progress)  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(motion.positions, np.broadcast_to(JOINTS, (FRAMES, 12, 3)), atol=0.1)


def test_sides_go_on_from_the_frame_before_where_every_camera_exchanges_them() -> None:
    seen = {camera.name: detection(camera, exchanged=True) for camera in CAMERAS}
    np.testing.assert_allclose(found(seen, before=JOINTS + 5.0), JOINTS, atol=0.1)


def test_a_joint_that_one_camera_sees_elsewhere_is_that_of_the_others() -> None:
    seen = {
        camera.name: detection(camera, wrong=4 if number == 1 else None)
        for number, camera in enumerate(CAMERAS)
    }
    np.testing.assert_allclose(found(seen), JOINTS, atol=0.1)


def test_two_cameras_that_contradict_each_other_say_nothing_of_a_joint() -> None:
    one, other = CAMERAS[:2]
    points = found({one.name: detection(one), other.name: detection(other, wrong=4)})
    assert np.isnan(points[4]).all()
    np.testing.assert_allclose(np.delete(points, 4, axis=0), np.delete(JOINTS, 4, axis=0), atol=0.5)


@dataclass
class RenderedFootage:
    """As much of footage as the network reads."""

    of: Rendered
    frame_count: int = FRAMES
    fps: float = FPS

    def picture(self, camera: str, frame: int) -> Bytes:
        return self.of.pictures[camera, frame]

    def absent(self, frame: int) -> tuple[str, ...]:
        return ()

    def size(self, camera: str) -> tuple[int, int]:
        return 480, 360


def test_a_rendered_persons_joints_are_near_the_true_ones() -> None:
    walk = rendered_walk(FRAMES)
    motion = person_landmarks(walk.cameras, RenderedFootage(walk), no_progress)  # pyright: ignore[reportArgumentType]
    assert walk.motion is not None
    truth = marker_motion(walk.motion)
    true = truth.positions[:, [truth.names.index(name) for name in NAMES]]
    apart = np.linalg.norm(motion.positions - true, axis=2)
    # Coarse, as the module says, and the right sides: the hips alone lie 180 mm apart.
    assert np.nanmedian(apart) < 70.0
    assert np.isfinite(apart).mean() > 0.9


def test_one_camera_shows_no_place() -> None:
    walk = rendered_walk(1)
    with pytest.raises(FootageError, match="One camera"):
        person_landmarks(walk.cameras[:1], RenderedFootage(walk), no_progress)  # pyright: ignore[reportArgumentType]
