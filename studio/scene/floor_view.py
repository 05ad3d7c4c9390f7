"""The floor: a slab that takes shadows, with half-metre lines, under everything that the cameras see."""

from collections.abc import Sequence

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from studio.geometry.camera import Camera
from studio.runs.colour_tokens import ColourTokens
from studio.scene.limb_meshes import METRES_PER_MM

Array = NDArray[np.float64]

_THICKNESS = 0.02
_LEAST_HALF_WIDTH = 2.0
_MOST_HALF_WIDTH = 8.0


class FloorView:
    """The floor z = 0, as large as the cameras' ring and the person in it."""

    def __init__(
        self, server: viser.ViserServer, cameras: Sequence[Camera], person: Array, tokens: ColourTokens
    ) -> None:
        """person : (3,) mm, where the body begins."""
        self._server = server
        self._middle, self._half_width = floor_extent([*(camera.centre for camera in cameras), person])
        self._slab: viser.MeshHandle | None = None
        self._lines: viser.GridHandle | None = None
        self.recolour(tokens)

    def recolour(self, tokens: ColourTokens) -> None:
        """Draw the floor in a theme's colours."""
        width = 2.0 * self._half_width
        mesh = trimesh.creation.box(extents=(width, width, _THICKNESS))
        self._slab = self._server.scene.add_mesh_simple(
            "/floor/slab",
            np.asarray(mesh.vertices),
            np.asarray(mesh.faces),
            color=tokens["scene-floor"],
            flat_shading=True,
            cast_shadow=False,
            position=(*self._middle, -_THICKNESS),
        )
        self._lines = self._server.scene.add_grid(
            "/floor/lines",
            width,
            width,
            plane="xy",
            cell_size=0.5,
            section_size=1.0,
            cell_color=tokens["scene-floor-line"],
            section_color=tokens["scene-floor-line"],
            cell_thickness=0.6,
            section_thickness=1.2,
            shadow_opacity=0.25,
            position=(*self._middle, 0.0),
        )

    def show(self, visible: bool) -> None:
        """Show or hide the floor."""
        for handle in (self._slab, self._lines):
            if handle is not None:
                handle.visible = visible

    def remove(self) -> None:
        """Take the floor out of the scene."""
        for handle in (self._slab, self._lines):
            if handle is not None:
                handle.remove()
        self._slab = self._lines = None


def floor_extent(points: Sequence[Array]) -> tuple[tuple[float, float], float]:
    """Middle (x, y) and half width in metres of a square floor under all points (mm), on half-metre lines."""
    centres = np.array(points)[:, :2] * METRES_PER_MM
    low, high = centres.min(axis=0), centres.max(axis=0)
    middle = np.round(low + high) / 2.0
    reach = float(np.abs(centres - middle).max())
    half_width = float(np.clip(np.ceil(reach * 2.0) / 2.0 + 0.5, _LEAST_HALF_WIDTH, _MOST_HALF_WIDTH))
    return (float(middle[0]), float(middle[1])), half_width
