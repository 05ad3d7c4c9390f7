"""Bodies whose links have meshes: drawn, weighed and refined by these, not by the cones around them."""

import numpy as np
import pytest
from meshed_arm import CAMERAS, TRUE, arm

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel
from studio.body.reader import parse_body
from studio.body.writing import body_text
from studio.evidence.distance_maps import distances_of
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError
from studio.foundations.progress import no_progress
from studio.runs.setup.mesh_start import outlines_put_right, twins
from studio.search.likelihood.mesh_outlines import MeshOutlines
from studio.search.likelihood.mesh_silhouettes import MeshSilhouettes
from studio.search.trackers.refinement import RefinementSettings, Refiner


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return arm()


@pytest.fixture(scope="module")
def evidence(body: BodyModel) -> FrameEvidence:
    views = list[ViewEvidence]()
    for camera, mask in zip(CAMERAS, MeshOutlines(body, CAMERAS).silhouettes(TRUE), strict=True):
        picture = np.zeros((*mask.shape, 3), np.uint8)
        views.append(ViewEvidence(camera.name, picture, mask, np.zeros_like(mask)))
    return FrameEvidence(0, tuple(views))


def off(pose: Array) -> float:
    """Degrees, the worst."""
    return float(np.degrees(np.abs(pose - TRUE).max()))


def test_a_body_file_holds_its_meshes(body: BodyModel) -> None:
    again = parse_body(body_text(body), "arm", "arm.toml")
    for one, other in zip(body.meshes, again.meshes, strict=True):
        assert one.joint == other.joint
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.triangles, other.triangles)


def test_a_damaged_mesh_is_named(body: BodyModel) -> None:
    text = body_text(body)
    wrong = text.replace('points = "', 'points = "AAAA', 1)
    with pytest.raises(BodyError, match="mesh 1"):
        parse_body(wrong, "arm", "arm.toml")


def test_an_outline_moves_as_its_slopes_say(body: BodyModel) -> None:
    outlines = MeshOutlines(body, CAMERAS)
    there = outlines.of(TRUE)[0]
    rows = np.arange(len(there.border))
    slopes = outlines.slopes(TRUE, 0, there, rows, np.full(3, 1e-3))
    turned = TRUE + np.radians([0.0, 0.0, 3.0])
    moved = outlines.of(turned)[0]
    expected = slopes[:, 2] * np.radians(3.0)
    near = np.array(
        [np.min(np.linalg.norm(moved.border - there.border[row] - change * there.outward[row], axis=1))
         for row, change in zip(rows, expected, strict=True)]
    )  # fmt: skip
    assert np.abs(expected).max() > 3.5
    assert np.median(near) < 1.0


def test_refinement_follows_the_meshes_and_not_the_cones(body: BodyModel, evidence: FrameEvidence) -> None:
    silhouettes = [distances_of(view.mask) for view in evidence.views]
    start = TRUE + np.radians([3.0, -3.0, 3.0])
    refined = Refiner(body, CAMERAS, RefinementSettings()).refine(start, silhouettes).pose
    assert off(refined) < 0.4


def test_the_right_pose_weighs_most(body: BodyModel, evidence: FrameEvidence) -> None:
    others = TRUE + np.radians(np.random.default_rng(0).uniform(-40.0, 40.0, size=(40, 3)))
    weights = MeshSilhouettes(body, CAMERAS, evidence).log_likelihood(np.vstack([TRUE[None], others]))
    assert np.argmax(weights) == 0


def test_a_wrong_end_of_a_chain_is_drawn_again(body: BodyModel, evidence: FrameEvidence) -> None:
    start = TRUE + np.radians([0.0, 90.0, -120.0])
    stands = outlines_put_right(body, CAMERAS, evidence, start, 0, no_progress)
    assert off(stands.pose) < 0.4


def test_the_twin_of_a_pose_leaves_the_last_link_where_it_is() -> None:
    turning = arm("zyz")
    pose = np.radians([40.0, -70.0, -60.0])
    (other,) = twins(turning, pose)
    np.testing.assert_allclose(np.degrees(other), [-140.0, 70.0, 120.0])
    last = [joint_frames(turning, one)[0, -1] for one in (pose, other)]
    np.testing.assert_allclose(last[0], last[1], atol=1e-9)
