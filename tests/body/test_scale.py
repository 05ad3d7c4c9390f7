"""The size of a body beside a person: a person an eighth as large, seen by cameras an eighth as far, is a person."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from studio.body.catalogue import list_bodies, load_body
from studio.body.dimensions import follows_height, with_dimensions, with_usual_feet
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.reader import parse_body
from studio.body.scale import scale_of
from studio.evidence.distance_maps import silhouette_distances
from studio.evidence.volume.body_space import space_of
from studio.footage.calibration.silhouette_checks import stature_findings
from studio.footage.calibration.standing import Posture
from studio.foundations.errors import BodyError
from studio.foundations.geometry.camera import Camera
from studio.results.evaluation.errors import lost_mm
from studio.runs.jumps import jumps_of
from studio.runs.search_space import default_sigma, search_space
from studio.runs.setup.initialising import hull_of
from studio.runs.tracks import Track
from studio.search.trackers.agreement import Agreement
from studio.search.trackers.initialisation import first_noise
from studio.search.trackers.refinement import RefinementSettings, Refiner
from tests.drawn_people import drawn_evidence, ring_of_cameras

EIGHTH = 0.125
PERSON = load_body("human31")
CAMERAS = ring_of_cameras(4)
LENGTHS = np.array([entry.kind == "length" for entry in PERSON.parameters])


def shrunk(body: BodyModel, factor: float = EIGHTH) -> BodyModel:
    entries = body.definition.dimensions
    lengths = {key: factor * value for key, value in body.dimensions.items() if entries[key].ratio is None}
    return with_dimensions(body, lengths)


def nearer(camera: Camera) -> Camera:
    return dataclasses.replace(camera, translation=EIGHTH * camera.translation)


def smaller(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(LENGTHS, EIGHTH * poses, poses)


SMALL, NEAR = shrunk(PERSON), tuple(map(nearer, CAMERAS))


@pytest.mark.parametrize(
    "name", [name for name in list_bodies() if name not in ("mouse", "mouse31", "hand25", "fly48")]
)
def test_bodies_of_about_a_persons_size_keep_what_was_measured_on_people(name: str) -> None:
    assert scale_of(load_body(name)) == 1.0


def test_a_mouse_and_a_small_person_are_an_eighth() -> None:
    assert scale_of(load_body("mouse")) == scale_of(SMALL) == EIGHTH
    assert scale_of(shrunk(load_body("mouse"), 8.0)) == 1.0
    assert lost_mm(SMALL) == EIGHTH * lost_mm(PERSON)


@pytest.mark.parametrize(
    ("longest", "scale"),
    [
        (1700.0, 1.0),
        (851.0, 1.0),
        (850.0, 0.5),
        (3399.0, 1.0),
        (3400.0, 2.0),
        (610.0, 0.5),
        (590.0, 0.25),
        (0.6, 2.0**-11),
    ],
)
def test_a_scale_is_the_nearest_power_of_two_of_the_longest_side(longest: float, scale: float) -> None:
    text = ROD.replace("LONG", f"{longest}").replace("SHORT", f"{0.7 * longest}")
    assert scale_of(parse_body(text, "rod", "rod.toml")) == scale


ROD = """
title = "Two rods"
parameters = [{ name = "a", kind = "angle", limb = "x", max_step = 1 }]
joints = [
    { name = "one", parent = "world", type = "hinge", sequence = [{ turn = "z", by = "a" }] },
    { name = "two", parent = "one", type = "fixed", sequence = [{ turn = "y", by = 90 }] },
]
limbs = [{ name = "one", joint = "one", length = LONG, radius_start = 1, radius_end = 1 },
         { name = "two", joint = "two", length = SHORT, radius_start = 1, radius_end = 1 }]
