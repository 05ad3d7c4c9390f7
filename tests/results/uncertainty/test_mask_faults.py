"""Faults of masks are measured and given to other frames' masks: same size, same limb."""

import numpy as np
import pytest
from drawn_people import drawn_mask, ring_of_cameras
from planted_runs import person_poses

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.foundations.geometry.projection import project
from studio.results.uncertainty.mask_faults import MaskFaults

BODY = load_body("human31")
CAMERAS = ring_of_cameras(3)
POSES = person_poses("walk", 20, 4, 6)


def masks_of(frame: int) -> dict[str, np.ndarray]:
    return {camera.name: drawn_mask(BODY, POSES[frame], camera) for camera in CAMERAS}


def middle_of(limb: str, frame: int, view: int) -> np.ndarray:
    at = [one.name for one in BODY.drawn].index(limb)
    return project(CAMERAS[view], limb_ends(BODY, POSES[frame])[0, at])[0].mean(axis=0)


def disc(mask: np.ndarray, middle: np.ndarray, radius: float) -> np.ndarray:
    rows, columns = np.indices(mask.shape)
    return (columns - middle[0]) ** 2 + (rows - middle[1]) ** 2 < radius**2


@pytest.fixture
def faults() -> MaskFaults:
    """Frame 0 without fault but a thigh's hole in the second camera and a false area beside a foot in the third."""
    made = MaskFaults(BODY, CAMERAS, POSES)
    for frame in range(len(POSES)):
        masks = masks_of(frame)
        if frame == 0:
            masks["cam2"][disc(masks["cam2"], middle_of("left thigh", 0, 1), 6.0)] = 0
            masks["cam3"][disc(masks["cam3"], middle_of("left shin", 0, 2) + np.array([0.0, 26.0]), 9.0)] = (
                255
            )
        if frame == 2:
            masks["cam1"][:] = 0
        made.measure(frame, masks)
    return made


def test_a_hole_follows_its_limb_into_another_frame(faults: MaskFaults) -> None:
    clean = masks_of(1)["cam2"]
    spoilt = faults.given_to(clean, 1, 1, 0)
    lost = (clean > 0) & (spoilt == 0)
    assert not ((spoilt > 0) & (clean == 0)).any()
    assert lost.sum() == pytest.approx(np.pi * 36.0, rel=0.4)
    rows, columns = np.nonzero(lost)
    assert np.hypot(*(np.array([columns.mean(), rows.mean()]) - middle_of("left thigh", 1, 1))) < 4.0


def test_a_false_area_is_set_beside_its_limb(faults: MaskFaults) -> None:
    clean = masks_of(3)["cam3"]
    spoilt = faults.given_to(clean, 2, 3, 0)
    false = (spoilt > 0) & (clean == 0)
    assert false.sum() > 60
    assert not ((clean > 0) & (spoilt == 0)).any()


def test_masks_without_faults_give_none(faults: MaskFaults) -> None:
    clean = masks_of(1)
    for view, camera in enumerate(CAMERAS):
        assert np.array_equal(faults.given_to(clean[camera.name], view, 1, 3), clean[camera.name])
        if camera.name == "cam1":
            assert np.array_equal(faults.given_to(clean["cam1"], view, 1, 0), clean["cam1"])


def test_a_mask_that_was_lost_is_lost(faults: MaskFaults) -> None:
    assert not faults.given_to(masks_of(1)["cam1"], 0, 1, 2).any()


def test_how_much_is_wrong_is_said_by_camera(faults: MaskFaults) -> None:
    one, two, three = faults.shares()
    assert (one.camera, one.empty, one.holes) == ("cam1", 0.25, 0.0)
    assert two.holes > 0.0
    assert (two.false_areas, two.touched) == (0.0, 0.25)
    assert three.false_areas > 0.0
    assert three.holes == 0.0
