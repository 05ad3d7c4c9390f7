"""The body in the scene: one mesh handle for each drawn limb, moved and never sent again."""

from collections.abc import Callable

import numpy as np
import viser
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.runs.colour_tokens import ColourTokens
from studio.scene.limb_meshes import limb_frames, limb_mesh

Array = NDArray[np.float64]

_CAGE_SECTIONS, _CAGE_SCALE = 10, (1.03, 1.03, 1.0)


class BodyView:
    """A body at one pose.

    name : the handles' path, e.g. "/body". ghost : drawn as a grey cage instead of coloured solid limbs;
    used for the stored answer beside a re-annealed one.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        body: BodyModel,
        tokens: ColourTokens,
        *,
        name: str,
        ghost: bool = False,
    ) -> None:
        self._server = server
        self._body = body
        self._ghost = ghost
        self._sides = [limb.side for limb in body.drawn]
        self.handles = [
            _add_limb(server, f"{name}/{limb.name}", index, body, tokens, ghost)
            for index, limb in enumerate(body.drawn)
        ]

    def show(self, pose: Array | None, opacity: float = 1.0) -> None:
        """Move every limb to a pose (radians, mm) at once; None hides the body."""
        with self._server.atomic():
            if pose is not None:
                wxyz, positions = limb_frames(self._body, pose)
                for handle, turn, place in zip(self.handles, wxyz, positions, strict=True):
                    handle.wxyz = turn
                    handle.position = place
                    handle.opacity = None if opacity >= 1.0 else float(opacity)
            for handle in self.handles:
                handle.visible = pose is not None

    def recolour(self, tokens: ColourTokens) -> None:
        """Take the colours of another theme."""
        for handle, side in zip(self.handles, self._sides, strict=True):
            handle.color = _colour(tokens, side, self._ghost)

    def on_click(self, react: Callable[[str], None]) -> None:
        """Call `react` with the limb's name when a limb is clicked."""
        for handle, limb in zip(self.handles, self._body.drawn, strict=True):
            handle.on_click(lambda _, name=limb.name: react(name))

    def remove(self) -> None:
        """Take the body out of the scene."""
        for handle in self.handles:
            handle.remove()
        self.handles = []


def _colour(tokens: ColourTokens, side: str, ghost: bool) -> tuple[int, int, int]:
    return tokens["ghost"] if ghost else tokens[f"limb-{side}"]


def _add_limb(
    server: viser.ViserServer, name: str, index: int, body: BodyModel, tokens: ColourTokens, ghost: bool
) -> viser.MeshHandle:
    limb = body.drawn[index]
    mesh = limb_mesh(limb, _CAGE_SECTIONS) if ghost else limb_mesh(limb)
    return server.scene.add_mesh_simple(
        name,
        np.asarray(mesh.vertices),
        np.asarray(mesh.faces),
        color=_colour(tokens, limb.side, ghost),
        wireframe=ghost,
        # Beside an answer that hardly differs the cage must lie around it, not in its surface.
        scale=_CAGE_SCALE if ghost else 1.0,
        side="front",
        cast_shadow=not ghost,
        receive_shadow=not ghost,
        visible=False,
    )
