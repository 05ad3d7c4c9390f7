"""The body in the scene: a mesh for each drawn limb, made once in the limb's frame; a pose only moves it."""

from collections.abc import Callable

import numpy as np
import trimesh
import viser
from scipy.spatial.transform import Rotation

from studio.app.scene import METRES_PER_MM
from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel, Limb
from studio.foundations.arrays import Array
from studio.results.evaluation.errors import limb_of_drawn
from studio.runs.drawing.colour_tokens import ColourTokens

SECTIONS = 28
_DIMMED = 0.3
_CAGE_SECTIONS, _CAGE_SCALE = 10, (1.03, 1.03, 1.0)


class BodyView:
    """A body at one pose. name : the nodes' path. ghost : a cage, for what stands beside the answer, in the
    colour of the token `colour`. clicked : called with the name of a limb as errors are counted by and where it was
    clicked, shares of the view, in a thread of viser's.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        body: BodyModel,
        *,
        name: str,
        ghost: bool = False,
        clicked: Callable[[str, tuple[float, float]], None] | None = None,
    ) -> None:
        self._body, self._ghost, self.colour = body, ghost, "ghost"
        self._shown: tuple[object, ...] = ()
        self.limb_of = limb_of_drawn(body)
        meshes = [limb_mesh(limb, _CAGE_SECTIONS if ghost else SECTIONS) for limb in body.drawn]
        self.handles = [
            server.scene.add_mesh_simple(
                f"{name}/{limb.name}",
                np.asarray(mesh.vertices),
                np.asarray(mesh.faces),
                wireframe=ghost,
                # Beside an answer that hardly differs the cage must lie around it, not in its surface.
                scale=_CAGE_SCALE if ghost else 1.0,
                side="front",
                cast_shadow=not ghost,
                receive_shadow=not ghost,
                visible=False,
            )
            for limb, mesh in zip(body.drawn, meshes, strict=True)
        ]
        if clicked is not None:
            for limb, handle in zip(body.drawn, self.handles, strict=True):
                handle.on_click(lambda event, name=self.limb_of[limb.name]: clicked(name, event.screen_pos))

    def show(
        self, pose: Array | None, tokens: ColourTokens, opacity: float = 1.0, chosen: str | None = None
    ) -> None:
        """Move every limb to a pose (radians, mm); None hides the body. chosen : the only limb that is not dimmed."""
        shown = (pose if pose is None else pose.tobytes(), tokens.name, opacity, chosen, self.colour)
        if shown == self._shown:
            return
        self._shown = shown
        if pose is not None:
            limbs = tuple(self.limb_of.values())
            wxyz, positions = limb_frames(self._body, pose)
            for handle, limb, turn, place in zip(self.handles, limbs, wxyz, positions, strict=True):
                dimmed = opacity * (_DIMMED if chosen in limbs and limb != chosen else 1.0)
                handle.wxyz, handle.position = turn, place
                handle.opacity = None if dimmed >= 1.0 else float(dimmed)
        for handle, limb in zip(self.handles, self._body.drawn, strict=True):
            handle.color = tokens[self.colour if self._ghost else f"limb-{limb.side}"]
            handle.visible = pose is not None


def limb_frames(body: BodyModel, pose: Array) -> tuple[Array, Array]:
    """The drawn limbs' frames at a pose: wxyz quaternions (L, 4) and positions (L, 3) in metres."""
    frames = joint_frames(body, np.asarray(pose, dtype=np.float64)[None])[0]
    chosen = frames[[limb.joint for limb in body.drawn]]
    wxyz = Rotation.from_matrix(chosen[:, :, :3]).as_quat(scalar_first=True)
    return wxyz, chosen[:, :, 3] * METRES_PER_MM


def limb_mesh(limb: Limb, sections: int = SECTIONS) -> trimesh.Trimesh:
    """A truncated cone with an elliptical cross-section along z in its joint's frame, metres: a side and two flat caps
    with crisp rims, normals outwards.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, sections, endpoint=False)
    circle = np.stack([limb.scale_x * np.cos(turn), limb.scale_y * np.sin(turn)], axis=-1)
    start = np.column_stack([limb.radius_start * circle, np.zeros(sections)])
    end = np.column_stack([limb.radius_end * circle, np.full(sections, limb.length)])
    ring = np.arange(sections)
    after = np.roll(ring, -1)
    lower = np.column_stack([ring, after, after + sections])
    upper = np.column_stack([ring, after + sections, ring + sections])
    parts = [
        trimesh.Trimesh(np.concatenate([start, end]), np.concatenate([lower, upper]), process=False),
        _cap(start, np.array([0.0, 0.0, 0.0]), facing_up=False),
        _cap(end, np.array([0.0, 0.0, limb.length]), facing_up=True),
    ]
    mesh: trimesh.Trimesh = trimesh.util.concatenate(parts)  # pyright: ignore[reportAssignmentType]
    if limb.length < 0.0:
        mesh.invert()
    mesh.apply_scale(METRES_PER_MM)
    return mesh


def _cap(rim: Array, centre: Array, facing_up: bool) -> trimesh.Trimesh:
    ring = np.arange(len(rim))
    after = np.roll(ring, -1)
    hub = np.full(len(rim), len(rim))
    faces = np.column_stack([hub, ring, after] if facing_up else [hub, after, ring])
    return trimesh.Trimesh(np.concatenate([rim, centre[None]]), faces, process=False)
