"""The cameras in the scene: a frame of thin bars as a trimesh mesh, the picture on its plane, a name.

Clicking a camera chooses it; clicking it twice looks through it: the viewer takes the camera's place and the picture
becomes the backdrop, so that the body stands in front of its own picture.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from studio.app.scene.camera_placement import PicturePlane, StraightPicture, picture_plane, straight_picture
from studio.foundations.arrays import Bytes
from studio.foundations.geometry.camera import Camera
from studio.runs.drawing.colour_tokens import ColourTokens

DEPTH = 0.8
BACKDROP_DEPTH = 14.0
LONGEST_SIDE = 480
TWICE_SECONDS = 0.5
"""Between two clicks that count as one double click."""
_BAR = 0.008
_LOOK_DISTANCE = 3.0
_JPEG_QUALITY = 72

# Metres: far enough to count as another place, never drawn.
_ASIDE = np.array([0.0, 0.0, 1.0])


class CameraView:
    """One camera. on_click : called in a thread of viser's with whether it was the second click of two."""

    def __init__(
        self, server: viser.ViserServer, camera: Camera, on_click: Callable[[bool], None] = lambda _: None
    ) -> None:
        self.camera = camera
        self.plane: PicturePlane = picture_plane(camera)
        name = f"/cameras/{camera.name}"
        server.scene.add_frame(name, show_axes=False, wxyz=self.plane.wxyz, position=self.plane.position)
        bars = frustum_mesh(self.plane)
        self.bars = server.scene.add_mesh_simple(
            f"{name}/bars",
            np.asarray(bars.vertices),
            np.asarray(bars.faces),
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
        )
        width, height = self.plane.size
        self.picture = server.scene.add_image(
            f"{name}/picture",
            np.zeros((4, 4, 3), dtype=np.uint8),
            width * DEPTH,
            height * DEPTH,
            format="jpeg",
            jpeg_quality=_JPEG_QUALITY,
            cast_shadow=False,
            receive_shadow=False,
            position=self.plane.middle * DEPTH,
            visible=False,
        )
        self._label = server.scene.add_label(
            f"{name}/name",
            camera.name,
            position=(self.plane.middle[0] * DEPTH, self.plane.top * DEPTH - 0.07, DEPTH),
            anchor="bottom-center",
            font_screen_scale=0.8,
        )
        self._straight: dict[int, StraightPicture] = {}
        self._has_picture = False
        self._on_click, self._clicked = on_click, float("-inf")
        for handle in (self.bars, self.picture):
            handle.on_click(self._click)

    async def _click(self, _: object) -> None:
        now = time.monotonic()
        is_second = now - self._clicked < TWICE_SECONDS
        self._clicked = float("-inf") if is_second else now
        self._on_click(is_second)

    def hang(self, picture: Bytes) -> None:
        """Hang a picture (H, W, 3) BGR, as stored or evenly reduced, on the plane."""
        width = picture.shape[1]
        if width not in self._straight:
            self._straight[width] = straight_picture(self.camera, width, LONGEST_SIDE)
        self.picture.image = np.ascontiguousarray(self._straight[width](picture)[:, :, ::-1])
        self._has_picture = True

    def show(
        self, tokens: ColourTokens, visible: bool = True, picture: bool = False, through: str | None = None
    ) -> None:
        """Show or hide the camera and its picture. through : the camera that the viewers look through: its picture
        becomes the backdrop, and the others are hidden.
        """
        is_backdrop = through == self.camera.name
        self.bars.visible = self._label.visible = visible and through is None
        self.bars.color = tokens["camera-frame"]
        hung = is_backdrop or (through is None and visible and picture)
        self.picture.visible = self._has_picture and hung
        depth = BACKDROP_DEPTH if is_backdrop else DEPTH
        self.picture.scale = depth / DEPTH
        self.picture.position = self.plane.middle * depth


class CameraViews:
    """All cameras of a session. clicked : called in a thread of viser's with a camera's name and whether twice."""

    def __init__(
        self,
        server: viser.ViserServer,
        cameras: Sequence[Camera],
        clicked: Callable[[str, bool], None] = lambda camera, twice: None,
    ) -> None:
        self._server = server
        self._through: str | None = None
        self._shown: tuple[object, ...] = ()
        self._free: dict[int, tuple[NDArray[np.float64], ...]] = {}
        self.views = {
            camera.name: CameraView(server, camera, partial(clicked, camera.name)) for camera in cameras
        }

    def hang(self, pictures: Mapping[str, Bytes]) -> None:
        """Hang new pictures, by camera name; they appear with the next `show`."""
        for name, picture in pictures.items():
            self.views[name].hang(picture)
        self._shown = ()

    def show(self, tokens: ColourTokens, visible: bool, pictures: bool, through: str | None = None) -> None:
        """Show or hide cameras and pictures; put the viewers into a camera's place, or back (None)."""
        shown = tokens.name, visible, pictures, through
        if shown != self._shown:
            self._shown = shown
            for view in self.views.values():
                view.show(tokens, visible, pictures, through)
        if through == self._through:
            return
        self._through = through
        for client in self._server.get_clients().values():
            self.place(client)

    def leave_here(self) -> None:
        """Let viewers stay where they are when the camera is left, upright and with their own lens."""
        for client in self._server.get_clients().values():
            if client.client_id in self._free:
                _, _, up, fov = self._free[client.client_id]
                camera = client.camera
                nearer = np.tan(camera.fov / 2.0) / np.tan(float(fov) / 2.0)
                place = camera.look_at + nearer * (camera.position - camera.look_at)
                self._free[client.client_id] = place, camera.look_at, up, fov

    def place(self, client: viser.ClientHandle) -> None:
        """Put a viewer into the place of the chosen camera, or back where it was."""
        camera = client.camera
        before = (camera.position, camera.look_at, camera.up_direction, np.array(camera.fov))
        if self._through is None:
            eye = self._free.pop(client.client_id, None)
            if eye is None:
                return
            position, look_at, up, fov = eye
        else:
            self._free.setdefault(client.client_id, before)
            plane = self.views[self._through].plane
            position, up = plane.position, plane.up
            look_at = position + plane.forward * _LOOK_DISTANCE
            fov = plane.field_of_view(camera.aspect)
        with client.atomic():
            # A slow browser reports its old place after it was moved away; viser believes it and would skip the
            # way back to a place that it takes to be the viewer's already.
            camera.position = position + _ASIDE
            camera.position = position
            camera.up_direction = up
            camera.look_at = look_at
            camera.fov = float(fov)


def frustum_mesh(plane: PicturePlane, depth: float = DEPTH, bar: float = _BAR) -> trimesh.Trimesh:
    """The camera's frame in its own upright frame, metres: four bars to the picture's corners, its four
    edges, and a small triangle over its upper edge that shows the up direction.
    """
    corners = plane.corners * depth
    origin = np.zeros(3)
    tip = plane.middle * depth + np.array([0.0, (plane.top - plane.bottom) / 2.0 * depth - 0.06, 0.0])
    wing = np.array([0.05, 0.0, 0.0])
    top = (corners[0] + corners[1]) / 2.0
    segments = [(origin, corner) for corner in corners]
    segments += [(corners[index], corners[(index + 1) % 4]) for index in range(4)]
    segments += [(top - wing, tip), (tip, top + wing)]
    bars: trimesh.Trimesh = trimesh.util.concatenate(  # pyright: ignore[reportAssignmentType]
        [trimesh.creation.cylinder(radius=bar / 2.0, segment=np.array(pair), sections=6) for pair in segments]
    )
    return bars
