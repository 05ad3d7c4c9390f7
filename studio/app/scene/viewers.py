"""Where the scene's viewers stand: put or eased to an eye, noted when they move by themselves.

viser's camera has no animation of its own and tells of every move, its own and those from here alike.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import viser

from studio.app.scene.viewpoint import Eye, between, is_browsers_own
from studio.foundations.arrays import Array

EASE_SECONDS = 0.7
SETTLE_SECONDS = 0.5
"""After an eased move, in which what a slow browser says of it still comes."""
COMING_SECONDS = 3.0
EYE_TOLERANCE = 0.02
"""Metres within which a viewer has not moved."""
DRAGGED = 0.05
"""Metres, of place or direction, by which a viewer who looks through a camera has been dragged out of it."""
_USUAL_HEIGHT = 400
_USUAL_LENS = 0.85, 16.0 / 9.0
RESHAPED = 0.06
"""Share by which a view's width over height has to change for a framed body to be framed again."""


@dataclass(frozen=True, slots=True)
class _Ease:
    start: Eye
    end: Eye
    began: float


class Viewers:
    """The viewers of one scene; used by its thread.

    looking : the camera of the viewer who moved last, set by viser's callbacks. is_answer : whether it only says where
    it was put, perhaps in another shape. placed : called with each eye that all viewers are put to. framed : the eye
    that frames the body, which is the usual one then; framed_for : the width over height that it was made for.
    """

    def __init__(self, server: viser.ViserServer, placed: Callable[[Eye], None] = lambda _: None) -> None:
        self._server, self._placed = server, placed
        self.looking: viser.CameraHandle | None = None
        self.is_answer = False
        self.framed: Eye | None = None
        self.framed_for = 0.0
        self._ease: _Ease | None = None
        self._settles = float("-inf")
        self._arrived: str | None = None

    @property
    def first_eye(self) -> Eye:
        """The first view of what is open."""
        view = self._server.initial_camera
        return (*map(float, view.position), *map(float, view.look_at))

    @property
    def usual_eye(self) -> Eye:
        """Where a viewer stands who did not move."""
        return self.framed or self.first_eye

    @property
    def is_moving(self) -> bool:
        return self._ease is not None

    @property
    def has_come(self) -> bool:
        """Whether a viewer stands where it was put: before, its browser says its own place and lens."""
        return self._camera() is not None

    @property
    def is_reshaped(self) -> bool:
        """Whether the view has another shape than the one that the body was framed for."""
        return self.framed is not None and abs(self.lens()[1] / self.framed_for - 1.0) > RESHAPED

    def lens(self) -> tuple[float, float]:
        """The vertical field of view, radians, and width over height of what a viewer sees."""
        camera = self._camera()
        return _USUAL_LENS if camera is None else (float(camera.fov), float(camera.aspect))

    def height(self) -> int:
        """The height of what a viewer sees, pixels."""
        camera = self._camera()
        return _USUAL_HEIGHT if camera is None else max(1, int(camera.image_height))

    def eye(self) -> Eye:
        """Where a viewer stands now."""
        camera = self._camera()
        return self.usual_eye if camera is None else _eye_of(camera)

    def _camera(self) -> viser.CameraHandle | None:
        """The camera of a viewer who has arrived."""
        for client in self._server.get_clients().values():
            if client.camera.update_timestamp and not is_browsers_own(_eye_of(client.camera)):
                return client.camera
        return None

    def put(self, eye: Eye, client: viser.ClientHandle | None = None) -> None:
        """Put all viewers, or one, there at once."""
        if client is not None:
            place_viewer(client, eye)
            return
        self._ease = None
        self._place_eye(eye)

    def _place_eye(self, eye: Eye) -> None:
        for client in self._server.get_clients().values():
            place_viewer(client, eye)
        self._placed(eye)

    def ease(self, eye: Eye, now: float) -> None:
        """Let all viewers go there."""
        self._ease = _Ease(self.eye(), eye, now)

    def settle(self, now: float) -> None:
        """Note that a viewer has come, whose first words are not of its own choice."""
        self._settles = now + COMING_SECONDS

    def shift(self, by: Array, is_usual: bool) -> None:
        """Take all viewers along by (3,) metres, those on their way too. is_usual : the usual place goes along."""
        if self._ease is None:
            self.put(_shifted(self.eye(), by))
        else:
            ease = self._ease
            self._ease = _Ease(_shifted(ease.start, by), _shifted(ease.end, by), ease.began)
        if is_usual and self.framed is not None:
            self.framed = _shifted(self.framed, by)

    def tick(self, now: float) -> None:
        if self._ease is None:
            return
        share = (now - self._ease.began) / EASE_SECONDS
        eye = self._ease.end if share >= 1.0 else between(self._ease.start, self._ease.end, share)
        self._place_eye(eye)
        if share >= 1.0:
            self._ease, self._settles = None, now + SETTLE_SECONDS

    def moved_eye(self, before: Eye | None, now: float) -> tuple[Eye | None] | None:
        """Where a viewer moved to by itself since `before` (None: the usual place), in a tuple; None if it did not."""
        camera, self.looking = self.looking, None
        if camera is None or self._ease is not None:
            return None
        seen = _eye_of(camera)
        if is_browsers_own(seen):
            return None
        if np.allclose(seen, self.usual_eye, atol=EYE_TOLERANCE):
            return None if before is None else (None,)
        if now < self._settles or (before is not None and np.allclose(seen, before, atol=EYE_TOLERANCE)):
            return None
        return (tuple(round(number, 2) for number in seen),)

    def was_dragged_from(self, name: str, place: Array, forward: Array) -> bool:
        """Whether a viewer who was in a camera's place (3,) metres, looking along (3,), is there no longer."""
        camera, self.looking = self.looking, None
        if camera is None:
            return False
        way = camera.look_at - camera.position
        way = way / max(float(np.linalg.norm(way)), 1e-9)
        away = max(float(np.linalg.norm(camera.position - place)), float(np.linalg.norm(way - forward)))
        if away <= EYE_TOLERANCE:
            self._arrived = name
        return away > DRAGGED and self._arrived == name

    def entered(self) -> None:
        """Note that viewers look through another camera, or none: any other move stops."""
        self._arrived = self._ease = None


def _eye_of(camera: viser.CameraHandle) -> Eye:
    return (*map(float, camera.position), *map(float, camera.look_at))


def _shifted(eye: Eye, by: Array) -> Eye:
    return tuple(map(float, np.array(eye) + np.tile(by, 2)))


def place_viewer(client: viser.ClientHandle, eye: Eye) -> None:
    """Put a viewer's eye at a place, looking at another (6,) metres."""
    with client.atomic():
        client.camera.position, client.camera.look_at = np.array(eye[:3]), np.array(eye[3:])
