"""The floor: a slab that takes shadows, with half-metre lines, under the cameras' field of view."""

from collections.abc import Sequence

import numpy as np
import trimesh
import viser

from studio.arrays import Array
from studio.runs.colour_tokens import ColourTokens
from studio.scene import METRES_PER_MM

_THICKNESS = 0.02
_LEAST_HALF_WIDTH, _MOST_HALF_WIDTH = 2.0, 8.0


class FloorView:
    """The floor z = 0 under points (3,) mm: the cameras, and where the body begins. scale : of the body beside a
    person, by which lines and least width shrink or grow.
    """

    def __init__(self, server: viser.ViserServer, points: Sequence[Array], scale: float = 1.0) -> None:
        middle, half_width = floor_extent(points, scale)
        width = 2.0 * half_width
        mesh = trimesh.creation.box(extents=(width, width, scale * _THICKNESS))
        self._slab = server.scene.add_mesh_simple(
            "/floor/slab",
            np.asarray(mesh.vertices),
            np.asarray(mesh.faces),
            flat_shading=True,
            cast_shadow=False,
            position=(*middle, -scale * _THICKNESS),
        )
        self._lines = server.scene.add_grid(
            "/floor/lines",
            width,
            width,
            plane="xy",
            cell_size=0.5 * scale,
            section_size=scale,
            cell_thickness=0.6,
            section_thickness=1.2,
            shadow_opacity=0.25,
            position=(*middle, 0.0),
        )

    def show(self, tokens: ColourTokens, visible: bool = True) -> None:
        """Draw the floor in a theme's colours, or hide it."""
        self._slab.visible = self._lines.visible = visible
        self._slab.color = tokens["scene-floor"]
        self._lines.cell_color = self._lines.section_color = tokens["scene-floor-line"]


def floor_extent(points: Sequence[Array], scale: float = 1.0) -> tuple[tuple[float, float], float]:
    """Middle (x, y) and half width in metres of a square floor under all points (mm), on half-metre lines times the
    scale.
    """
    centres = np.array(points)[:, :2] * METRES_PER_MM / scale
    low: Array = centres.min(axis=0)
    high: Array = centres.max(axis=0)
    middle = np.round(low + high) / 2.0
    reach = float(np.abs(centres - middle).max())
    half_width = float(np.clip(np.ceil(reach * 2.0) / 2.0 + 0.5, _LEAST_HALF_WIDTH, _MOST_HALF_WIDTH))
    return (float(scale * middle[0]), float(scale * middle[1])), scale * half_width
