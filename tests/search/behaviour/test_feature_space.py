"""Features: angles and their derivatives, continuous and without the root."""

import math

import numpy as np
import pytest

from studio.body.catalogue import list_bodies, load_body
from studio.foundations.errors import BehaviourError
from studio.search.behaviour.feature_space import feature_space

ROOT = {"pelvis_x", "pelvis_y", "pelvis_z", "heading", "lean_forward", "lean_right"}


@pytest.mark.parametrize("name", list_bodies())
def test_all_but_the_six_global_parameters_are_modelled(name: str) -> None:
    body = load_body(name)
    space = feature_space(body, 30.0)
    # Bodies that move about freely have a place.
    free = any(entry.kind == "length" for entry in body.parameters)
    assert space.dimensions == len(body.parameters) - (6 if free else 0)
    assert [body.parameters[column].name for column in space.columns] == list(space.names)
    assert not any(body.parameters[column].limb == "root" for column in space.columns)


def test_human25_has_the_paper_s_nineteen() -> None:
    space = feature_space(load_body("human25"), 30.0)
    assert space.dimensions == 19
    assert set(space.parameters) - set(space.names) == ROOT


def test_derivatives_are_backward_differences_and_ignore_the_root() -> None:
    body = load_body("human25")
    space = feature_space(body, 30.0)
    rng = np.random.default_rng(0)
    poses = body.neutral + 0.1 * np.cumsum(rng.standard_normal((20, 25)), axis=0)
    features = space.features(poses)
    values = poses[:, space.columns]
    np.testing.assert_allclose(features[:, :19], values)
    np.testing.assert_allclose(features[1:, 19:], values[1:] - values[:-1], atol=1e-12)
    np.testing.assert_allclose(features[0, 19:], features[1, 19:])
    moved = poses.copy()
    moved[:, :6] += 100.0 * rng.standard_normal((20, 6))
    np.testing.assert_array_equal(space.features(moved), features)
    np.testing.assert_allclose(space.poses(values, body.neutral)[:, space.columns], values)
    np.testing.assert_array_equal(space.poses(values)[:, :6], np.repeat(body.neutral[None, :6], 20, axis=0))


def test_whole_turns_are_taken_out_within_and_between_recordings() -> None:
    body = load_body("human25")
    space = feature_space(body, 30.0)
    poses = np.repeat(body.neutral[None], 100, axis=0)
    column = space.columns[3]
    poses[:, column] = 0.5 + 1.2 * np.sin(np.arange(100) / 15.0)
    wrapped = poses.copy()
    wrapped[:, column] = (poses[:, column] + math.pi + 2.0) % (2.0 * math.pi) - math.pi - 2.0
    assert np.abs(np.diff(wrapped[:, column])).max() > 6.0
    np.testing.assert_allclose(space.features(wrapped), space.features(poses), atol=1e-12)
    np.testing.assert_allclose(space.features(wrapped + 4.0 * math.pi), space.features(poses), atol=1e-12)


def test_two_frames_have_features() -> None:
    body = load_body("planar_arm4")
    poses = np.array([body.neutral, body.neutral + 0.1])
    features = feature_space(body, 30.0).features(poses)
    np.testing.assert_allclose(features, np.hstack([poses, np.full((2, 4), 0.1)]))


def test_turns_are_taken_out_towards_the_middle_of_the_limits() -> None:
    body = load_body("human25")
    space = feature_space(body, 30.0)
    entries = [body.parameters[column] for column in space.columns]
    middle = np.array([(entry.lower + entry.upper) / 2.0 for entry in entries])
    limited = np.isfinite(middle)
    np.testing.assert_allclose(space.middle[limited], middle[limited])
    np.testing.assert_array_equal(space.middle[~limited], body.neutral[space.columns][~limited])
    poses = np.repeat(body.neutral[None], 3, axis=0)
    # Half a turn on either side of the middle stays, and what is farther comes nearer by whole turns.
    for away, wanted in ((3.1, 3.1), (-3.1, -3.1), (3.2, 3.2 - 2.0 * math.pi), (-9.5, -9.5 + 4.0 * math.pi)):
        poses[:, space.columns] = space.middle + away
        found = space.continuous(poses) - space.middle
        np.testing.assert_allclose(found, wanted)


def test_an_endless_frame_rate_is_none() -> None:
    for rate in (-1.0, math.inf, math.nan):
        with pytest.raises(BehaviourError, match="frame rate"):
            feature_space(load_body("human25"), rate)


def test_errors_name_the_cause() -> None:
    body = load_body("human25")
    space = feature_space(body, 30.0)
    with pytest.raises(BehaviourError, match="1 frame has no derivatives"):
        space.features(body.neutral[None])
    with pytest.raises(BehaviourError, match=r"\(3, 4\)"):
        space.features(np.zeros((3, 4)))
    poses = np.repeat(body.neutral[None], 5, axis=0)
    poses[3, 7] = np.nan
    with pytest.raises(BehaviourError, match="frame 3"):
        space.features(poses)
    with pytest.raises(BehaviourError, match="0 is not a valid frame rate"):
        feature_space(body, 0.0)
    with pytest.raises(BehaviourError, match="'human25' with 25 parameters, not of 'dog' with 29"):
        space.check_body(load_body("dog"))
    space.check_body(body)
