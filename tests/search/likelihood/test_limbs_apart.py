"""Hard priors against independent geometry and real poses."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from studio.body.catalogue import list_bodies, load_body
from studio.body.forward_kinematics import limb_ends, limb_frames
from studio.body.model import BodyModel, Limb
from studio.body.person import PersonMotion
from studio.body.subject import Subject, fit_subject
from studio.foundations.errors import BodyError
from studio.results.drawing_footage.person import marker_lengths
from studio.search.likelihood.hard_prior_kernels import closest
from studio.search.likelihood.hard_priors import LIMB_SHARE, TRUNK_SHARE, HardPriors, limb_pairs

HEIGHT = 1760.0
EXACT = 0.5

points = st.tuples(*[st.floats(-500.0, 500.0, width=32)] * 3)


def _body(name: str = "human31", motion: PersonMotion | None = None) -> BodyModel:
    lengths = {} if motion is None else marker_lengths(motion)
    return fit_subject(load_body(name), Subject(name, HEIGHT, lengths))[0]


def _around(body: BodyModel, count: int, spread: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    scale = np.array([1.0 if entry.kind == "angle" else 200.0 for entry in body.parameters])
    return body.neutral + spread * scale * rng.standard_normal((count, len(scale)))


@settings(max_examples=300, deadline=None)
@given(points, points, points, points)
def test_the_closest_points_of_two_segments_are_those_of_a_dense_sampling(
    start: tuple[float, ...],
    end: tuple[float, ...],
    other_start: tuple[float, ...],
    other_end: tuple[float, ...],
) -> None:
    """Dense in s; the nearest point of the other segment to each sample is a closed form."""
    p0, p1, q0, q1 = (np.array(point) for point in (start, end, other_start, other_end))
    p, q, r = p1 - p0, q1 - q0, p0 - q0
    if min(np.linalg.norm(p), np.linalg.norm(q)) < 1.0:
        return
    s, t = closest(p @ p, p @ q, p @ r, q @ q, q @ r)
    assert 0.0 <= s <= 1.0
    assert 0.0 <= t <= 1.0
    found = np.linalg.norm(r + s * p - t * q)
    samples = r + np.linspace(0.0, 1.0, 4001)[:, None] * p
    nearest = np.clip(samples @ q / (q @ q), 0.0, 1.0)
    sampled = np.linalg.norm(samples - nearest[:, None] * q, axis=1).min()
    assert found <= sampled + 2e-3 * np.linalg.norm(p)
    assert found >= sampled - np.linalg.norm(p) / 8000.0 - 1e-6


def _expected_share(body: BodyModel, pose: np.ndarray, one: int, two: int) -> float:
    """Distance of two axes by bounded least squares, over both ellipses' half widths towards each other."""
    frames, ends = limb_frames(body, pose)[0], limb_ends(body, pose)[0]
    along = np.stack([ends[one, 1] - ends[one, 0], ends[two, 0] - ends[two, 1]], axis=1)
    answer = lsq_linear(along, ends[two, 0] - ends[one, 0], (0.0, 1.0), tol=1e-14)
    way = ends[one, 0] - ends[two, 0] + along @ answer.x
    extents = 0.0
    for limb, share in ((one, answer.x[0]), (two, answer.x[1])):
        drawn = body.drawn[limb]
        radius = drawn.radius_start + share * (drawn.radius_end - drawn.radius_start)
        sideways = frames[limb, :, :2].T @ way * np.array([drawn.scale_x, drawn.scale_y])
        extents += radius * float(np.linalg.norm(sideways))
    return float(way @ way) / extents


