"""Reading the nodes and the animation of a GLB, to check what was written."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pygltflib as gltf
from scipy.spatial.transform import Rotation, Slerp

from studio.arrays import Array
from studio.errors import ExportError

WIDTHS = {gltf.SCALAR: 1, gltf.VEC3: 3, gltf.VEC4: 4}


@dataclass(frozen=True, slots=True, eq=False)
class GlbFile:
    """names, parents (N nodes; -1 none), translations (N, 3) at rest, and what the first animation moves:
    (node, "rotation" or "translation") → (times (K,), values (K, 3 or 4)).
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    translations: Array
    tracks: dict[tuple[int, str], tuple[Array, Array]]

    def followed(self, times: Array) -> tuple[Array, Array]:
        """World places (F, N, 3) in metres and turns (F, N, 3, 3) of the nodes at times (F,) in seconds."""
        count = len(self.names)
        places = np.zeros((len(times), count, 3))
        turned = np.broadcast_to(np.eye(3), (len(times), count, 3, 3)).copy()
        waiting = [node for node, parent in enumerate(self.parents) if parent < 0]
        while waiting:
            node = waiting.pop()
            move, turn, parent = self._move(node, times), self._turn(node, times), self.parents[node]
            if parent < 0:
                places[:, node], turned[:, node] = move, turn
            else:
                places[:, node] = places[:, parent] + (turned[:, parent] @ move[..., None])[..., 0]
                turned[:, node] = turned[:, parent] @ turn
            waiting += [child for child, above in enumerate(self.parents) if above == node]
        return places, turned

    def _move(self, node: int, times: Array) -> Array:
        if (node, "translation") not in self.tracks:
            return np.broadcast_to(self.translations[node], (len(times), 3))
        keys, values = self.tracks[node, "translation"]
        return np.stack([np.interp(times, keys, values[:, axis]) for axis in range(3)], axis=-1)

    def _turn(self, node: int, times: Array) -> Array:
        if (node, "rotation") not in self.tracks:
            return np.broadcast_to(np.eye(3), (len(times), 3, 3))
        keys, values = self.tracks[node, "rotation"]
        turns = Rotation.from_quat(values)
        if len(keys) == 1:
            return np.broadcast_to(turns.as_matrix(), (len(times), 3, 3))
        return Slerp(keys, turns)(np.clip(times, keys[0], keys[-1])).as_matrix()


def read_glb(path: Path) -> GlbFile:
    """The nodes and the first animation. Raises ExportError for a file without one."""
    document = gltf.GLTF2().load_binary(str(path))
    blob = document.binary_blob() if document is not None else None
    if document is None or blob is None or not document.animations:
        raise ExportError(f"'{path.name}' holds no animation.", "Export it again.")
    parents = [-1] * len(document.nodes)
    for index, node in enumerate(document.nodes):
        for child in node.children or ():
            parents[child] = index
    tracks = {}
    animation = document.animations[0]
    for channel in animation.channels:
        sampler = animation.samplers[channel.sampler]  # pyright: ignore[reportArgumentType, reportCallIssue]
        times, values = (_values(document, blob, index) for index in (sampler.input, sampler.output))
        tracks[channel.target.node, channel.target.path] = (times[:, 0], values)  # pyright: ignore[reportOptionalMemberAccess]
    return GlbFile(
        tuple(str(node.name) for node in document.nodes),
        tuple(parents),
        np.array([node.translation or (0.0, 0.0, 0.0) for node in document.nodes]),
        tracks,  # pyright: ignore[reportArgumentType]
    )


def _values(document: gltf.GLTF2, blob: bytes, index: int | None) -> Array:
    """An accessor's rows of 32-bit floats."""
    accessor = document.accessors[index]  # pyright: ignore[reportArgumentType, reportCallIssue]
    view = document.bufferViews[accessor.bufferView]  # pyright: ignore[reportArgumentType, reportCallIssue]
    width = WIDTHS[accessor.type]  # pyright: ignore[reportArgumentType]
    start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
    values = np.frombuffer(blob, dtype="<f4", count=accessor.count * width, offset=start)
    return values.reshape(accessor.count, width).astype(np.float64)
