"""Mirrored poses, checked on points in space: every end where its twin's reflection is."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from studio.body.catalogue import load_body
from studio.body.dragging import Dragger, root_joint
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.body.mirroring import Mirror, has_sides, name_twins
from studio.body.model import BodyModel
from studio.body.reader import parse_body
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


def test_bodies_with_a_left_and_a_right_have_sides() -> None:
    assert all(has_sides(load_body(name)) for name in ("human31", "dog", "mouse", "branched_arms6"))
    assert not has_sides(load_body("planar_arm4"))
    assert not Mirror(load_body("branched_arms6")).turns
    assert Mirror(load_body("human29")).turns


TWO = """
title = "Two rods"
parameters = [{{ name = "a", kind = "angle", limb = "x", max_step = 1 }}]
joints = [{{ name = "hub", parent = "world", type = "hinge", sequence = [{{ turn = "z", by = "a" }}] }}]
limbs = [{{ name = "left rod", joint = "hub", length = 5, radius_start = 1, radius_end = 1, side = "{}" }},
         {{ name = "{} rod", joint = "hub", length = -5, radius_start = 1, radius_end = 1, side = "right" }}]
"""


@pytest.mark.parametrize(
    ("side", "other", "are_sides"),
    [("left", "right", True), ("middle", "right", False), ("left", "other", False)],
)
def test_sides_are_limbs_that_say_so_and_have_a_twin(side: str, other: str, are_sides: bool) -> None:
    assert has_sides(parse_body(TWO.format(side, other), "two", "two.toml")) is are_sides


def test_names_of_twins() -> None:
    names = [
        "left arm",
        "right arm",
        "head",
        "right leg",
        "left ear",
        "right ear of right",
        "left ear of right",
    ]
    assert name_twins(names).tolist() == [1, 0, 2, 3, 4, 6, 5]


@pytest.mark.parametrize("name", ["human29", "human34", "dog", "mouse31", "branched_arms6"])
def test_each_parameter_alone_is_mirrored_on_its_twin(name: str) -> None:
    """A person at rest whose one joint is bent: all points are the mirror image, through the middle of the sides."""
    body = load_body(name)
    mirror = Mirror(body)
    rest, root = body.neutral, root_joint(body)
    for at, entry in enumerate(body.parameters):
        if root >= 0 and at in body.joints[root].parameters:
            continue
        step = 0.1 if entry.upper - rest[at] > 0.1 else -0.1
        pose = rest + step * (np.arange(len(rest)) == at)
        image = rest + mirror.signs * (pose - rest)[mirror.twins]
        here, there = limb_ends(body, pose)[0], limb_ends(body, image)[0][mirror.limb_twins]
        middle = limb_ends(body, rest)[0].mean(axis=(0, 1))
        reflected = here - 2.0 * ((here - middle) @ mirror.across)[..., None] * mirror.across
        np.testing.assert_allclose(there, reflected, atol=1.0, err_msg=entry.name)


def lying(body: BodyModel, tilt: float) -> np.ndarray:
    """Some pose, rolled to its side by degrees: the body's left points up as far."""
    dragger = Dragger(body)
    pose = some_pose(body)
    frame = dragger.root_frame(body.neutral)
    turn = Rotation.from_euler("x", tilt, degrees=True).as_matrix()
    return dragger.with_root(pose, np.column_stack([turn @ frame[:, :3], frame[:, 3]]))


@pytest.mark.parametrize(("tilt", "is_level"), [(70.0, True), (75.0, False), (90.0, False), (-30.0, True)])
def test_a_bodys_left_is_level_unless_it_lies_on_its_side(tilt: float, is_level: bool) -> None:
    body = load_body("human29")
    own = np.array([0.0, np.cos(np.radians(tilt)), np.sin(np.radians(tilt))])
    wanted = np.array([0.0, 1.0, 0.0]) if is_level else own
    np.testing.assert_allclose(Mirror(body).sideways(lying(body, tilt)), wanted, atol=1e-4)


def test_who_lies_on_a_side_is_turned_round_along_x() -> None:
    """All distances are the twins', and every point is as high and as far aside as its twin was."""
    body = load_body("human29")
    pose = lying(body, 90.0)
    there, here = limb_ends(body, Mirror(body).turned_round(pose))[0], limb_ends(body, pose)[0]
    twins = Mirror(body).limb_twins
    middle = here.reshape(-1, 3).mean(axis=0)
    wanted = here[twins] * [-1.0, 1.0, 1.0] + 2.0 * middle * [1.0, 0.0, 0.0]
    np.testing.assert_allclose(there, wanted, atol=3.0)


def test_mirrored_points_lie_beyond_the_plane_through_the_middle() -> None:
    body = load_body("human34")
    pose = some_pose(body)
    mirror = Mirror(body)
    here, there = limb_ends(body, pose)[0], limb_ends(body, mirror.mirrored(pose))[0]
    normal = mirror.sideways(pose)
    middle = here.reshape(-1, 3).mean(axis=0)
    wanted = here[mirror.limb_twins]
    wanted = wanted - 2.0 * ((wanted - middle) @ normal)[..., None] * normal
    np.testing.assert_allclose(there, wanted, atol=3.0)