@pytest.mark.parametrize("name", ["human31", "human29", "dog"])
def test_shares_are_those_of_an_independent_computation(name: str) -> None:
    body = _body(name) if name != "dog" else load_body(name)
    poses, pairs = _around(body, 37, 0.3, 11), limb_pairs(body)
    shares = pairs.shares(poses)
    assert shares.shape == (37, len(pairs.limbs))
    rng = np.random.default_rng(0)
    for row, column in zip(rng.integers(37, size=150), rng.integers(len(pairs.limbs), size=150), strict=True):
        expected = _expected_share(body, poses[row], *pairs.limbs[column])
        if expected < 20.0:
            assert shares[row, column] == pytest.approx(expected, rel=2e-3, abs=1e-3)


def _inside(limb: Limb, frame: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Which world points lie in a truncated elliptical cone."""
    local = (samples - frame[:, 3]) @ frame[:, :3]
    along = local[:, 2] / limb.length
    radius = limb.radius_start + along * (limb.radius_end - limb.radius_start)
    across = np.hypot(local[:, 0] / limb.scale_x, local[:, 1] / limb.scale_y)
    return (along >= 0.0) & (along <= 1.0) & (across <= radius)


def _filled(limb: Limb, frame: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """World points all over a truncated elliptical cone."""
    along, angle, out = rng.random(20000), 2.0 * math.pi * rng.random(20000), np.sqrt(rng.random(20000))
    radius = out * (limb.radius_start + along * (limb.radius_end - limb.radius_start))
    local = np.stack(
        [limb.scale_x * radius * np.cos(angle), limb.scale_y * radius * np.sin(angle), along * limb.length],
        axis=1,
    )
    return local @ frame[:, :3].T + frame[:, 3]


def test_refused_pairs_overlap_and_separate_pairs_are_kept() -> None:
    """Volumes filled with points: a pair below its least share has points in both; one above 1.2 has none."""
    body, rng = _body(), np.random.default_rng(5)
    poses, pairs = _around(body, 200, 0.5, 6), limb_pairs(body)
    shares, frames = pairs.shares(poses), limb_frames(body, poses)
    near = np.argwhere(shares < pairs.least)
    far = np.argwhere((shares > 1.2) & (shares < 1.6))
    assert len(near) > 100
    for group, overlapping in ((near[::3][:60], True), (far[::20][:30], False)):
        for row, column in group:
            one, two = pairs.limbs[column]
            samples = _filled(body.drawn[one], frames[row, one], rng)
            assert _inside(body.drawn[two], frames[row, two], samples).any() == overlapping, (row, column)


@pytest.mark.parametrize("name", list_bodies())
def test_every_body_can_stand_as_it_rests(name: str) -> None:
    body = load_body(name)
    assert HardPriors(body).hold(body.neutral[None], limbs_apart=True).all()


def test_the_pairs_that_are_compared() -> None:
    body = load_body("human31")
    pairs = limb_pairs(body)
    names = [limb.name for limb in body.drawn]
    least = {(names[a], names[b]): value for (a, b), value in zip(pairs.limbs, pairs.least, strict=True)}
    joined = {
        *(("torso", "left thigh"), ("torso", "right thigh"), ("torso", "head")),
        *(("left thigh", "left shin"), ("right thigh", "right shin")),
        *(("left upper arm", "left forearm"), ("right upper arm", "right forearm")),
    }
    assert not joined & set(least)
    assert len(least) + len(joined) == 45
    assert least["torso", "left upper arm"] == pytest.approx(TRUNK_SHARE)
    assert least["left forearm", "head"] == pytest.approx(TRUNK_SHARE)
    assert least["left thigh", "right thigh"] == pytest.approx(LIMB_SHARE)


def test_collar_bones_that_begin_at_one_point_are_not_compared() -> None:
    body = load_body("human29")
    names = [limb.name for limb in body.drawn]
    compared = {frozenset((names[a], names[b])) for a, b in limb_pairs(body).limbs}
    assert frozenset(("left clavicle", "right clavicle")) not in compared
    assert frozenset(("left clavicle", "head")) not in compared
    assert frozenset(("left forearm", "thorax")) in compared


def test_a_verdict_does_not_depend_on_other_poses() -> None:
    body = _body()
    priors, poses = HardPriors(body), _around(body, 333, 0.25, 8)
    together = priors.hold(poses, limbs_apart=True)
    assert 0 < together.sum() < len(poses)
    alone = np.concatenate([priors.hold(pose[None], limbs_apart=True) for pose in poses])
    np.testing.assert_array_equal(together, alone)
    np.testing.assert_array_equal(limb_pairs(body).shares(poses[::-1])[::-1], limb_pairs(body).shares(poses))


def _folded(body: BodyModel) -> np.ndarray:
    """A forearm turned inwards through the trunk: within the limits of every joint."""
    degrees = {"left_shoulder_rx": -40.0, "left_shoulder_rz": 80.0, "left_elbow_ry": -90.0}
    pose = body.neutral
    for place, entry in enumerate(body.parameters):
        pose[place] = math.radians(degrees[entry.name]) if entry.name in degrees else pose[place]
    return pose


def test_limits_are_inclusive_and_limbs_compared_only_on_request() -> None:
    body = _body()
    priors = HardPriors(body)
    poses = np.repeat(body.neutral[None], 4, axis=0)
    knee = [entry.name for entry in body.parameters].index("left_knee_ry")
    poses[0, knee] = body.parameters[knee].upper
    poses[1, knee] = body.parameters[knee].upper + 1e-9
    poses[2] = _folded(body)
    poses[3, 0] = math.nan
    assert priors.hold(poses).tolist() == [True, False, True, False]
    assert priors.hold(poses, limbs_apart=True).tolist() == [True, False, False, False]


def test_every_parameter_has_two_limits_and_a_limit_is_within() -> None:
    body = load_body("human31")
    priors = HardPriors(body)
    for bound, beyond in ((body.lower, -1e-9), (body.upper, 1e-9)):
        limited = np.flatnonzero(np.isfinite(bound))
        poses = np.repeat(body.neutral[None], len(limited), axis=0)
        poses[np.arange(len(limited)), limited] = bound[limited]
        assert priors.hold(poses).all()
        poses[np.arange(len(limited)), limited] += beyond
        assert not priors.hold(poses).any()


def test_limbs_are_apart_whatever_the_limits_but_not_in_poses_that_are_none() -> None:
    body = _body()
    priors, poses = HardPriors(body), np.repeat(body.neutral[None], 5, axis=0)
    place = [entry.name for entry in body.parameters].index("pelvis_x")
    poses[0, place], poses[1, place], poses[2, place] = np.inf, -np.inf, np.nan
    poses[3, [entry.name for entry in body.parameters].index("left_knee_ry")] = body.upper.max() + 7.0
    assert priors.apart(poses[[0, 1, 2, 4]]).tolist() == [False, False, False, True]
    assert not priors.hold(poses[3:4])
    # Poses that are no poses change nothing for the others.
    others = _around(body, 40, 0.3, 2)
    mixed = np.insert(others, [0, 7, 16, 17, 40], poses[0], axis=0)
    kept = np.isfinite(mixed).all(axis=1)
    np.testing.assert_array_equal(priors.apart(mixed)[kept], priors.apart(others))
    assert not priors.apart(mixed)[~kept].any()


def test_poses_of_another_body_are_refused() -> None:
    with pytest.raises(BodyError, match="31 parameters"):
        HardPriors(load_body("human31")).hold(np.zeros((2, 30)))


def test_limbs_know_what_they_hang_from_where_flesh_lies_beside_the_bone() -> None:
    mouse, plain = load_body("mouse"), load_body("human34")
    named = lambda body, pairs: {frozenset(body.drawn[i].name for i in pair) for pair in pairs.limbs}  # noqa: E731
    # Neighbours overlap at their joint and are not compared, unless one begins outside the other.
    assert not {frozenset({"left haunch", "rump"}), frozenset({"head", "left ear"})} & named(
        mouse, limb_pairs(mouse)
    )
    person = load_body("human35")
    assert named(person, limb_pairs(person)) == named(plain, limb_pairs(plain))
