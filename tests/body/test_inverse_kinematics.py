import numpy as np
import pytest
from scipy.optimize import least_squares

from studio.body.catalogue import list_bodies, load_body
from studio.body.forward_kinematics import marker_points
from studio.body.inverse_kinematics import _MarkerProblem, known_markers, pose_from_markers
from studio.body.least_squares import strictly_inside
from studio.body.model import BodyModel
from studio.foundations.errors import BodyError


def _names(body: BodyModel) -> tuple[str, ...]:
    return tuple(marker.name for marker in body.markers)


def _pose(body: BodyModel, seed: int) -> np.ndarray:
    """A pose within the limits, the root far from the rest pose and facing any way."""
    rng = np.random.default_rng(seed)
    pose = body.neutral
    for place, entry in enumerate(body.parameters):
        if entry.kind == "length":
            pose[place] += rng.normal(0.0, 1500.0)
        elif np.isinf(entry.upper):
            pose[place] += rng.normal(0.0, 0.3)
        else:
            pose[place] = np.clip(pose[place] + rng.normal(0.0, 0.35), entry.lower + 0.01, entry.upper - 0.01)
    headings = [
        place for place, entry in enumerate(body.parameters) if entry.name in ("heading", "pelvis_rz")
    ]
    pose[headings] = rng.uniform(-np.pi, np.pi)
    return pose


@pytest.mark.parametrize("name", list_bodies())
def test_markers_are_met_from_the_rest_pose_within_the_limits(name: str) -> None:
    body = load_body(name)
    lower = np.array([entry.lower for entry in body.parameters])
    upper = np.array([entry.upper for entry in body.parameters])
    for seed in range(4):
        points = marker_points(body, _pose(body, seed))[0]
        pose, rms = pose_from_markers(body, _names(body), points, body.neutral)
        np.testing.assert_allclose(marker_points(body, pose)[0], points, atol=0.5)
        assert rms < 0.5
        assert ((pose >= lower) & (pose <= upper)).all()


def test_missing_markers_are_ignored_and_any_order_will_do() -> None:
    body = load_body("human31")
    truth = _pose(body, 3)
    names = tuple(reversed(_names(body)))
    points = marker_points(body, truth)[0][::-1].copy()
    points[names.index("RWrist")] = np.nan
    points[names.index("Hip"), 1] = np.nan
    pose, rms = pose_from_markers(body, names, points, body.neutral)
    assert rms < 0.5
    seen = np.isfinite(points).all(axis=1)
    np.testing.assert_allclose(marker_points(body, pose)[0][::-1][seen], points[seen], atol=0.5)


def test_noise_is_spread_not_followed() -> None:
    body = load_body("human31")
    points = marker_points(body, _pose(body, 1))[0]
    noise = 10.0 * np.random.default_rng(9).standard_normal(points.shape)
    pose, rms = pose_from_markers(body, _names(body), points + noise, body.neutral)
    size = np.sqrt((noise**2).sum(axis=1).mean())
    # The truth leaves the whole noise: the best pose leaves no more, so it is at most twice that away.
    assert rms <= size
    away = marker_points(body, pose)[0] - points
    assert np.sqrt((away**2).sum(axis=1).mean()) <= 2.0 * size


def test_points_out_of_reach_leave_the_nearest_pose() -> None:
    body = load_body("planar_arm4")
    points = np.array([[0.0, 0.0, 5000.0]])
    pose, rms = pose_from_markers(body, ("Tip",), points, np.full(4, 0.3))
    np.testing.assert_allclose(pose, 0.0, atol=1e-3)
    assert rms == pytest.approx(4000.0, abs=1e-3)


