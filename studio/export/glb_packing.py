"""The binary half of a GLB: arrays one after the other, each described by an accessor and a view."""

import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray

COMPONENTS = {"f4": gltf.FLOAT, "u2": gltf.UNSIGNED_SHORT, "u4": gltf.UNSIGNED_INT}


class Packing:
    """Grows as arrays are added; `content` is the buffer, `accessors` and `views` describe it."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.accessors: list[gltf.Accessor] = []
        self.views: list[gltf.BufferView] = []

    def add(
        self,
        values: NDArray,
        kind: str,
        target: int | None = None,
        storage: str = "f4",
        *,
        bounds: bool = False,
    ) -> int:
        """Append rows (N, C) and return the accessor's index.

        kind : glTF's SCALAR, VEC3, VEC4 or MAT4. storage : "f4", "u2" or "u4". target : what the view feeds. bounds :
        write the smallest and largest value, which glTF asks for of positions and times.
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
