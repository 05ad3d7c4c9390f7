"""Mirrored poses, checked on points in space: every end where its twin's reflection is."""

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.mirroring import Mirror
from studio.body.model import BodyModel
from studio.foundations.errors import BodyError


def twin(name: str) -> str:
    return {"L": "R", "R": "L"}.get(name[0], name[0]) + name[1:] if name[1:2].isupper() else name


def markers(body: BodyModel, pose: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip((entry.name for entry in body.markers), marker_points(body, pose)[0], strict=True))


def some_pose(body: BodyModel) -> np.ndarray:
    """Bent, leaning and turned; well inside the limits."""
    rng = np.random.default_rng(8)
    pose = body.neutral.copy()
    for at, entry in enumerate(body.parameters):
        if entry.kind == "length":
            pose[at] += rng.uniform(-500.0, 500.0)
        elif np.isfinite(entry.lower):
            pose[at] += 0.3 * rng.uniform(entry.lower - pose[at], entry.upper - pose[at])
        else:
            pose[at] += rng.uniform(-0.3, 0.3)
    return pose


# The third is a person as measured: neck to shoulder differs by 64 mm.
@pytest.mark.parametrize(
    ("name", "uneven"),
    [("human25", 2.0), ("human29", 2.0), ("human31", 80.0), ("human34", 2.0), ("human35", 2.0), ("dog", 2.0)],
)
def test_distances_between_markers_are_their_twins(name: str, uneven: float) -> None:
    """All distances between markers of the mirrored pose are those of their twins: it is a mirror image."""
    body = load_body(name)
    pose = some_pose(body)
    there, here = markers(body, Mirror(body).mirrored(pose)), markers(body, pose)
    names = list(here)
    for one in names:
        for other in names:
            wanted = np.linalg.norm(here[twin(one)] - here[twin(other)])
            assert abs(np.linalg.norm(there[one] - there[other]) - wanted) < uneven, (one, other)
    assert np.linalg.norm(there["LHip"] - there["RHip"] - (here["LHip"] - here["RHip"])) < 120.0, (
        "faces the same"
    )
    again = markers(body, Mirror(body).mirrored(Mirror(body).mirrored(pose)))
    assert max(np.linalg.norm(again[entry] - here[entry]) for entry in names) < uneven


@pytest.mark.parametrize("name", ["human25", "human34"])
def test_turned_round_it_faces_the_other_way_and_covers_the_same_from_the_front(name: str) -> None:
    body = load_body(name)
    pose = some_pose(body)
    there, here = markers(body, Mirror(body).turned_round(pose)), markers(body, pose)
    across = here["LHip"] - here["RHip"]
    assert (there["LHip"] - there["RHip"]) @ across < 0.0
    across[2] = 0.0
    side = across / np.linalg.norm(across)
    for entry in here:
        assert abs((there[entry] - here[twin(entry)]) @ side) < 15.0, entry
        assert abs(there[entry][2] - here[twin(entry)][2]) < 15.0, entry


def test_a_bodys_left_is_a_direction() -> None:
    assert np.linalg.norm(Mirror(load_body("human31")).across) == pytest.approx(1.0)
    np.testing.assert_allclose(Mirror(load_body("human29")).across, [0.0, 1.0, 0.0], atol=1e-6)


def test_arms_without_a_root_are_exchanged() -> None:
    body = load_body("branched_arms6")
    pose = np.array([0.3, -0.2, 0.1, 0.0, 0.4, 0.2])
    there, here = markers(body, Mirror(body).mirrored(pose)), markers(body, pose)
    gap = np.linalg.norm(there["LTip"] - there["Root"]) - np.linalg.norm(here["RTip"] - here["Root"])
    assert abs(gap) < 1e-6


def test_what_no_limb_determines_stays_as_it_was() -> None:
    body = load_body("human29")
    pose, free = some_pose(body), np.flatnonzero(body.bounded_angles)
    fitted, rest = Mirror(body)._fit(pose, np.zeros((0, 2, 3)), free, limbs=np.zeros(0, np.int64))
    np.testing.assert_allclose(fitted, pose, atol=1e-6)
    assert rest == pytest.approx(0.0, abs=1e-9)


def test_a_body_without_sides_has_no_mirror() -> None:
    with pytest.raises(BodyError, match="no left and right"):
        Mirror(load_body("planar_arm4"))


def test_what_leans_aside_leans_to_the_other_side_and_what_bends_forward_stays() -> None:
    body = load_body("human35")
    signs = dict(zip([entry.name for entry in body.parameters], Mirror(body).signs, strict=True))
    about = {"heading", "lean_right", "back_side", "back_twist", "head_turn"}
    assert {name for name, sign in signs.items() if sign < 0.0} == about
