"""A wrong size is read off a person only where their shape proves that they stand."""

import dataclasses

import numpy as np
import pytest
from drawn_people import ring_of_cameras
from numpy.typing import NDArray
from posed_people import masks_of, posed

from studio.footage.calibration.silhouette_checks import silhouette_findings
from studio.foundations.geometry.camera import Camera
from studio.results.drawing_footage.cameras import corner_rig
from studio.results.drawing_footage.person import skeleton_of_height

HEIGHT = 1750.0
RIGS = {
    "corners": corner_rig((640, 480), np.random.default_rng(2)),
    "three": ring_of_cameras(3, 640, 480, distance=4500.0),
    "five": ring_of_cameras(5, 640, 480, distance=4500.0),
}
POSTURES = {
    "bowing": {"bend": 45.0},
    "bowing low": {"bend": 80.0},
    "leaning back": {"bend": -40.0},
    "crouching": {"bend": 20.0, "thighs": (60.0, 60.0), "knees": (110.0, 110.0)},
    "crouching upright": {"thighs": (52.0, 52.0), "knees": (104.0, 104.0)},
    "squatting": {"bend": 30.0, "thighs": (100.0, 100.0), "knees": (140.0, 140.0)},
    "kneeling": {"knees": (90.0, 90.0)},
    "sitting": {"thighs": (90.0, 90.0), "knees": (90.0, 90.0)},
    "lunging": {"thighs": (60.0, -45.0), "knees": (70.0, 10.0)},
    "kicking": {"thighs": (80.0, 0.0), "bend": -25.0},
    "arms raised": {"arms": (175.0, 0.0)},
    "arms raised apart": {"arms": (160.0, 15.0)},
    "leaping": {"over_floor": 350.0, "thighs": (30.0, -30.0), "knees": (60.0, 80.0)},
    "leaping, arms raised": {"over_floor": 300.0, "arms": (175.0, 0.0)},
}

Masks = dict[int, dict[str, NDArray[np.uint8]]]


def masks(rig: str, posture: dict, frames: int = 4, stout: float = 1.0, seed: int = 1) -> Masks:
    """Frames of one posture, each with another heading and place."""
    rng = np.random.default_rng(seed)
    skeleton = skeleton_of_height(HEIGHT, rng)
    return {frame: masks_of(posed(skeleton, rng, **posture), RIGS[rig], stout) for frame in range(frames)}


def of_size(rig: str, factor: float) -> tuple[Camera, ...]:
    """The rig as a board of another size would have given it."""
    return tuple(dataclasses.replace(camera, translation=factor * camera.translation) for camera in RIGS[rig])


def sizes_named(cameras: tuple[Camera, ...], seen: Masks, height: float | None = HEIGHT) -> tuple[str, ...]:
    """Codes of the findings."""
    return tuple(finding.code for finding in silhouette_findings(cameras, seen, height))


@pytest.mark.parametrize("posture", POSTURES.values(), ids=POSTURES)
@pytest.mark.parametrize("rig", RIGS)
def test_no_finding_for_a_right_calibration_without_a_standing_person(rig: str, posture: dict) -> None:
    assert sizes_named(RIGS[rig], masks(rig, posture, stout=1.2)) == ()


@pytest.mark.parametrize("factor", [0.7, 1.35])
@pytest.mark.parametrize("rig", RIGS)
def test_a_standing_person_shows_a_wrong_and_a_right_size(rig: str, factor: float) -> None:
    standing = masks(rig, {"arms": (5.0, 10.0)}, frames=5, stout=1.2)
    assert sizes_named(RIGS[rig], standing) == ()
    (finding,) = silhouette_findings(of_size(rig, factor), standing, HEIGHT)
    assert finding.code == "square-size"
    assert "standing person" in finding.message
    assert "Check the height" in finding.remedy
    named = float(finding.remedy.rsplit(" ", 1)[1].rstrip("."))
    assert named == pytest.approx(factor, rel=0.07)


def test_a_few_frames_upright_are_enough_among_others() -> None:
    seen = masks("corners", POSTURES["bowing"], frames=3) | {
        10 + frame: views for frame, views in masks("corners", {}, frames=4, seed=4, stout=1.2).items()
    }
    assert sizes_named(RIGS["corners"], seen) == ()
    assert sizes_named(of_size("corners", 0.7), seen) == ("square-size",)


def test_who_is_tall_enough_in_any_frame_is_not_too_small() -> None:
    """Somebody who stands with a wrong size, and another frame in which the height given is reached."""
    seen = masks("corners", {}, frames=4, stout=1.2)
    reached = masks("corners", POSTURES["arms raised"], frames=1, seed=6)
    assert sizes_named(of_size("corners", 0.78), seen) == ("square-size",)
    assert sizes_named(of_size("corners", 0.78), seen | {9: reached[0]}) == ()


def test_without_feet_on_the_floor_there_is_no_finding() -> None:
    """The legs behind a table: the mask ends at the knees in every view."""
    whole = masks("five", {}, frames=4, stout=1.2)
    cut = {
        frame: {name: _without_lower(mask, 0.3) for name, mask in views.items()}
        for frame, views in whole.items()
    }
    assert sizes_named(RIGS["five"], cut) == ()


@pytest.mark.parametrize("posture", ["crouching", "bowing low", "arms raised"])
def test_a_wrong_unit_is_named_in_any_posture(posture: str) -> None:
    seen = masks("corners", POSTURES[posture])
    assert sizes_named(of_size("corners", 0.01), seen) == ("scale",)
    assert sizes_named(of_size("corners", 1000.0), seen, None) == ("scale",)


def test_only_a_giant_or_a_dwarf_stands_out_where_no_height_is_given() -> None:
    standing = masks("corners", {}, stout=1.2)
    assert sizes_named(of_size("corners", 1.3), standing, None) == ()
    assert sizes_named(of_size("corners", 1.7), standing, None) == ("square-size",)


def _without_lower(mask: NDArray[np.uint8], share: float) -> NDArray[np.uint8]:
    rows = np.flatnonzero(mask.any(axis=1))
    found = mask.copy()
    found[round(float(rows[-1] - share * len(rows))) :] = 0
    return found