def test_an_uneven_body_is_fitted_as_a_whole_and_an_even_one_by_its_root_alone() -> None:
    """The mirror image of human31 is off by less than its sides differ when every joint may help."""
    body = load_body("human31")
    mirror, pose = Mirror(body), some_pose(body)
    target = mirror._reflected(limb_ends(body, pose)[0], mirror.sideways(pose))
    whole, root = mirror._place_root(pose, target, whole=True), mirror.mirrored(pose)
    for found in (whole, root):
        assert np.abs(found - np.clip(found, body.lower, body.upper)).max() < 1e-9
    misses = [
        np.sqrt(((limb_ends(body, one)[0] - target) ** 2).sum(axis=(1, 2)).mean()) for one in (whole, root)
    ]
    exchanged = mirror._exchanged(pose)
    assert np.abs(root - exchanged)[6:].max() > 1e-3, "the joints helped"
    assert max(misses) < 40.0
    even = load_body("human29")
    pose = some_pose(even)
    exchanged = Mirror(even)._exchanged(pose)
    assert np.abs(Mirror(even).mirrored(pose) - exchanged)[6:].max() < 1e-12


def test_limbs_change_places_by_their_own_joints_and_all_else_stays() -> None:
    body = load_body("human34")
    mirror, pose = Mirror(body), some_pose(body)
    own = np.array([at for at, entry in enumerate(body.parameters) if entry.limb.endswith("leg")])
    limbs = np.array(
        [at for at, limb in enumerate(body.drawn) if "thigh" in limb.name or "shin" in limb.name]
    )
    found = mirror.exchanged(pose, own, limbs)
    others = np.setdiff1d(np.arange(len(pose)), own)
    np.testing.assert_array_equal(found[others], pose[others])
    target = limb_ends(body, pose)[0][mirror.limb_twins[limbs]]

    def miss(one: np.ndarray) -> float:
        return float(np.linalg.norm(limb_ends(body, one)[0][limbs] - target))

    assert miss(found) < 0.8 * miss(pose)
    assert is_least(body, lambda one: (limb_ends(body, one)[0][limbs] - target).ravel(), found, own)


def test_a_root_is_sought_from_the_pose_and_from_half_a_turn_about_each_of_its_axes() -> None:
    body = load_body("human31")
    pose = some_pose(body)
    begun = np.array(Mirror(body)._beginnings(pose)) - pose
    wanted = np.zeros((4, len(pose)))
    turns = [at for at in body.joints[root_joint(body)].parameters if body.angles[at]]
    wanted[[1, 2, 3], turns] = np.pi
    np.testing.assert_allclose(begun, wanted, atol=1e-9)
    fitted, rest = Mirror(body)._fit(pose, limb_ends(body, pose)[0], np.zeros(0, np.int64))
    assert rest == 0.0
    np.testing.assert_array_equal(fitted, pose)


def test_facing_the_other_way_every_limb_is_near_where_its_twin_was() -> None:
    body = load_body("human34")
    mirror, pose = Mirror(body), some_pose(body)
    found = mirror.about_face(pose)
    here, there = markers(body, pose), markers(body, found)
    assert (here["LHip"] - here["RHip"]) @ (there["LHip"] - there["RHip"]) < 0.0
    assert np.abs(found - np.clip(found, body.lower, body.upper)).max() < 1e-9
    away = limb_ends(body, found)[0] - limb_ends(body, pose)[0][mirror.limb_twins]
    assert np.linalg.norm(away, axis=-1).mean() < 120.0


def is_least(body: BodyModel, offsets: Callable, pose: np.ndarray, free: np.ndarray) -> bool:
    """Whether no single free parameter, changed a little within its limits, lessens the squares' sum."""
    least = float((offsets(pose) ** 2).sum())
    for at in free:
        for step in (-0.02, 0.02):
            other = pose.copy()
            other[at] = np.clip(other[at] + step, body.lower[at], body.upper[at])
            if float((offsets(other) ** 2).sum()) < least - 1e-3 * max(least, 1.0):
                return False
    return True


def test_a_fit_is_pulled_to_where_it_begins_by_a_fiftieth_of_a_millimetre_a_radian() -> None:
    """Against scipy's own least squares with its own slopes; 400 mm of a length count as a radian."""
    body = load_body("human25")
    mirror, pose = Mirror(body), some_pose(body)
    # Of a single short limb's end, so that the pull decides most.
    limb, free = np.array([len(body.drawn) - 1]), np.arange(6)
    target = limb_ends(body, pose)[0][limb] + 0.3
    found, rest = mirror._fit(pose, target, free, limb)
    scale = np.where(body.angles[free], 1.0, 400.0)

    def residuals(values: np.ndarray) -> np.ndarray:
        other = pose.copy()
        other[free] = values * scale
        return np.concatenate(
            [(limb_ends(body, other)[0][limb] - target).ravel(), 0.02 * (values - pose[free] / scale)]
        )

    answer = least_squares(residuals, pose[free] / scale, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    np.testing.assert_allclose(found[free] / scale, answer.x, atol=1e-5)
    assert rest == pytest.approx(answer.cost, rel=1e-3, abs=1e-9)


def test_a_body_without_sides_has_no_mirror() -> None:
    with pytest.raises(BodyError, match="no left and right"):
        Mirror(load_body("planar_arm4"))


def test_what_leans_aside_leans_to_the_other_side_and_what_bends_forward_stays() -> None:
    body = load_body("human35")
    signs = dict(zip([entry.name for entry in body.parameters], Mirror(body).signs, strict=True))
    about = {"heading", "lean_right", "back_side", "back_twist", "head_turn"}
    assert {name for name, sign in signs.items() if sign < 0.0} == about
