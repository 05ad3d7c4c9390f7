"""A limb of changing length is tracked: drawn as one cone of its true length, which no cone of the body has."""

from pathlib import Path

import cv2
import numpy as np
from filmed_bodies import cameras_around, drawn_mask, write_session
from tracked_runs import finish

from studio.body.dimensions import with_dimensions
from studio.body.forward_kinematics import marker_points
from studio.body.reader import parse_body
from studio.foundations.arrays import Array
from studio.runs.new_run import prepare_run

WORM = """
title = "A worm of two limbs"
parameters = [
    { name = "lean", kind = "angle", limb = "front", lower = -60, upper = 60, max_step = 90 },
    { name = "bend", kind = "angle", limb = "back", lower = -20, upper = 120, max_step = 90 },
]
joints = [
    { name = "front", parent = "world", type = "hinge", sequence = [ { turn = "y", by = "lean" } ] },
    { name = "back", parent = "front", type = "hinge", sequence = [
        { move = "z", by = "front_length" }, { turn = "y", by = "bend" },
    ] },
]
markers = [
    { name = "Waist", joint = "back", at = [0, 0, 0] },
    { name = "Tail", joint = "back", at = [0, 0, 250] },
]
[[limbs]]
name = "front"
joint = "front"
length = "front_length"
radius_start = 20
radius_end = 40
stretch = [0.7, 1.3]
[[limbs]]
name = "back"
joint = "back"
length = 250
radius_start = 40
radius_end = 5
[dimensions]
front_length = { mm = 300 }
"""
LENGTHS = (300.0, 318.0, 336.0, 354.0)
TURNS = ((0.1, 0.5), (0.13, 0.53), (0.16, 0.56), (0.19, 0.59))
CAMERAS = cameras_around(2500.0, 900.0, 700.0, 3)


def test_a_limb_that_grows_is_followed(tmp_path: Path) -> None:
    worm = parse_body(WORM, "worm", "worm.toml")
    stiff = parse_body(WORM.replace("stretch = [0.7, 1.3]", ""), "stiff", "stiff.toml")
    turns = np.array(TURNS)
    session = write_session(tmp_path / "worm", stiff, turns, CAMERAS, masks=True)
    (session.path / "bodies").mkdir()
    (session.path / "bodies" / "worm.toml").write_text(WORM)
    truth: list[Array] = []
    for frame, length in enumerate(LENGTHS):
        drawn = with_dimensions(stiff, {"front_length": length})
        truth.append(marker_points(drawn, turns[frame])[0])
        for camera in CAMERAS:
            for part in ("pictures", "masks"):
                name = str(session.path / part / camera.name / f"{frame:04d}.png")
                cv2.imwrite(name, drawn_mask(drawn, turns[frame], camera))
    start = worm.neutral.copy()
    names = [entry.name for entry in worm.parameters]
    start[[names.index("lean"), names.index("bend")]] = TURNS[0]
    run = prepare_run(
        session, body="worm", start_pose=start, fit_shape=False, knobs={"layers": 6, "particles": 80}
    )
    poses = finish(session, run)
    off = np.linalg.norm(marker_points(worm, poses) - np.array(truth), axis=2)
    assert off.max() < 6.0
    grown = poses[:, names.index("front_stretch")]
    np.testing.assert_allclose(grown, np.array(LENGTHS) - 300.0, atol=6.0)
