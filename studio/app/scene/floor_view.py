"""The floor, with half-metre lines, under the cameras' field of view, and the light above it."""

from collections.abc import Sequence

import numpy as np
import viser

from studio.app.scene import METRES_PER_MM
from studio.foundations.arrays import Array
from studio.runs.drawing.colour_tokens import ColourTokens

_SHADOW, _SKY = 0.5, 1.5
"""How dark a shadow is, and how bright a sky that stands for lamps and their reflections."""
_LEAST_HALF_WIDTH, _MOST_HALF_WIDTH = 2.0, 8.0


class FloorView:
    """The floor z = 0 under points (3,) mm: the cameras, and where the body begins. scale : of the body beside a
    person, by which lines and least width shrink or grow.
    """

    def __init__(self, server: viser.ViserServer, points: Sequence[Array], scale: float = 1.0) -> None:
        middle, half_width = floor_extent(points, scale)
        width = 2.0 * half_width
        self.plane = server.scene.add_grid(
            "/floor/plane",
            width,
            width,
            plane="xy",
            cell_size=0.5 * scale,
            section_size=scale,
            cell_thickness=0.6,
            section_thickness=1.2,
            plane_opacity=1.0,
            position=(*middle, 0.0),
        )
        self.sky = server.scene.add_light_hemisphere("/floor/sky", intensity=_SKY)
        self._drawn: tuple[object, ...] = ()

    def show(self, tokens: ColourTokens, visible: bool = True, shadows: bool = True) -> None:
        """Draw the floor in a theme's colours, or hide it. shadows : else the sky lights all sides alike."""
        wanted = (tokens.name, visible, shadows)
        if wanted == self._drawn:
            return
        self._drawn = wanted
        self.plane.visible, self.sky.visible = visible, not shadows
        self.plane.plane_color = tokens["scene-floor"]
        self.plane.cell_color = self.plane.section_color = tokens["scene-floor-line"]
        self.plane.shadow_opacity = _SHADOW if shadows else 0.0


def light(server: viser.ViserServer, shadows: bool) -> None:
    """Lamps that cast shadows in surroundings that reflect, as viser has them at first, or lamps alone."""
    server.scene.configure_default_lights(cast_shadow=shadows)
    server.scene.configure_environment_map("city" if shadows else None)


def floor_extent(points: Sequence[Array], scale: float = 1.0) -> tuple[tuple[float, float], float]:
    """Middle (x, y) and half width (m) of a square floor under all points (mm), on half-metre lines times the scale."""
    centres = np.array(points)[:, :2] * METRES_PER_MM / scale
    low: Array = centres.min(axis=0)
    high: Array = centres.max(axis=0)
    middle = np.round(low + high) / 2.0
    reach = float(np.abs(centres - middle).max())
    half_width = float(np.clip(np.ceil(reach * 2.0) / 2.0 + 0.5, _LEAST_HALF_WIDTH, _MOST_HALF_WIDTH))
    return (float(scale * middle[0]), float(scale * middle[1])), scale * half_width
