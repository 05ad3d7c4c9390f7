"""Blobs of a body's cones, and their mixtures in a pose."""

import numpy as np
import pytest
from posed_hulls import near

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_frames
from studio.body.model import kinematic_tables
from studio.evidence.volume.blob_model import BlobModel, cone_blobs, cone_moments
from studio.foundations.errors import BodyError

BODIES = ("human25", "human31", "dog", "planar_arm4", "branched_arms6")


@pytest.mark.parametrize("name", BODIES)
def test_moments_are_those_of_points_drawn_in_the_cones(name: str) -> None:
    body = load_body(name)
    rng = np.random.default_rng(0)
    moments = cone_moments(body)
    for limb, (length, start, end, sx, sy) in enumerate(kinematic_tables(body).limb_shape):
        widest = max(start, end)
        box = rng.uniform(-1.0, 1.0, (200_000, 3)) * [widest * sx, widest * sy, 0.5] + [0.0, 0.0, 0.5]
        radius = start + box[:, 2] * (end - start)
        inside = box[np.hypot(box[:, 0] / sx, box[:, 1] / sy) <= radius] * [1.0, 1.0, length]
        share = len(inside) / len(box)
        volume = 4 * widest**2 * sx * sy * abs(length) * share
        assert moments.volume[limb] == pytest.approx(volume, rel=0.02)
        assert moments.offset[limb] == pytest.approx(inside[:, 2].mean(), abs=0.01 * abs(length))
        # Hands are thinner than the thinnest blob.
        wanted = np.maximum(inside.var(axis=0), 25.0)
        np.testing.assert_allclose(moments.variances[limb], wanted, rtol=0.03)


def test_a_pose_carries_the_blobs_with_the_bones() -> None:
    body = load_body("human25")
    model = cone_blobs(body)
    poses = np.stack([body.neutral, near(body, body.neutral, 3, frames=8)])
    mixture = model.mixture(body, poses)
    frames = limb_frames(body, poses)
    for n in range(2):
        for b, limb in enumerate(model.limb):
            turn, origin = frames[n, limb, :, :3], frames[n, limb, :, 3]
            np.testing.assert_allclose(mixture.means[n, b], turn @ [0, 0, model.offset[b]] + origin)
            wanted = turn @ np.diag(model.eigenvalues[b]) @ turn.T
            np.testing.assert_allclose(mixture.covariances[n, b], wanted, atol=1e-9)
    assert mixture.weights.sum() == pytest.approx(1.0)


def test_colours_fill_only_what_is_unknown() -> None:
    body = load_body("planar_arm4")
    cones = cone_blobs(body)
    colour, variance = np.full((4, 3), np.nan), np.full((4, 3), np.nan)
    colour[1], variance[1] = [1, 2, 3], [4, 5, 6]
    model = BlobModel(cones.limb, cones.offset, cones.eigenvalues, colour, variance, cones.weight)
    filled = model.in_colour(np.array([9.0, 8.0, 7.0]), np.array([36.0, 36.0, 36.0]))
    assert filled.colour.tolist() == [[9, 8, 7], [1, 2, 3], [9, 8, 7], [9, 8, 7]]
    assert filled.colour_variance[1].tolist() == [4, 5, 6]


def test_a_pose_of_another_body_is_refused() -> None:
    with pytest.raises(BodyError, match="do not fit body 'human25'"):
        cone_blobs(load_body("human25")).mixture(load_body("human25"), np.zeros((1, 4)))
