"""Only the beginning of a motion: the same person, the same truth, fewer pictures."""

from pathlib import Path

import numpy as np
import pytest

from studio.body.motion_files.trc import read_trc
from studio.results.drawing_footage.recipes import synthesize
from studio.sessions.session import Session

RECIPE = """
title = "short"
motion = "walk"
frames = 5
[cameras]
rig = "corners"
[picture]
width = 64
height = 48
samples = 1
quality = 0
empty_frames = 2
"""


@pytest.mark.slow
def test_the_beginning_is_that_of_the_whole(tmp_path: Path) -> None:
    recipe = tmp_path / "short.toml"
    recipe.write_text(RECIPE)
    short = Session(synthesize(recipe, tmp_path / "short", frames=3))
    whole = Session(synthesize(recipe, tmp_path / "whole", frames=100))
    assert (short.manifest.frame_count, whole.manifest.frame_count) == (3, 5)
    paths = short.truth_path, whole.truth_path
    assert paths[0] is not None
    assert paths[1] is not None
    first, second = read_trc(paths[0]), read_trc(paths[1])
    np.testing.assert_allclose(first.positions, second.positions[:3])
    body = short.body()
    np.testing.assert_allclose(short.start_pose(body), whole.start_pose(body))  # pyright: ignore
    pictures = [session.footage() for session in (short, whole)]
    camera = pictures[0].cameras[0]
    mine, theirs = (footage.picture(camera, 1).astype(float) for footage in pictures)
    np.testing.assert_array_equal(mine, theirs)
    for footage in pictures:
        footage.close()
