"""Sizes and poses of a tree from landmarks in several views, beside dense least squares and numeric slopes."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from filmed_bodies import cameras_around

from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions
from studio.body.film_fit import (
    FilmedTree,
    FrameClicks,
    _Problem,
    _spread,
    _turned,
    first_poses,
    fit_film,
    fit_poses,
    landmark_names,
)
from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.body.reader import parse_body
from studio.foundations.errors import BodyError
from studio.foundations.geometry.projection import project

CRAB = """
title = "A crab"
parameters = [
    { name = "x", kind = "length", limb = "root", max_step = 1 },
    { name = "y", kind = "length", limb = "root", max_step = 1 },
    { name = "z", kind = "length", limb = "root", max_step = 1 },
    { name = "heading", kind = "angle", limb = "root", max_step = 1 },
    { name = "pitch", kind = "angle", limb = "root", max_step = 1 },
    { name = "roll", kind = "angle", limb = "root", max_step = 1 },
    { name = "left_swing", kind = "angle", limb = "left", max_step = 1, lower = -60, upper = 80, neutral = 20 },
    { name = "left_bend", kind = "angle", limb = "left", max_step = 1, lower = -60, upper = 80, neutral = 10 },
    { name = "left_twist", kind = "angle", limb = "left", max_step = 1, lower = -60, upper = 60 },
    { name = "right_swing", kind = "angle", limb = "right", max_step = 1, lower = -80, upper = 60, neutral = -20 },
    { name = "right_bend", kind = "angle", limb = "right", max_step = 1, lower = -80, upper = 60, neutral = -10 },
]
joints = [
    { name = "stand", parent = "world", type = "fixed" },
    { name = "shell", parent = "stand", type = "free", sequence = [
        { move = "x", by = "x" }, { move = "y", by = "y" }, { move = "z", by = "z" },
        { turn = "z", by = "heading" }, { turn = "y", by = "pitch" }, { turn = "x", by = "roll" },
    ] },
    { name = "left_arm", parent = "shell", type = "hinge", sequence = [
        { move = "y", by = "left_out" }, { turn = "z", by = "left_swing" },
    ] },
    { name = "left_claw", parent = "left_arm", type = "two-axis", sequence = [
        { move = "x", by = "left_length" }, { turn = "y", by = "left_bend" }, { turn = "x", by = "left_twist" },
    ] },
    { name = "right_arm", parent = "shell", type = "hinge", sequence = [
        { move = "y", by = "-right_out" }, { turn = "z", by = "right_swing" },
    ] },
    { name = "right_claw", parent = "right_arm", type = "hinge", sequence = [
        { move = "x", by = "right_length" }, { turn = "y", by = "right_bend" },
    ] },
]
limbs = [
    { name = "shell", joint = "shell", length = "height", radius_start = "girth", radius_end = 9 },
    { name = "left claw", joint = "left_claw", length = "-claw", radius_start = 4, radius_end = 4 },
    { name = "right claw", joint = "right_claw", length = "-claw", radius_start = 4, radius_end = 4 },
]
markers = [{ name = "Eye", joint = "shell", at = [30, "none", "height"] }]
[dimensions]
left_out = { mm = 60 }
right_out = { mm = 50 }
left_length = { mm = 80 }
right_length = { mm = 80 }
height = { mm = 40 }
claw = { mm = 35 }
girth = { mm = 20 }
none = { mm = 0 }
"""
BODY = parse_body(CRAB, "crab", "crab.toml")
NAMES = (
    "Eye",
    "shell",
    "left_arm",
    "right_arm",
    "left_claw",
    "right_claw",
    "left claw tip",
    "right claw tip",
)
GROUPS = (("left_out", "right_out"), ("left_length", "right_length"), ("height",), ("claw",))
FACTORS = np.array([1.2, 0.85, 1.1, 0.9])
CAMERAS = cameras_around(900.0, 300.0, 700.0, 3)
TREE = FilmedTree(BODY, NAMES)


def poses_of(count: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    poses = BODY.neutral + np.where(BODY.angles, 0.3, 20.0) * rng.uniform(-1.0, 1.0, (count, 11))
    poses[:, 8] = 0.0
    return poses


def clicked(
    body: BodyModel, poses: np.ndarray, names: Sequence[str] = NAMES, missing: float = 0.0
) -> list[FrameClicks]:
    """Exact clicks; a share of the landmarks is clicked in two views alone."""
    rng = np.random.default_rng(5)
    frames = []
    for points in marker_points(FilmedTree(body, names).body, poses):
        pixels = np.array([project(camera, points)[0] for camera in CAMERAS])
        kept = np.ones(pixels.shape[:2], dtype=bool)
        kept[0] = rng.random(len(names)) >= missing
        camera, landmark = np.nonzero(kept)
        frames.append(FrameClicks(camera, landmark, pixels[camera, landmark], points))
    return frames


def sized(factors: np.ndarray = FACTORS) -> BodyModel:
    """The crab with other sizes, left and right alike."""
    means = {
        "left_out": 55.0,
        "right_out": 55.0,
        "left_length": 80.0,
        "right_length": 80.0,
        "height": 40.0,
        "claw": 35.0,
    }
    by_group = {name: factor for group, factor in zip(GROUPS, factors, strict=True) for name in group}
    return with_dimensions(BODY, {name: by_group[name] * mean for name, mean in means.items()})


def test_markers_joints_and_tips_are_landmarks() -> None:
    assert landmark_names(BODY) == (
        "Eye",
        "stand",
        "shell",
        "left_arm",
        "left_claw",
        "right_arm",
        "right_claw",
        "shell tip",
        *NAMES[6:],
    )
    points = dict(zip(NAMES, marker_points(TREE.body, BODY.neutral)[0], strict=True))
    assert points["Eye"].tolist() == [30.0, 0.0, 40.0]
    assert points["left_arm"].tolist() == [0.0, 60.0, 0.0]
    np.testing.assert_allclose(np.linalg.norm(points["left claw tip"] - points["left_claw"]), 35.0)
    with pytest.raises(BodyError, match="no landmark 'Tail'") as refused:
        FilmedTree(BODY, ["Eye", "Tail"])
    assert "left claw tip" in refused.value.hint


def test_a_tree_knows_which_sizes_and_parameters_its_landmarks_show() -> None:
    assert TREE.groups == GROUPS
    assert FilmedTree(BODY, NAMES, symmetric=False).groups == tuple(
        (name,) for group in GROUPS for name in group
    )
    assert TREE.lengths == dict(BODY.dimensions)
    assert TREE.free.tolist() == list(range(11))
    assert TREE.rooted.tolist() == [True] * 6 + [False] * 5
    few = FilmedTree(BODY, ("Eye", "left_claw"))
    assert few.groups == (("left_out",), ("left_length",), ("height",))
    assert few.free.tolist() == [0, 1, 2, 3, 4, 5, 6]
    fixed = load_body("planar_arm4")
    assert not FilmedTree(fixed, landmark_names(fixed)[-2:]).rooted.any()
    pairs, lengths = TREE.rigid_pairs
    named = {(NAMES[one], NAMES[two]): length for (one, two), length in zip(pairs, lengths, strict=True)}
    assert named == {
        ("Eye", "shell"): pytest.approx(50.0),
        ("Eye", "left_arm"): pytest.approx(math.hypot(50.0, 60.0)),
        ("Eye", "right_arm"): pytest.approx(math.hypot(50.0, 50.0)),
        ("shell", "left_arm"): pytest.approx(60.0),
        ("shell", "right_arm"): pytest.approx(50.0),
        ("left_arm", "right_arm"): pytest.approx(110.0),
        ("left_arm", "left_claw"): pytest.approx(80.0),
        ("right_arm", "right_claw"): pytest.approx(80.0),
        ("left_claw", "left claw tip"): pytest.approx(35.0),
        ("right_claw", "right claw tip"): pytest.approx(35.0),
    }


def test_the_scale_is_that_of_most_distances_or_of_the_spread() -> None:
    points = 1.7 * marker_points(TREE.body, poses_of(3))
    points[0, 2] = np.nan
    points[1, 0] *= 3.0
    frames = [FrameClicks(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)), one) for one in points]
    assert TREE.scale(frames) == pytest.approx(1.7)
    ends = FilmedTree(BODY, ("left_claw", "right_claw"))
    assert not len(ends.rigid_pairs[0])
    rest = marker_points(ends.body, BODY.neutral)[0]
    seen = [FrameClicks(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)), 0.6 * rest), frames[0]]
    seen[1] = FrameClicks(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)), np.full((2, 3), np.nan))
    assert ends.scale(seen) == pytest.approx(0.6)
    with pytest.raises(BodyError, match="say nothing of the body's size"):
        ends.scale(seen[1:])


def test_a_pair_gets_the_mean_size_times_its_factor() -> None:
    body = TREE.sized(2.0, TREE.factors_by_name(FACTORS))
    wanted = {name: 2.0 * value for name, value in sized().dimensions.items()}
    assert dict(body.dimensions) == pytest.approx({**wanted, "girth": 40.0, "none": 0.0})


@pytest.mark.parametrize("scale", [1.0, 1.6])
def test_exact_clicks_give_the_sizes_and_the_poses(scale: float) -> None:
    truth = TREE.sized(scale, TREE.factors_by_name(FACTORS))
    poses = poses_of(5)
    fit = fit_film(TREE, CAMERAS, clicked(truth, poses, missing=0.3))
    wanted = scale * FACTORS * [55.0, 80.0, 40.0, 35.0]
    np.testing.assert_allclose(fit.values, wanted, rtol=3e-3)
    assert [fit.body.dimensions[name] for name in ("left_out", "right_out")] == [
        pytest.approx(fit.values[0])
    ] * 2
    found = marker_points(fit.body, fit.poses)
    np.testing.assert_allclose(found, marker_points(FilmedTree(truth, NAMES).body, poses), atol=1.0)
    assert max(np.abs(one).max() for one in fit.off) < 0.7
    assert fit.noise < 0.3
    assert (fit.decided > 0.97).all()
    assert fit.turns.all()


def problem(
    frames: list[FrameClicks], *, held: bool = False, is_sized: bool = True, sigma: float = 2.0
) -> _Problem:
    return _Problem(TREE, CAMERAS, frames, 1.3, held=held, sigma=sigma, sized=is_sized)


def test_residuals_are_clicks_and_weak_pulls() -> None:
    """In pixels over their deviation; sizes to their share by 0.3, angles below the root to rest by a radian."""
    poses = poses_of(2)
    frames = clicked(sized(), poses, missing=0.3)
    sought = problem(frames)
    factors = np.array([1.1, 0.9, 1.05, 0.8])
    others = poses + 0.05
    body = TREE.sized(1.3, TREE.factors_by_name(factors))
    wanted = []
    for clicks, points in zip(frames, marker_points(body, others), strict=True):
        for camera, landmark, pixel in zip(clicks.camera, clicks.landmark, clicks.pixels, strict=True):
            wanted.append((project(CAMERAS[camera], points[landmark][None])[0][0] - pixel) / 2.0)
    pulls = (others - BODY.neutral) * (np.arange(11) >= 6)
    wanted = np.concatenate([np.ravel(wanted), (factors - 1.0) / 0.3, pulls.ravel()])
    np.testing.assert_allclose(sought.residuals(sought.whole(factors, others)), wanted, atol=1e-9)
    costs = [np.sqrt((one**2).mean()) for one in sought.off(factors, others)]
    np.testing.assert_allclose(sought.costs(factors, others), costs)
    again = sought.parted(sought.whole(factors, others))
    np.testing.assert_allclose(again[0], factors)
    np.testing.assert_allclose(again[1], others)


@pytest.mark.parametrize(
    ("held", "is_sized", "unknowns"), [(False, True, 4 + 33), (True, True, 4 + 6 + 15), (False, False, 33)]
)
def test_slopes_are_those_of_the_residuals(held: bool, is_sized: bool, unknowns: int) -> None:
    poses = poses_of(3)
    if held:
        poses[:, :6] = poses[0, :6]
    sought = problem(clicked(sized(), poses, missing=0.3), held=held, is_sized=is_sized)
    factors = np.array([1.1, 0.9, 1.05, 0.8]) if is_sized else np.ones(0)
    x = sought.whole(factors, poses + 0.05)
    assert len(x) == sought.unknowns == unknowns
    steps = 1e-5 * np.eye(len(x))
    numeric = np.array([(sought.residuals(x + step) - sought.residuals(x - step)) / 2e-5 for step in steps]).T
    np.testing.assert_allclose(sought.slopes(x).toarray(), numeric, atol=1e-4 * np.abs(numeric).max())
    extent = np.ptp(marker_points(sought.base, BODY.neutral)[0], axis=0)
    np.testing.assert_allclose(sought.unit, np.where(BODY.angles, 1.0, 0.25 * np.linalg.norm(extent)))
    np.testing.assert_allclose(sought.lower[6:8], np.radians([-90.0, -90.0]))
    np.testing.assert_allclose(sought.upper[6:8], np.radians([110.0, 110.0]))


def test_what_was_told_follows_from_the_dense_normal_equations() -> None:
    poses = poses_of(7)
    sought = problem(clicked(TREE.sized(1.3, {}), poses, missing=0.3), sigma=1.5)
    rng = np.random.default_rng(2)
    for clicks in sought.frames:
        clicks.pixels[:] += 2.0 * rng.standard_normal(clicks.pixels.shape)
    factors = np.ones(4)
    fit = sought.fit(factors, poses)
    slopes = sought.slopes(sought.whole(factors, poses)).toarray()
    spread = np.diag(np.linalg.inv(slopes.T @ slopes + 1e-9 * np.eye(slopes.shape[1])))
    off = np.concatenate([one.ravel() for one in fit.off])
    noise = np.sqrt((off**2).sum() / (len(off) - sought.unknowns))
    assert fit.noise == pytest.approx(noise)
    np.testing.assert_allclose(fit.decided, 1.0 - spread[:4] / 0.09, rtol=1e-6)
    np.testing.assert_allclose(fit.values, 1.3 * np.array([55.0, 80.0, 40.0, 35.0]))
    np.testing.assert_allclose(fit.deviations, fit.values * noise / 1.5 * np.sqrt(spread[:4]), rtol=1e-6)
    angles = np.median([spread[columns] for columns in sought.columns[::2]], axis=0)
    assert fit.turns.tolist() == (angles < 0.2).tolist()
    assert fit.scale == 1.3


def test_poses_near_points_in_space_are_taken_whichever_way_they_face() -> None:
    poses = poses_of(3)
    poses[:, 3] = [0.2, 2.9, -1.7]
    body = TREE.sized(1.0, {})
    frames = clicked(body, poses)
    frames[1].points[3] = np.nan
    found = first_poses(TREE, body, frames)
    for pose, clicks in zip(found, frames, strict=True):
        seen = np.isfinite(clicks.points).all(axis=1)
        assert np.linalg.norm(marker_points(body, pose)[0][seen] - clicks.points[seen], axis=1).max() < 3.0


def test_eight_headings_are_tried_within_limits() -> None:
    pose = poses_of(1)[0]
    for turn in range(8):
        wanted = pose + turn * math.pi / 4.0 * (np.arange(11) == 3)
        np.testing.assert_allclose(_turned(TREE, BODY, pose, turn), wanted)


@pytest.mark.parametrize(("beyond", "found"), [(20.0, 100.0), (45.0, 110.0)])
def test_an_angle_may_lie_thirty_degrees_beyond_its_guessed_limits(beyond: float, found: float) -> None:
    poses = poses_of(2)
    poses[:, 6] = np.radians(80.0 + beyond)
    sought = problem(clicked(TREE.sized(1.3, {}), poses), is_sized=False)
    sought.base = TREE.sized(1.3, {})
    begin = np.clip(poses, BODY.lower, BODY.upper)
    fitted = sought.solved(np.ones(0), begin)[1]
    np.testing.assert_allclose(np.degrees(fitted[:, 6]), found, atol=1.5)


def test_a_frame_begins_at_the_last_ones_pose_as_well() -> None:
    """From points that leave the arms open, which keep near their rest; the root is that of the points."""
    poses = np.repeat(poses_of(1, seed=4), 2, axis=0)
    body = TREE.sized(1.0, {})
    frames = clicked(body, poses)
    for clicks in frames:
        clicks.points[4:] = np.nan
    found = first_poses(TREE, body, frames)
    np.testing.assert_allclose(found[:, :6], poses[:, :6], atol=0.05)
    np.testing.assert_allclose(found[:, 6:], np.tile(BODY.neutral[6:], (2, 1)), atol=0.02)


def test_a_template_of_another_size_is_measured_again_by_what_was_decided() -> None:
    """Landmarks of which no distance stays say little at first; sizes that they decide give the scale of the rest."""
    truth = TREE.sized(1.0, TREE.factors_by_name(np.full(4, 1.5)))
    names = ("left_claw", "right_claw", "left claw tip", "right claw tip")
    tree = FilmedTree(BODY, names)
    assert tree.groups == (("left_out", "right_out"), ("left_length", "right_length"), ("claw",))
    fit = fit_film(tree, CAMERAS, clicked(truth, poses_of(6), names))
    assert fit.scale == pytest.approx(1.5, rel=0.06)
    np.testing.assert_allclose(fit.values, 1.5 * np.array([55.0, 80.0, 35.0]), rtol=0.03)


def test_the_spread_of_points_is_beside_that_of_the_same_points_at_rest() -> None:
    rest = np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0]])
    seen = 2.5 * rest + 7.0
    assert _spread(seen, rest) == pytest.approx(2.5)
    seen[1] = np.nan
    assert _spread(seen, rest) == pytest.approx(2.5)
    seen[2] = np.nan
    assert math.isnan(_spread(seen, rest))
    assert math.isnan(_spread(rest, np.zeros((3, 3))))


def test_poses_of_a_body_of_known_sizes() -> None:
    poses = poses_of(3)
    fit = fit_poses(TREE, CAMERAS, clicked(sized(), poses), sized(), [BODY.neutral])
    np.testing.assert_allclose(
        marker_points(fit.body, fit.poses), marker_points(FilmedTree(sized(), NAMES).body, poses), atol=1.0
    )
    assert (len(fit.values), len(fit.decided), fit.scale) == (0, 0, 1.0)


def test_a_frame_in_a_wrong_turn_is_begun_again_from_those_that_fit() -> None:
    poses = poses_of(5)
    poses[:, :6] = poses[0, :6]
    frames = clicked(TREE.sized(1.3, TREE.factors_by_name(np.ones(4))), poses)
    wrong = poses.copy()
    wrong[2, 3] += 2.5
    sought = problem(frames)
    found = sought.retried(np.ones(4), wrong)
    np.testing.assert_array_equal(found[[0, 1, 3, 4]], poses[[0, 1, 3, 4]])
    assert sought.costs(np.ones(4), found)[2] < 1.0
    assert sought.costs(np.ones(4), wrong)[2] > 20.0


def test_a_root_that_is_held_is_in_one_place_in_all_frames() -> None:
    poses = poses_of(4)
    poses[:, :6] = poses[0, :6]
    fit = fit_film(TREE, CAMERAS, clicked(sized(), poses), held=True)
    np.testing.assert_allclose(fit.poses[:, :6], np.tile(fit.poses[0, :6], (4, 1)))
    np.testing.assert_allclose(fit.values, FACTORS * [55.0, 80.0, 40.0, 35.0], rtol=5e-3)
