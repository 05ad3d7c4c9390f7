"""The cameras in the scene: a frame of thin bars as a trimesh mesh, the picture on its plane, a name.

Clicking a camera looks through it: the viewer takes the camera's place and the picture becomes the
backdrop, so that the body stands in front of its own picture.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from studio.geometry.camera import Camera
from studio.runs.colour_tokens import ColourTokens
from studio.scene.camera_placement import PicturePlane, StraightPicture, picture_plane, straight_picture

Bytes = NDArray[np.uint8]

DEPTH = 0.8
BACKDROP_DEPTH = 14.0
LONGEST_SIDE = 480
_BAR = 0.008
_LOOK_DISTANCE = 3.0
_JPEG_QUALITY = 72

# Metres: far enough to count as another place, never drawn.
_ASIDE = np.array([0.0, 0.0, 1.0])


class CameraView:
    """One camera."""

    def __init__(self, server: viser.ViserServer, camera: Camera, tokens: ColourTokens) -> None:
        self.camera = camera
        self.plane: PicturePlane = picture_plane(camera)
        name = f"/cameras/{camera.name}"
        self._server = server
        self._place = server.scene.add_frame(
            name, show_axes=False, wxyz=self.plane.wxyz, position=self.plane.position
        )
        bars = frustum_mesh(self.plane)
        self.bars = server.scene.add_mesh_simple(
            f"{name}/bars",
            np.asarray(bars.vertices),
            np.asarray(bars.faces),
            color=tokens["camera-frame"],
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
        )
        self._label = server.scene.add_label(
            f"{name}/name",
            camera.name,
            position=(self.plane.middle[0] * DEPTH, self.plane.top * DEPTH - 0.07, DEPTH),
            anchor="bottom-center",
            font_screen_scale=0.8,
        )
        self._straight: dict[int, StraightPicture] = {}
        self._visible, self._with_picture, self._role = True, True, "shown"
        self._has_picture = False
        self._show()

    def show_picture(self, picture: Bytes) -> None:
        """Hang a picture (H, W, 3) BGR, as stored or evenly reduced, on the plane."""
        width = picture.shape[1]
        if width not in self._straight:
            self._straight[width] = straight_picture(self.camera, width, LONGEST_SIDE)
        self.picture.image = np.ascontiguousarray(self._straight[width](picture)[:, :, ::-1])
        self._has_picture = True
        self._show()

    def show(self, visible: bool, with_picture: bool) -> None:
        """Show or hide the camera, and its picture."""
        self._visible, self._with_picture = visible, with_picture
        self._show()

    def take_role(self, role: str) -> None:
        """role : "shown" (nobody looks through a camera), "backdrop" (through this one) or "aside" (another
        one).
        """
        self._role = role
        depth = BACKDROP_DEPTH if role == "backdrop" else DEPTH
        self.picture.scale = depth / DEPTH
        self.picture.position = self.plane.middle * depth
        self._show()

    def recolour(self, tokens: ColourTokens, chosen: bool = False) -> None:
        """Take the colours of another theme."""
        self.bars.color = tokens["camera-chosen" if chosen else "camera-frame"]

    def on_click(self, react: Callable[[], None]) -> None:
        """Call `react` when the camera or its picture is clicked."""
        self.bars.on_click(lambda _: react())
        self.picture.on_click(lambda _: react())

    def remove(self) -> None:
        """Take the camera out of the scene (its parts go with it)."""
        self._place.remove()

    def _show(self) -> None:
        plain = self._visible and self._role == "shown"
        self.bars.visible = plain
        self._label.visible = plain
        self.picture.visible = (
            self._has_picture
            and self._role != "aside"
            and (self._role == "backdrop" or (plain and self._with_picture))
        )


class CameraViews:
    """All cameras of a session."""

    def __init__(self, server: viser.ViserServer, cameras: Sequence[Camera], tokens: ColourTokens) -> None:
        self._server = server
        self.through: str | None = None
        self._free: dict[int, tuple[NDArray[np.float64], ...]] = {}
        self.views = {camera.name: CameraView(server, camera, tokens) for camera in cameras}

    def show_pictures(self, pictures: Mapping[str, Bytes]) -> None:
        """Hang new pictures, by camera name."""
        with self._server.atomic():
            for name, picture in pictures.items():
                self.views[name].show_picture(picture)

    def show(self, visible: bool, with_pictures: bool) -> None:
        """Show or hide all cameras and their pictures."""
        for view in self.views.values():
            view.show(visible, with_pictures)

    def recolour(self, tokens: ColourTokens) -> None:
        """Take the colours of another theme."""
        for view in self.views.values():
            view.recolour(tokens)

    def on_click(self, react: Callable[[str], None]) -> None:
        """Call `react` with the camera's name when one is clicked."""
        for name, view in self.views.items():
            view.on_click(lambda name=name: react(name))

    def look_through(self, name: str | None) -> None:
        """Put every viewer into a camera's place, or back where each was before (None)."""
        self.through = name
        for other, view in self.views.items():
            view.take_role("shown" if name is None else "backdrop" if other == name else "aside")
        for client in self._server.get_clients().values():
            if name is None:
                self._set_free(client)
            else:
                self.place_viewer(client, name)

    def place_viewer(self, client: viser.ClientHandle, name: str) -> None:
        """Put one viewer into a camera's place, remembering where it was."""
        camera = client.camera
        remembered = (camera.position, camera.look_at, camera.up_direction, np.array(camera.fov))
        self._free.setdefault(client.client_id, remembered)
        plane = self.views[name].plane
        with client.atomic():
            _put(camera, plane.position)
            camera.look_at = plane.position + plane.forward * _LOOK_DISTANCE
            camera.up_direction = plane.up
            camera.fov = plane.field_of_view(camera.aspect)

    def remove(self) -> None:
        """Take all cameras out of the scene."""
        for view in self.views.values():
            view.remove()
        self.views = {}

    def _set_free(self, client: viser.ClientHandle) -> None:
        remembered = self._free.pop(client.client_id, None)
        if remembered is None:
            return
        position, look_at, up, fov = remembered
        with client.atomic():
            _put(client.camera, position)
            client.camera.up_direction = up
            client.camera.look_at = look_at
            client.camera.fov = float(fov)


def _put(camera: viser.CameraHandle, position: NDArray[np.float64]) -> None:
    """Move a viewer, also where viser takes it to be there already.

    A slow browser tells where it was after it was moved away; viser believes it and would leave out the way back.
    """
    camera.position = position + _ASIDE
    camera.position = position


def frustum_mesh(plane: PicturePlane, depth: float = DEPTH, bar: float = _BAR) -> trimesh.Trimesh:
    """The camera's frame in its own upright frame, metres: four bars to the picture's corners, its four
    edges, and a small triangle over its upper edge that says what is up.
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
