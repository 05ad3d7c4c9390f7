"""The silhouettes of a tracked clip's frames, with what refines poses on them."""

import functools
from collections.abc import Callable, Mapping, Sequence

from cachetools import LRUCache, cached

from studio.body.model import BodyModel
from studio.foundations.arrays import Indices
from studio.foundations.geometry.camera import Camera
from studio.search.trackers.refinement import Distances, RefinementSettings, Refiner

SilhouettesOf = Callable[[int], Mapping[str, Distances]]
"""The silhouettes of a frame by camera."""
RowSeen = Callable[[int], tuple[Refiner, tuple[Distances, ...]]]
"""What refines poses in the cameras that see a row, and the silhouettes in these."""
KEPT_BYTES = 512 * 2**20
"""Of the rows that were seen last: two seconds at 120 Hz of four pictures of 1280 by 720, the longest stretch that is
bridged. With fewer each of the nine margins tried there reads all its frames again."""


def rows_seen(
    body: BodyModel,
    cameras: Sequence[Camera],
    frames: Indices,
    silhouettes_of: SilhouettesOf,
    settings: RefinementSettings,
) -> RowSeen:
    """What is seen in a row of a clip; the last rows are kept. frames : (K,). settings : of the descents."""
    by_name = {camera.name: camera for camera in cameras}

    @functools.cache
    def refiner(names: tuple[str, ...]) -> Refiner:
        return Refiner(body, tuple(by_name[name] for name in names), settings)

    @cached(LRUCache[int, tuple[Refiner, tuple[Distances, ...]]](KEPT_BYTES, _bytes_of))
    def seen(row: int) -> tuple[Refiner, tuple[Distances, ...]]:
        views = silhouettes_of(int(frames[row]))
        return refiner(tuple(views)), tuple(views.values())

    return seen


def _bytes_of(seen: tuple[Refiner, tuple[Distances, ...]]) -> int:
    return sum(view.signed.nbytes + view.border.nbytes + view.outward.nbytes for view in seen[1])
