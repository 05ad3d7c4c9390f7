"""The other branch of joint angles is the same attitude, and is found where limits keep a fit from it."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.runs.learning import pose_fitting
from studio.runs.learning.other_spellings import on_branch, triples
from studio.runs.learning.targets import of_poses

OVERHEAD = np.array(
    [
        (-42, 27),
        (-50, 54),
        (1, 86),
        (95, 69),
        (93, 43),
        (71, -21),
        (54, -30),
        (66, 15),
        (2, 80),
        (-61, 62),
        (-51, 52),
    ],
    dtype=float,
)
"""Degrees of swing and spread of a dancer's left arm that goes up behind, and comes down in front."""


def named(body, *names: str) -> list[int]:
    """Places in the pose vector."""
    known = [entry.name for entry in body.parameters]
    return [known.index(name) for name in names]


def test_shoulders_and_hips_have_three_turns_in_a_row() -> None:
    for name in ("human25", "human31"):
        body = load_body(name)
        of_shoulders = [row for row in triples(body) if "shoulder" in body.parameters[row[0]].name]
        assert len(of_shoulders) == 2
        assert not {0, 1, 2} & {place for row in triples(body) for place in row}
    # A clavicle lies between two joints of human29: they are no three turns in one place.
    body = load_body("human29")
    used = [place for row in triples(body) for place in row]
    assert len(used) == len(set(used))


@pytest.mark.parametrize("name", ["human25", "human31"])
def test_the_other_branch_is_the_same_attitude(name: str) -> None:
    body = load_body(name)
    rng = np.random.default_rng(2)
    row = next(row for row in triples(body) if "left_shoulder" in body.parameters[row[0]].name)
    poses = np.tile(body.neutral, (400, 1))
    lower, upper = (
        np.array([getattr(body.parameters[place], side) for place in row]) for side in ("lower", "upper")
    )
    turned, kept = 0, []
    for pose in poses:
        pose[list(row)] = rng.uniform(lower, upper)
    for beyond in (False, True):
        other = poses.copy()
        other[:, row] = on_branch(body, poses, beyond)[:, row]
        inside = np.all((other[:, row] > lower) & (other[:, row] < upper), axis=1)
        changed = inside & np.any(other[:, row] != poses[:, row], axis=1)
        np.testing.assert_allclose(limb_ends(body, other[inside]), limb_ends(body, poses[inside]), atol=1e-6)
        np.testing.assert_allclose(
            marker_points(body, other[inside]), marker_points(body, poses[inside]), atol=1e-6
        )
        turned += int(changed.sum())
        kept.append(np.abs(other[inside, row[1]]) > np.pi / 2)
    assert turned
    assert not kept[0].any()
    assert kept[1].all()


def test_a_fit_that_began_on_the_wrong_branch_finds_the_other(monkeypatch) -> None:
    body = load_body("human25")
    poses = np.tile(body.neutral, (45, 1))
    way = CubicSpline(np.linspace(0.0, 44.0, len(OVERHEAD)), np.radians(OVERHEAD))(np.arange(45))
    poses[:, named(body, "left_shoulder_swing", "left_shoulder_spread")] = way
    poses[:, named(body, "left_elbow")] = np.radians(40.0)

    def pressed_to_limits(problem, *_) -> np.ndarray:
        return on_branch(body, poses, beyond=True) / problem.scale

    monkeypatch.setattr(pose_fitting, "_follow", pressed_to_limits)
    found = pose_fitting.fit_poses(body, of_poses(body, poses), 30.0)
    assert np.sqrt(np.mean(found.rms_mm**2)) < 5.0
    monkeypatch.setattr(pose_fitting, "on_branch", lambda body, path, beyond: path)
    stuck = pose_fitting.fit_poses(body, of_poses(body, poses), 30.0)
    assert np.sqrt(np.mean(stuck.rms_mm**2)) > 10.0
