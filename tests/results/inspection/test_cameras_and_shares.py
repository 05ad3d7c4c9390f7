"""Cameras that contradict the others; log-weights as sums over cameras and terms, for every weighting."""

import dataclasses

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras
from planted_runs import cut_masks

from studio.body.catalogue import load_body
from studio.evidence.frame_evidence import FrameEvidence
from studio.results.drawing_footage.damage import turned_camera
from studio.results.inspection.camera_checks import fault_of, view_fits
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.problem import BaseFrameLikelihood

BODY, CAMERAS = load_body("human31"), ring_of_cameras(4)


@pytest.fixture(scope="module")
def evidence() -> FrameEvidence:
    return drawn_evidence(BODY, BODY.neutral, CAMERAS)


def test_sound_views_contradict_nothing(evidence: FrameEvidence) -> None:
    fits = view_fits(BODY, CAMERAS, evidence, BODY.neutral)
    assert all(fit.overlap > 0.8 and fit.distance < 4.0 for fit in fits)
    assert fault_of(fits) is None
    assert fault_of(fits[:2]) is None


@pytest.mark.parametrize(("direction", "pixels"), [(1.5, 45.0), (0.0, 25.0), (4.0, 35.0)])
def test_a_turned_camera_is_a_wrong_calibration_by_so_many_pixels(
    evidence: FrameEvidence, direction: float, pixels: float
) -> None:
    cameras = (*CAMERAS[:2], turned_camera(CAMERAS[2], pixels, direction), CAMERAS[3])
    found = fault_of(view_fits(BODY, cameras, evidence, BODY.neutral))
    assert (found.kind, found.fit.camera) == ("calibration", "cam3")
    assert found.fit.distance == pytest.approx(pixels, abs=5.0)


def test_cut_masks_are_bad_masks(evidence: FrameEvidence) -> None:
    damage = cut_masks("cam2")
    views = tuple(
        dataclasses.replace(view, mask=damage(0, view.camera, view.mask)) for view in evidence.views
    )
    found = fault_of(view_fits(BODY, CAMERAS, FrameEvidence(0, views), BODY.neutral))
    assert (found.kind, found.fit.camera) == ("masks", "cam2")
    empty = tuple(
        dataclasses.replace(view, mask=view.mask * (view.camera != "cam4")) for view in evidence.views
    )
    found = fault_of(view_fits(BODY, CAMERAS, FrameEvidence(0, empty), BODY.neutral))
    assert (found.kind, found.fit.camera, found.fit.best) == ("masks", "cam4", 0.0)


@pytest.mark.parametrize("name", WEIGHTINGS)
def test_shares_add_up_to_the_log_weight(evidence: FrameEvidence, name: str) -> None:
    weighting = WEIGHTINGS[name]
    problem = weighting.prepare(BODY, CAMERAS, weighting.settings_type()).problem(evidence)
    assert isinstance(problem, BaseFrameLikelihood)
    rng = np.random.default_rng(1)
    poses = BODY.neutral + 0.05 * rng.standard_normal((5, len(BODY.parameters)))
    shares = problem.shares(poses)
    assert shares.values.shape == (5, len(shares.cameras), len(shares.terms))
    assert np.allclose(shares.values.sum(axis=(1, 2)), problem.log_likelihood(poses), atol=1e-9)
