"""Damaged evidence: of the requested degree, reproducible by seed, nothing else changed."""

import numpy as np
import pytest

from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.garden.reproduction.open_questions.robustness import (
    calibration_error,
    clutter,
    clutter_edges,
    damaged_mask,
    mask_damage,
)


def person_mask() -> np.ndarray:
    """A mask of a standing person's size."""
    mask = np.zeros((240, 320), np.uint8)
    mask[60:200, 140:190] = 255
    return mask


def evidence(frame: int = 5) -> FrameEvidence:
    mask = person_mask()
    picture = np.zeros((*mask.shape, 3), np.uint8)
    view = ViewEvidence("a", picture, mask, np.zeros_like(mask))
    return FrameEvidence(frame, (view, ViewEvidence("b", picture, mask, np.zeros_like(mask))))


@pytest.mark.parametrize("degree", [0.1, 0.3, 0.6])
def test_masks_are_damaged_to_the_given_degree(degree: float) -> None:
    mask = person_mask()
    damaged = damaged_mask(mask, degree, np.random.default_rng(0))
    person = (mask > 0).sum()
    torn = ((mask > 0) & (damaged == 0)).sum()
    added = ((mask == 0) & (damaged > 0)).sum()
    # A blob of up to 18 pixels' radius may go beyond; blobs overlap holes and fill them again.
    blob = np.pi * 18.0**2
    assert 0.5 * degree * person - blob <= torn <= 0.5 * degree * person + blob
    assert abs(added - 0.5 * degree * person) <= 2 * blob


def test_no_damage_is_the_same_mask_and_empty_masks_stay_empty() -> None:
    mask = person_mask()
    assert damaged_mask(mask, 0.0, np.random.default_rng(0)) is mask
    assert not damaged_mask(np.zeros_like(mask), 0.5, np.random.default_rng(0)).any()


def test_damage_differs_between_frames_views_and_seeds_and_repeats() -> None:
    spoil = mask_damage(0.3, seed=2).evidence
    first, again, later = spoil(evidence(5)), spoil(evidence(5)), spoil(evidence(6))
    np.testing.assert_array_equal(first.views[0].mask, again.views[0].mask)
    assert (first.views[0].mask != first.views[1].mask).any()
    assert (first.views[0].mask != later.views[0].mask).any()
    assert (mask_damage(0.3, seed=3).evidence(evidence(5)).views[0].mask != first.views[0].mask).any()


def test_clutter_covers_its_share_and_stays_in_place() -> None:
    rng = np.random.default_rng(1)
    assert not clutter_edges((120, 160), 0.0, rng).any()
    sparse, dense = clutter_edges((120, 160), 0.02, rng), clutter_edges((120, 160), 0.2, rng)
    assert sparse.mean() < dense.mean()
    assert dense.max() == 255
    spoil = clutter(0.05, seed=4).evidence
    one, other = spoil(evidence(1)), spoil(evidence(9))
    np.testing.assert_array_equal(one.views[0].edges, other.views[0].edges)
    assert one.views[0].edges.any()
    np.testing.assert_array_equal(one.views[0].mask, person_mask())


@pytest.mark.parametrize("pixels", [2.0, 10.0])
def test_a_turned_camera_is_off_by_the_given_pixels_and_stays_in_place(pixels: float) -> None:
    matrix = np.array([[500.0, 0.0, 160.0], [0.0, 500.0, 120.0], [0.0, 0.0, 1.0]])
    camera = Camera("a", 320, 240, matrix, np.zeros(5), np.eye(3), np.array([10.0, 20.0, 3000.0]))
    (turned,) = calibration_error(pixels, seed=1).cameras((camera,))
    ahead = (camera.centre + camera.rotation.T @ np.array([0.0, 0.0, 2500.0]))[None]
    moved = project(turned, ahead)[0][0] - project(camera, ahead)[0][0]
    assert np.linalg.norm(moved) == pytest.approx(pixels, rel=1e-3)
    np.testing.assert_allclose(turned.centre, camera.centre, atol=1e-9)
    (same,) = calibration_error(0.0, seed=1).cameras((camera,))
    np.testing.assert_allclose(same.rotation, camera.rotation)
