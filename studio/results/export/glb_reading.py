"""Reading the nodes and the animation of a GLB, to check what was written."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from studio.foundations.arrays import Array
from studio.foundations.errors import ExportError

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
    tracks: dict[tuple[int, str], tuple[Array, Array]] = {}
    animation = document.animations[0]
    for channel in animation.channels:
        target = channel.target
        assert channel.sampler is not None
        assert target is not None
        assert target.node is not None
        sampler = animation.samplers[channel.sampler]
        times, values = (_values(document, blob, index) for index in (sampler.input, sampler.output))
        tracks[target.node, str(target.path)] = (times[:, 0], values)
    return GlbFile(
        tuple(str(node.name) for node in document.nodes),
        tuple(parents),
        np.array([node.translation or (0.0, 0.0, 0.0) for node in document.nodes]),
        tracks,
    )


def _values(document: gltf.GLTF2, blob: bytes, index: int | None) -> Array:
    assert index is not None
    accessor = document.accessors[index]
    assert accessor.bufferView is not None
    view = document.bufferViews[accessor.bufferView]
    width = WIDTHS[str(accessor.type)]
    start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
    values = np.frombuffer(blob, dtype="<f4", count=accessor.count * width, offset=start)
    return values.reshape(accessor.count, width).astype(np.float64)


COMPONENTS = {"f4": gltf.FLOAT, "u2": gltf.UNSIGNED_SHORT, "u4": gltf.UNSIGNED_INT}


class Packing:
    """Grows as arrays are added; `content` is the buffer, `accessors` and `views` describe it."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.accessors: list[gltf.Accessor] = []
        self.views: list[gltf.BufferView] = []

    def add(
        self,
        values: NDArray[Any],
        kind: str,
        target: int | None = None,
        storage: str = "f4",
        *,
        bounds: bool = False,
    ) -> int:
        """Append rows (N, C) and return the accessor's index.

        kind : glTF's SCALAR, VEC3, VEC4 or MAT4. storage : "f4", "u2" or "u4". target : what the view feeds. bounds :
        write the smallest and largest value, which glTF requires for positions and times.
        """
        stored = np.ascontiguousarray(values, dtype=f"<{storage}")
        self.content.extend(b"\0" * (-len(self.content) % 4))
        view = gltf.BufferView(
            buffer=0, byteOffset=len(self.content), byteLength=stored.nbytes, target=target
        )
        self.content.extend(stored.tobytes())
        self.views.append(view)
        accessor = gltf.Accessor(
            bufferView=len(self.views) - 1,
            byteOffset=0,
            componentType=COMPONENTS[storage],
            count=len(stored),
            type=kind,
        )
        if bounds:
            accessor.min, accessor.max = stored.min(axis=0).tolist(), stored.max(axis=0).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1