def test_what_points_leave_open_stays_near_the_start() -> None:
    """One point of an arm of four joints, against scipy's own least squares: 0.02 mm a radian."""
    body = load_body("planar_arm4")
    start = np.array([0.3, -0.2, 0.4, 0.1])
    point = marker_points(body, start + np.array([0.2, 0.1, -0.3, 0.2]))[0, -1:]
    tip = (body.markers[-1].name,)

    def residuals(pose: np.ndarray) -> np.ndarray:
        return np.concatenate([(marker_points(body, pose)[0, -1] - point[0]), 0.02 * (pose - start)])

    wanted = least_squares(residuals, start, xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    pose, rms = pose_from_markers(body, tip, point, start)
    np.testing.assert_allclose(pose, wanted, atol=1e-4)
    away = marker_points(body, pose)[0, -1] - point[0]
    assert rms == pytest.approx(np.linalg.norm(away))


def problem_of(name: str, pose: np.ndarray | None = None, **start: float) -> _MarkerProblem:
    """Of the markers of some pose, sought from the rest pose with some values changed."""
    body = load_body(name)
    points = marker_points(body, body.neutral if pose is None else pose)[0]
    begin = body.neutral
    for key, value in start.items():
        begin[[entry.name for entry in body.parameters].index(key)] += value
    return _MarkerProblem(body, _names(body), points, begin)


def test_the_root_is_sought_from_eight_headings_of_the_start_and_of_rest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = problem_of("human31", pelvis_rz=0.3, pelvis_x=80.0)
    begun: list[np.ndarray] = []

    def fitted(_self: object, pose: np.ndarray, free: np.ndarray) -> np.ndarray:
        assert sorted(free) == list(range(6))
        begun.append(pose)
        return pose

    monkeypatch.setattr(_MarkerProblem, "fitted", fitted)
    starts = problem.starts()
    heading = problem.turns[0]
    wanted = [
        base[heading] + turn * np.pi / 4.0
        for base in (problem.start, problem.body.neutral)
        for turn in range(8)
    ]
    np.testing.assert_allclose([pose[heading] for pose in begun], wanted)
    for pose in begun:
        middle = marker_points(problem.body, pose)[0].mean(axis=0)
        np.testing.assert_allclose(middle, problem.points.mean(axis=0), atol=1e-6)
    errors = sorted(problem.error(pose) for pose in begun)
    np.testing.assert_array_equal(starts[0], problem.start)
    np.testing.assert_allclose([problem.error(pose) for pose in starts[1:]], errors[:4])
    assert problem.error(starts[1]) == pytest.approx(
        np.sqrt(((marker_points(problem.body, starts[1])[0] - problem.points) ** 2).sum(axis=1).mean())
    )


def test_a_body_that_stands_is_sought_from_the_start_and_from_rest() -> None:
    problem = problem_of("planar_arm4")
    starts = problem.starts()
    np.testing.assert_array_equal(starts, [problem.start, problem.body.neutral])
    assert [len(part) for part in (problem.root, problem.turns, problem.moves)] == [1, 1, 0]


def test_while_markers_stay_away_twelve_shaken_poses_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = 0
    own = _MarkerProblem.fitted

    def fitted(self: _MarkerProblem, pose: np.ndarray, free: np.ndarray) -> np.ndarray:
        nonlocal tried
        tried += 1
        return own(self, pose, free)

    monkeypatch.setattr(_MarkerProblem, "fitted", fitted)
    body = load_body("planar_arm4")
    pose_from_markers(body, ("Tip",), np.array([[0.0, 0.0, 5000.0]]), np.full(4, 0.3))
    assert tried == 2 + 12
    tried = 0
    pose_from_markers(body, ("Tip",), marker_points(body, np.full(4, 0.2))[0, -1:], np.full(4, 0.3))
    assert tried == 1


class Ones:
    """Random numbers that are all one."""

    def standard_normal(self, size: int) -> np.ndarray:
        return np.ones(size)


def test_shaking_moves_the_angles_below_the_root_and_keeps_limits() -> None:
    problem = problem_of("human31")
    body = problem.body
    pose = body.neutral
    shaken = problem.shaken(Ones(), pose)
    wanted = np.where(body.angles, np.clip(pose + 0.7, body.lower, body.upper), pose)
    wanted[:6] = pose[:6]
    np.testing.assert_allclose(shaken, wanted)


def test_whole_turns_are_taken_back_where_limits_allow() -> None:
    problem = problem_of("human31", pelvis_rz=1.0)
    pose = problem.start + 2.0 * np.pi * np.where(np.arange(len(problem.start)) < 6, -2.0, 0.0)
    found = problem.unwound(pose)
    np.testing.assert_allclose(found[problem.turns], problem.start[problem.turns])
    np.testing.assert_allclose(found[problem.moves], pose[problem.moves])
    problem.lower = problem.start + 0.5
    np.testing.assert_array_equal(problem.unwound(pose), pose)
    problem.lower, problem.upper = problem.start - 100.0, problem.start - 0.5
    np.testing.assert_array_equal(problem.unwound(pose), pose)


def test_a_start_lies_strictly_inside_its_limits() -> None:
    lower, upper = np.array([0.0, 0.0, 0.0, -np.inf]), np.array([2.0, 2.0, 2.0, 5.0])
    inside = strictly_inside(np.array([-1.0, 3.0, 1.0, 5.0]), lower, upper)
    np.testing.assert_allclose(inside, [0.0, 2.0, 1.0, 5.0], atol=1e-8)
    assert ((inside > lower) & (inside < upper)).all()


def test_the_markers_that_a_body_knows() -> None:
    body = load_body("planar_arm4")
    assert known_markers(body, ["Nose", "Tip", "Ear", "Tip"]) == ([1, 3], ("Tip", "Tip"))


def test_the_same_points_give_the_same_pose() -> None:
    body = load_body("human25")
    points = marker_points(body, _pose(body, 6))[0] + 5.0
    first, _ = pose_from_markers(body, _names(body), points, body.neutral)
    again, _ = pose_from_markers(body, _names(body), points, body.neutral)
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize(("names", "points", "start", "words"), [
    (("Tip", "Nose"), np.zeros((2, 3)), np.zeros(4), "no marker 'Nose'"),
    (("Tip",), np.full((1, 3), np.nan), np.zeros(4), "No marker has a position"),
    (("Tip",), np.zeros((2, 3)), np.zeros(4), "do not fit"),
    (("Tip",), np.zeros((1, 3)), np.zeros(5), "do not fit"),
    (("Tip",), np.zeros((1, 3)), np.full(4, np.nan), "NaN"),
])  # fmt: skip
def test_wrong_input_is_refused(
    names: tuple[str, ...], points: np.ndarray, start: np.ndarray, words: str
) -> None:
    with pytest.raises(BodyError, match=words):
        pose_from_markers(load_body("planar_arm4"), names, points, start)
