"""The silhouettes of a tracked clip's frames, with what refines poses on them."""

import functools
from collections.abc import Callable, Mapping, Sequence

from studio.body.model import BodyModel
from studio.foundations.arrays import Indices
from studio.foundations.geometry.camera import Camera
from studio.search.trackers.refinement import Distances, RefinementSettings, Refiner

SilhouettesOf = Callable[[int], Mapping[str, Distances]]
"""The silhouettes of a frame by camera."""
RowSeen = Callable[[int], tuple[Refiner, tuple[Distances, ...]]]
"""What refines poses in the cameras that see a row, and the silhouettes in these."""
KEPT_SILHOUETTES = 256
"""Rows that are kept: two seconds at 120 Hz, the longest stretch that is bridged, with what lies around it. With fewer
each of the nine margins tried there reads all its frames again."""


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

    @functools.lru_cache(KEPT_SILHOUETTES)
    def seen(row: int) -> tuple[Refiner, tuple[Distances, ...]]:
        views = silhouettes_of(int(frames[row]))
        return refiner(tuple(views)), tuple(views.values())

    return seen
