"""The network that finds a person and cuts him out: the vendored file, and what it sees in rendered pictures."""

import hashlib
from importlib import resources

import numpy as np
import pytest
from rendered_people import Rendered, overlap, rendered_walk

from studio.evidence.person_network import MODEL, Crop, Detection, PersonNetwork


@pytest.fixture(scope="module")
def network() -> PersonNetwork:
    return PersonNetwork()


@pytest.fixture(scope="module")
def walk() -> Rendered:
    return rendered_walk(1)


def test_the_vendored_file_is_the_one_that_is_described() -> None:
    folder = resources.files("studio.evidence") / "models"
    digest = hashlib.sha256((folder / MODEL).read_bytes()).hexdigest()
    assert f"SHA-256 {digest}" in (folder / "README.md").read_text()
    assert "Apache License" in (folder / "pose_landmark_full-LICENSE").read_text()


@pytest.mark.parametrize("turns", [0, 1])
def test_a_person_is_found_and_cut_out(walk: Rendered, network: PersonNetwork, turns: int) -> None:
    """Also in a picture that has to be turned clockwise by so many quarters to be upright."""
    camera = walk.cameras[2].name
    picture = np.ascontiguousarray(np.rot90(walk.pictures[camera, 0], turns))
    true = np.rot90(walk.masks[camera, 0], turns)
    found = network.find(picture, turns)
    assert found
    mask = found[0].mask(picture)
    assert mask.shape == picture.shape[:2]
    assert set(np.unique(mask)) == {0, 255}
    assert overlap(mask, true) >= 0.9


def test_the_middles_stay_where_left_and_right_are_exchanged() -> None:
    """The network's points of the body, from the shoulders on: left ones are odd, right ones follow."""
    points = np.random.default_rng(0).uniform(0.0, 400.0, (39, 2))
    mirrored = points.copy()
    for left in range(11, 33, 2):
        mirrored[[left, left + 1]] = points[[left + 1, left]]
    seen, exchanged = (
        Detection(1.0, np.ones((256, 256), np.float32), given, Crop(200.0, 200.0, 400.0)).middles()
        for given in (points, mirrored)
    )
    np.testing.assert_allclose(seen, exchanged)
    np.testing.assert_allclose(seen[0], points[0])
    np.testing.assert_allclose(
        seen[1:], [(points[left] + points[left + 1]) / 2.0 for left in (11, 23, 25, 27)]
    )


@pytest.mark.parametrize(
    ("shape", "seen"), [((80, 2), True), ((2, 80), True), ((80, 1), False), ((1, 80), False)]
)
def test_a_strip_of_a_person_is_cut_out_from_two_pixels_on(shape: tuple[int, int], seen: bool) -> None:
    everywhere = Detection(
        1.0, np.full((256, 256), 5.0, np.float32), np.zeros((39, 2)), Crop(40.0, 40.0, 200.0)
    )
    assert (everywhere.mask(np.full((*shape, 3), 90, np.uint8)) == (255 if seen else 0)).all()


@pytest.mark.slow
def test_nobody_is_found_in_an_empty_room(walk: Rendered, network: PersonNetwork) -> None:
    assert network.find(walk.empty[walk.cameras[2].name]) == []
