"""Rows of a clip are read once as long as there is room for them."""

import numpy as np
import pytest
from drawn_people import ring_of_cameras

from studio.body.catalogue import load_body
from studio.evidence.distance_maps import SilhouetteDistances, distances_of
from studio.search.trackers import clip_silhouettes
from studio.search.trackers.clip_silhouettes import rows_seen
from studio.search.trackers.refinement import RefinementSettings

ROWS = 248
"""Two seconds at 120 Hz, with the margins on both sides."""


@pytest.mark.parametrize(("rows_kept", "reads"), [(None, ROWS), (ROWS // 2, 2 * ROWS)])
def test_the_longest_stretch_is_read_once_unless_it_is_larger_than_what_is_kept(
    monkeypatch: pytest.MonkeyPatch, rows_kept: int | None, reads: int
) -> None:
    cameras, body = ring_of_cameras(2, 48, 36), load_body("human31")
    mask = np.zeros((36, 48), np.uint8)
    mask[8:30, 10:20] = 255
    views = {camera.name: distances_of(mask) for camera in cameras}
    if rows_kept is not None:
        size = sum(view.signed.nbytes + view.border.nbytes + view.outward.nbytes for view in views.values())
        monkeypatch.setattr(clip_silhouettes, "KEPT_BYTES", rows_kept * size)
    read: list[int] = []

    def silhouettes_of(frame: int) -> dict[str, SilhouetteDistances]:
        read.append(frame)
        return views

    frames = np.arange(500, 500 + ROWS)
    seen = rows_seen(body, cameras, frames, silhouettes_of, RefinementSettings())
    for row in [*range(ROWS), *range(ROWS)]:
        refiner, silhouettes = seen(row)
        assert silhouettes == tuple(views.values())
        assert refiner.cameras == cameras
    assert len(read) == reads
