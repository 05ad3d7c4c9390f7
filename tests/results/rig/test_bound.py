"""The bound on errors, where what it has to say is known: which direction a camera tells, what hides a limb, which
place is best.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from drawn_people import ring_of_cameras
from planted_runs import person_poses

from studio.body.catalogue import load_body
from studio.foundations.errors import RunError
from studio.foundations.geometry.camera import Camera
from studio.results.rig.bound import LinearMotion, errors_of, linear_motion, total, view_information
from studio.results.rig.places import camera_at, choose, grid_of, parsed_place

BODY = load_body("human31")
NAMES = [marker.name for marker in BODY.markers]
SUBJECT = (0.0, 0.0, 950.0)
PRESENT = ring_of_cameras(4)


@pytest.fixture(scope="module")
def motion() -> LinearMotion:
    return linear_motion(BODY, person_poses("walk", 30, 8, 2), 4)


def around(degrees: float, distance: float = 3500.0) -> Camera:
    """A camera on a circle about the subject."""
    angle = np.radians(degrees)
    place = (distance * float(np.cos(angle)), distance * float(np.sin(angle)), 1500.0)
    return camera_at(f"at{degrees:.0f}", place, SUBJECT, PRESENT, "cam1").camera


def errors_by(motion: LinearMotion, *cameras: Camera) -> np.ndarray:
    return errors_of(motion, total([view_information(motion, one) for one in cameras], motion))


def test_slopes_are_those_of_the_body(motion: LinearMotion) -> None:
    # A body that moves as a whole by 1 mm moves each point by as much.
    x = [entry.kind for entry in BODY.parameters].index("length")
    moved = np.linalg.norm(motion.point_slopes[..., x], axis=2)
    assert moved == pytest.approx(1.0, abs=1e-6)
    assert np.linalg.norm(motion.end_slopes[..., x], axis=3) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("joint", ["Head", "Neck", "Hip"])
def test_a_joint_seen_side_by_side_gains_most_from_a_camera_at_right_angles(
    motion: LinearMotion, joint: str
) -> None:
    beside, at = (around(-5.0), around(5.0)), NAMES.index(joint)
    with_third = {
        degrees: errors_by(motion, *beside, around(degrees))[at] for degrees in (0, 30, 60, 90, 120, 150, 180)
    }
    assert min(with_third, key=lambda one: with_third[one]) == 90
    now = errors_by(motion, *beside)[at]
    assert with_third[90] < 0.5 * now
    # From where they stand, or from across, a camera tells hardly anything new.
    assert min(with_third[0], with_third[180]) > 0.75 * now


def test_one_camera_tells_least_along_its_view(motion: LinearMotion) -> None:
    view = view_information(motion, around(0.0))
    covariance = np.linalg.inv(view.information + np.diag(motion.known))
    slopes = motion.point_slopes[:, NAMES.index("Hip")]
    off = np.einsum("fid,fde,fje->fij", slopes, covariance, slopes).mean(axis=0)
    towards = np.array([3500.0, 0.0, 550.0]) / np.hypot(3500.0, 550.0)
    across = np.array([0.0, 1.0, 0.0])
    assert towards @ off @ towards > 20.0 * (across @ off @ across)


def test_a_limb_that_one_camera_alone_has_in_its_picture_is_lost_with_it(motion: LinearMotion) -> None:
    legs_only = tuple(
        replace(one, matrix=one.matrix - np.array([[0, 0, 0], [0, 0, one.height * 0.42], [0, 0, 0.0]]))
        for one in PRESENT[:3]
    )
    whole = PRESENT[3]
    assert view_information(motion, whole).sees == 1.0
    assert all(view_information(motion, one).sees < 0.8 for one in legs_only)
    rigs = {
        left: [one for one in (*legs_only, whole) if one.name != left]
        for left in ("cam1", "cam2", "cam3", "cam4")
    }
    errors = {left: errors_by(motion, *rig) for left, rig in rigs.items()}
    assert max(errors, key=lambda left: errors[left].mean()) == "cam4"
    head, ankle = NAMES.index("Head"), NAMES.index("LAnkle")
    now = errors_by(motion, *legs_only, whole)
    assert errors["cam4"][head] > 1.8 * now[head]
    assert errors["cam4"][ankle] < 1.5 * now[ankle]


def test_a_limb_that_another_covers_tells_nothing_there() -> None:
    standing = linear_motion(BODY, BODY.neutral[None] + 0.0)
    elbow = [
        at
        for at, entry in enumerate(BODY.parameters)
        if entry.limb.startswith("left forearm") or "left_elbow" in entry.name
    ]
    if not elbow:
        elbow = [at for at, entry in enumerate(BODY.parameters) if "elbow" in entry.name.lower()]
    assert elbow
    side = {
        one: np.diagonal(view_information(standing, around(one)).information[0])[elbow].sum()
        for one in (0, 90, 270)
    }
    # From the side of the other arm the trunk is in front of it; from the front both are seen.
    assert max(side.values()) == side[0]


def test_farther_away_a_camera_tells_less(motion: LinearMotion) -> None:
    near = view_information(motion, around(0.0)).information
    camera = around(0.0, 9000.0)
    far = view_information(motion, camera).information
    assert np.trace(far.sum(axis=0)) < np.trace(near.sum(axis=0))
    behind = replace(camera, rotation=camera.rotation * [[-1], [1], [-1]])
    behind = replace(behind, translation=-behind.rotation @ camera.centre)
    assert view_information(motion, behind).sees == 0.0
    assert not view_information(motion, behind).information.any()


def test_the_best_pair_is_nearly_that_of_all_pairs(motion: LinearMotion) -> None:
    candidates = [around(degrees) for degrees in range(0, 360, 40)]
    chosen = choose(
        motion,
        [],
        [view_information(motion, PRESENT[0])],
        candidates,
        2,
        lambda errors: errors.mean(axis=-1),
        lambda *_: None,
    )
    pairs = {
        pair: errors_by(motion, *(candidates[at] for at in pair)).mean()
        for pair in itertools.combinations(range(len(candidates)), 2)
    }
    assert pairs[tuple(sorted(chosen.chosen))] <= 1.02 * min(pairs.values())
    assert len(set(chosen.chosen)) == 2
    assert chosen.added.shape == (len(candidates),)
    with pytest.raises(RunError, match="Only 9 of 9 places"):
        choose(motion, [], [], candidates, 10, lambda errors: errors.mean(axis=-1), lambda *_: None)


def test_a_grid_takes_the_room_at_each_height_and_keeps_away_from_the_subject() -> None:
    path = np.array([SUBJECT])
    places, spacing = grid_of(PRESENT, path, (), None, 1.0)
    assert {place[2] for place in places} == {2000.0}
    distances = [np.linalg.norm(np.subtract(place, SUBJECT)) for place in places]
    assert min(distances) >= 0.75 * np.linalg.norm(PRESENT[0].centre - SUBJECT) - 1e-6
    assert max(abs(value) for place in places for value in place[:2]) <= 3500.0
    finer, _ = grid_of(PRESENT, path, (1000.0, 2500.0), 0.7 * spacing, 1.0)
    assert {place[2] for place in finer} == {1000.0, 2500.0}
    assert len(finer) > 3 * len(places)
    with pytest.raises(RunError, match="at most 600 are looked at"):
        grid_of(PRESENT, path, (), 50.0, 1.0)
    for height in (float("nan"), float("inf"), -1e9):
        with pytest.raises(RunError, match="is no height"):
            grid_of(PRESENT, path, (height,), None, 1.0)


def test_new_cameras_look_at_the_subject_with_a_present_one_s_lens() -> None:
    made = camera_at("new", (0.0, 4000.0, 1200.0), SUBJECT, PRESENT)
    ahead = np.array(SUBJECT) - made.camera.centre
    assert made.camera.rotation[2] == pytest.approx(ahead / np.linalg.norm(ahead))
    assert made.camera.centre == pytest.approx([0.0, 4000.0, 1200.0])
    # The one that stands nearest, at 0.4 + π/2.
    assert made.like == "cam2"
    assert camera_at("new", (0.0, 4000.0, 1200.0), SUBJECT, PRESENT, "cam4").like == "cam4"
    upright = replace(PRESENT[0], quarter_turns=1)
    turned = camera_at("new", (0.0, 4000.0, 1200.0), SUBJECT, [upright]).camera
    # Shown after a clockwise quarter turn, the picture's right side is its bottom.
    assert turned.rotation[0] == pytest.approx(made.camera.rotation[1])


@pytest.mark.parametrize("text", ["", "1,2", "1,2,3,4", "a,b,c", "1,2,nan", "1,2,inf", "1,2,-1e9"])
def test_what_is_no_place_is_refused(text: str) -> None:
    with pytest.raises(RunError, match="is no place"):
        parsed_place(text)
    assert parsed_place("1, -2.5,3e3") == (1.0, -2.5, 3000.0)