"""


def test_a_body_of_which_nothing_is_drawn_has_a_persons_scale() -> None:
    assert scale_of(parse_body(ROD.replace("LONG", "0").replace("SHORT", "0"), "rod", "rod.toml")) == 1.0


def test_usual_feet_are_of_a_share_of_the_height_where_a_file_has_none() -> None:
    plain = load_body("human31")
    shod = with_usual_feet(plain)
    height = float(np.ptp(limb_ends(plain, plain.neutral)[0, ..., 2]))
    share = plain.definition.dimensions["left_foot_length"].of_height
    for name, value in plain.dimensions.items():
        wanted = share * height if name in ("left_foot_length", "right_foot_length") else value
        assert shod.dimensions[name] == pytest.approx(wanted), name
    assert with_usual_feet(shod) is shod
    made = dataclasses.replace(plain, definition=None)
    assert with_usual_feet(made) is made


def test_a_body_follows_a_height_if_any_length_does() -> None:
    person = load_body("human31")
    assert follows_height(person)
    assert not follows_height(load_body("planar_arm4"))
    assert not follows_height(dataclasses.replace(person, definition=None))
    with pytest.raises(BodyError, match="not read from a file"):
        with_dimensions(dataclasses.replace(person, definition=None), {})
    absent = with_dimensions(person, {"left_thigh_length": 0.0})
    assert absent.dimensions["left_thigh_length"] == 0.0


def test_a_small_person_is_refined_and_judged_like_a_large_one() -> None:
    true = PERSON.neutral
    evidence = drawn_evidence(PERSON, true, CAMERAS)
    silhouettes = silhouette_distances(evidence)
    start = true + np.where(LENGTHS, 25.0, 0.06) * np.random.default_rng(1).standard_normal(len(true))
    found: list[tuple[NDArray[np.float64], dict[str, float]]] = []
    for body, cameras, pose in ((PERSON, CAMERAS, start), (SMALL, NEAR, smaller(start))):
        refined = Refiner(body, cameras, RefinementSettings()).refine(pose, silhouettes).pose
        found.append((refined, Agreement(body, cameras).of(pose, silhouettes).shares()))
    np.testing.assert_allclose(found[1][0], smaller(found[0][0]), atol=1e-3)
    assert found[1][1] == pytest.approx(found[0][1], abs=1e-3)
    assert max(found[0][1].values()) > 0.01


def test_a_small_person_is_sought_in_a_small_space() -> None:
    large, small = space_of(PERSON, CAMERAS), space_of(SMALL, NEAR)
    np.testing.assert_allclose(small.lower, EIGHTH * large.lower)
    np.testing.assert_allclose(small.upper, EIGHTH * large.upper)
    alone = hull_of(PERSON, CAMERAS[:1], drawn_evidence(PERSON, None, CAMERAS[:1]))[1]
    near = hull_of(SMALL, NEAR[:1], drawn_evidence(SMALL, None, NEAR[:1]))[1]
    np.testing.assert_allclose(near.upper, EIGHTH * alone.upper)
    one, other = (search_space(body, default_sigma(body, 30.0)) for body in (PERSON, SMALL))
    place = [name.startswith("pelvis_") for name in one.names] & LENGTHS
    np.testing.assert_allclose(first_noise(other)[place], EIGHTH * first_noise(one)[place])


def test_a_leap_of_a_small_person_is_a_leap() -> None:
    noise = np.random.default_rng(3).normal(0.0, 0.001, (80, len(PERSON.parameters)))
    poses = np.where(LENGTHS, 0.0, noise) + PERSON.neutral
    poses[40:, LENGTHS] += 60.0
    tracks = [
        Track("raw", np.arange(80), own, np.ones(80), ("tracked",) * 80) for own in (poses, smaller(poses))
    ]
    large, small = jumps_of(PERSON, tracks[0]), jumps_of(SMALL, tracks[1])
    assert [jump.frame for jump in large] == [40]
    assert [jump.frame for jump in small] == [40]


def test_silhouettes_of_a_mouse_are_no_wrong_unit() -> None:
    seen = [Posture(60.0, 170.0, 0.2, 0.9, 0.3, 0.5, 0.1, 0.4, 0.0)] * 5
    assert not stature_findings(seen, scale=scale_of(load_body("mouse")))
    assert stature_findings(seen)
