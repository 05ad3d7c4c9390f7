"""The visual hull as voxels and the coloured blobs as ellipsoids (Caillette, Galata & Howard 2007, Figs. 3 to 6).

Voxels are instances of one box, in their own sizes and mean colours. Blobs are instances of one ball, drawn out to
`BLOB_REACH` standard deviations: a solid cylinder's reaches its surface at two. The blobs fitted to the frame's voxels
are solid and wear the colours that were learnt, those of the shown pose are cages in the colours of
their limbs' sides.
"""

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studio.app.scene import METRES_PER_MM
from studio.app.scene.frame_volume import FrameVolume
from studio.body.model import BodyModel
from studio.evidence.volume.blob_model import BlobMixture, BlobModel
from studio.evidence.volume.hull import Hull
from studio.foundations.arrays import Array, Bytes
from studio.runs.drawing.colour_tokens import ColourTokens

BLOB_REACH = 2.0
SOLID = 0.75
"""Opacity of fitted blobs: those of the pose lie within them."""
BALL_FINENESS, CAGE_FINENESS = 2, 1
SMOOTH, FLAT, CAGE = "smooth", "flat", "cage"
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class VolumeView:
    """Hull and blobs of one moment; unchanged parts are not sent again."""

    def __init__(self, server: viser.ViserServer, body: BodyModel) -> None:
        self._server, self._body = server, body
        self.voxels = _Instances(server, "/hull", trimesh.creation.box((1.0, 1.0, 1.0)), look=FLAT)
        self.fitted = _Instances(
            server, "/blobs/fitted", trimesh.creation.icosphere(subdivisions=BALL_FINENESS)
        )
        self.own = _Instances(
            server, "/blobs/own", trimesh.creation.icosphere(subdivisions=CAGE_FINENESS), look=CAGE
        )
        self._drawn: dict[str, tuple[object, ...]] = {}

    def show(
        self, volume: FrameVolume | None, pose: Array | None, tokens: ColourTokens, *, hull: bool, blobs: bool
    ) -> None:
        """Draw a volume. pose : (D,) whose blobs are drawn. hull, blobs : whether each is shown."""
        voxels = volume.hull if volume is not None and hull else None
        model = volume.model if volume is not None and blobs else None
        fitted = volume.fitted if volume is not None and blobs else None
        if self._is_new("voxels", voxels):
            self.voxels.draw(*(NOTHING if voxels is None else voxel_instances(voxels)))
        if self._is_new("fitted", fitted, tokens.name):
            self.fitted.draw(*(NOTHING if fitted is None else blob_instances(fitted, tokens["ghost"])))
        if self._is_new("own", model, None if model is None or pose is None else pose.tobytes(), tokens.name):
            self.own.draw(*(NOTHING if model is None or pose is None else self._own(model, pose, tokens)))

    def _own(self, model: BlobModel, pose: Array, tokens: ColourTokens) -> tuple[Array, Array, Array, Bytes]:
        mixture = model.mixture(self._body, pose[None]).at(0)
        positions, turns, scales, _ = blob_instances(mixture, tokens["ghost"])
        sides = [tokens[f"limb-{self._body.drawn[int(limb)].side}"] for limb in model.limb]
        return positions, turns, scales, np.array(sides, dtype=np.uint8)

    def _is_new(self, part: str, *look: object) -> bool:
        before = self._drawn.get(part, (None,))
        same = len(before) == len(look) and all(
            one is other or (isinstance(one, (str, bytes)) and one == other)
            for one, other in zip(before, look, strict=True)
        )
        self._drawn[part] = look
        return not same


def voxel_instances(hull: Hull) -> tuple[Array, Array, Array, Bytes]:
    """Positions (K, 3) and edges (K, 3) in metres, turns (K, 4) wxyz, colours (K, 3) red green blue."""
    edges = np.repeat(hull.edges[:, None] * METRES_PER_MM, 3, axis=1)
    return (
        hull.centres * METRES_PER_MM,
        np.tile(UPRIGHT, (len(edges), 1)),
        edges,
        _rgb(hull.colours, (128,) * 3),
    )


def blob_instances(mixture: BlobMixture, unknown: tuple[int, int, int]) -> tuple[Array, Array, Array, Bytes]:
    """Positions (B, 3) and half axes (B, 3) in metres, turns (B, 4) wxyz, colours (B, 3) of a mixture of one pose.

    unknown : the colour of blobs that have learnt none.
    """
    variances, axes = np.linalg.eigh(mixture.covariances)
    # Eigenvectors come with any handedness; a turn has one.
    axes[..., 0] *= np.sign(np.linalg.det(axes))[:, None]
    turns = Rotation.from_matrix(axes).as_quat(scalar_first=True)
    reach = BLOB_REACH * np.sqrt(np.maximum(variances, 0.0)) * METRES_PER_MM
    return mixture.means * METRES_PER_MM, turns, reach, _rgb(mixture.colours, unknown)


def as_light(colours: Bytes) -> Bytes:
    """Bytes of a screen's colours as bytes of linear light (IEC 61966-2-1): viser's viewer takes those of instances for
    light and shows dark cloth pale otherwise. Those of other meshes it converts itself.
    """
    share = colours / 255.0
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.round(255.0 * light).astype(np.uint8)


def _rgb(levels: NDArray[np.floating], unknown: tuple[int, ...]) -> Bytes:
    """Blue, green, red levels as bytes red, green, blue; rows with NaN take the other colour."""
    known = np.isfinite(levels).all(axis=1, keepdims=True)
    colours = np.where(known, levels[:, ::-1], np.array(unknown, dtype=np.float64))
    return np.clip(np.round(colours), 0, 255).astype(np.uint8)


NOTHING = (np.zeros((0, 3)), np.zeros((0, 4)), np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint8))


class _Instances:
    """Many of one mesh. A set of another size is a new handle, so that places and colours always match."""

    def __init__(
        self, server: viser.ViserServer, name: str, mesh: trimesh.Trimesh, *, look: str = SMOOTH
    ) -> None:
        self._server, self._name, self._mesh, self._look = server, name, mesh, look
        self.handle: viser.BatchedMeshHandle | None = None

    def draw(self, positions: Array, turns: Array, scales: Array, colours: Bytes) -> None:
        """Show so many; none takes the handle away."""
        handle = self.handle
        if handle is not None and len(handle.batched_positions) == len(positions):
            handle.batched_positions = positions.astype(np.float32)
            handle.batched_wxyzs = turns.astype(np.float32)
            handle.batched_scales = scales.astype(np.float32)
            handle.batched_colors = as_light(colours)
            return
        if handle is not None:
            handle.remove()
            self.handle = None
        if len(positions):
            self.handle = self._add_boxes(positions, turns, scales, colours)

    def _add_boxes(
        self, positions: Array, turns: Array, scales: Array, colours: Bytes
    ) -> viser.BatchedMeshHandle:
        return self._server.scene.add_batched_meshes_simple(
            self._name,
            np.asarray(self._mesh.vertices, dtype=np.float32),
            np.asarray(self._mesh.faces, dtype=np.uint32),
            batched_wxyzs=turns.astype(np.float32),
            batched_positions=positions.astype(np.float32),
            batched_scales=scales.astype(np.float32),
            batched_colors=as_light(colours),
            lod="off",
            wireframe=self._look == CAGE,
            opacity=SOLID if self._look == SMOOTH else None,
            flat_shading=self._look == FLAT,
            cast_shadow=False,
            receive_shadow=False,
        )
