"""The network that finds a person and cuts him out: the vendored file, and what it sees in rendered pictures."""

import hashlib
from importlib import resources

import numpy as np
import pytest
from rendered_people import Rendered, overlap, rendered_walk

from studio.evidence.person_network import MODEL, Crop, Detection, PersonNetwork, _crops_over, _same


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


def seen_at(x: float, y: float, side: float, presence: float = 1.0, filled: float = 1.0) -> Detection:
    """What a crop shows in which somebody stands upright and fills a share; the next crop is of the given side."""
    points = np.zeros((39, 2))
    points[33], points[34] = (x, y), (x, y - side / 2.5)
    logits = np.full((256, 256), -1.0, np.float32)
    logits.reshape(-1)[: round(filled * 65536)] = 1.0
    return Detection(presence, logits, points, Crop(x, y, side))


def test_a_crop_is_a_turned_square_about_its_middle() -> None:
    for angle in (0.0, 0.5, -2.0):
        to_picture = Crop(40.0, 70.0, 512.0, angle).to_picture()
        across, down = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        for u, v in ((0.0, 0.0), (255.0, 0.0), (127.5, 127.5), (30.0, 200.0)):
            wanted = np.array([40.0, 70.0]) + 2.0 * ((u - 127.5) * across + (v - 127.5) * down)
            np.testing.assert_allclose(to_picture @ [u, v, 1.0], wanted, atol=1e-9)
    assert Crop(1.0, 2.0, 3.0).angle == 0.0


def test_the_next_crop_is_about_the_hips_and_as_upright_as_the_person() -> None:
    points = np.zeros((39, 2))
    points[33], points[34] = (100.0, 50.0), (103.0, 46.0)
    crop = Detection(1.0, np.ones((256, 256), np.float32), points, Crop(0.0, 0.0, 9.0)).next_crop
    assert (crop.x, crop.y, crop.side) == (100.0, 50.0, pytest.approx(2.5 * 5.0))
    np.testing.assert_allclose((np.sin(crop.angle), -np.cos(crop.angle)), (0.6, -0.8))


def test_a_person_is_present_and_large_enough_and_shown() -> None:
    assert seen_at(5.0, 5.0, 20.0, presence=0.5).is_person()
    assert not seen_at(5.0, 5.0, 20.0, presence=0.49).is_person()
    assert seen_at(5.0, 5.0, 20.0, presence=0.49).is_person(0.4)
    assert seen_at(5.0, 5.0, 17.0).is_person()
    assert not seen_at(5.0, 5.0, 16.0).is_person()
    assert seen_at(5.0, 5.0, 20.0, filled=0.001).is_person()
    assert not seen_at(5.0, 5.0, 20.0, filled=0.0).is_person()
    nothing = Detection(
        1.0, np.zeros((256, 256), np.float32), seen_at(5.0, 5.0, 20.0).points, Crop(5.0, 5.0, 20.0)
    )
    assert not nothing.is_person()


def test_crops_of_four_sizes_cover_a_picture() -> None:
    crops = list(_crops_over(200, 100, 0.25))
    expected = []
    for side in (220.0, 160.0, 110.0, 80.0):
        step = 0.35 * side
        places = [
            np.arange(step, extent - step + 1.0, step) if extent > 2.0 * step else [extent / 2.0]
            for extent in (200, 100)
        ]
        expected += [(x, y, side, 0.25) for y in places[1] for x in places[0]]
    np.testing.assert_allclose([(crop.x, crop.y, crop.side, crop.angle) for crop in crops], expected)
    assert len({crop.side for crop in crops}) == 4
    # A side of exactly two steps is spanned by one crop.
    assert [crop.y for crop in _crops_over(100, 77, 0.0) if crop.side == pytest.approx(110.0)] == [38.5]


@pytest.mark.parametrize(
    ("apart", "same"), [((29.0, 0.0), True), ((30.0, 0.0), False), ((24.0, 18.0), False)]
)
def test_two_detections_nearer_than_a_part_of_the_larger_are_of_one_person(
    apart: tuple[float, float], same: bool
) -> None:
    one, other = seen_at(10.0, 20.0, 100.0), seen_at(10.0 + apart[0], 20.0 - apart[1], 60.0)
    assert _same(one, other) == _same(other, one) == same


class Looking(PersonNetwork):
    """A network that sees given persons: whoever's middle is nearest to a crop's, if within it."""

    def __init__(self, *persons: Detection) -> None:
        self.persons, self.looks = persons, []

    def look(self, picture: np.ndarray, crop: Crop) -> Detection:
        self.looks.append(crop)
        nearest = min(
            self.persons, key=lambda one: np.hypot(one.next_crop.x - crop.x, one.next_crop.y - crop.y)
        )
        away = np.hypot(nearest.next_crop.x - crop.x, nearest.next_crop.y - crop.y)
        return nearest if away < 0.3 * crop.side else seen_at(crop.x, crop.y, 50.0, presence=0.1)


EMPTY = np.zeros((240, 320, 3), np.uint8)


def test_persons_are_found_once_each_the_best_shown_first_and_four_at_most() -> None:
    middles = ((40.0, 60.0), (120.0, 70.0), (200.0, 60.0), (280.0, 70.0), (160.0, 200.0))
    persons = [seen_at(*at, 60.0, 0.999, 0.1 * (k + 1)) for k, at in enumerate(middles)]
    found = Looking(*persons).find(EMPTY)
    assert found == persons[:0:-1]
    unsure = seen_at(*middles[0], 60.0, 0.98, 0.9)
    assert Looking(unsure, *persons[1:3]).find(EMPTY) == [persons[2], persons[1]]
    assert Looking(seen_at(*middles[0], 60.0, 0.99)).find(EMPTY) != []
    assert Looking(seen_at(*middles[0], 15.0)).find(EMPTY) == []


def test_crops_are_tried_upright_in_a_picture_that_is_turned() -> None:
    network = Looking(seen_at(-900.0, -900.0, 10.0))
    assert network.find(EMPTY, 3) == []
    assert {crop.angle for crop in network.looks} == {-1.5 * np.pi}
    assert [(crop.x, crop.y) for crop in network.looks] == [
        (crop.x, crop.y) for crop in _crops_over(320, 240, 0.0)
    ]


def test_a_new_person_is_looked_at_three_times_and_has_to_be_certain_in_the_last_two() -> None:
    for last, certain in (((0.99, 0.99), True), ((0.98, 0.999), False), ((0.999, 0.98), False)):
        network = Looking(seen_at(40.0, 60.0, 60.0))
        first = len(list(_crops_over(320, 240, 0.0)))
        answers = iter([*[0.1] * (first - 1), 0.6, 0.1, *last])
        network.look = lambda *_, rest=answers: seen_at(40.0, 60.0, 60.0, next(rest))
        assert bool(network.find(EMPTY)) == certain


def test_a_cut_out_is_made_of_the_persons_place_and_a_margin() -> None:
    """In a crop of a picture's pixel each: 18 pixels around what shows him, as far as the picture goes."""
    logits = np.full((256, 256), -3.0, np.float32)
    logits[100:141, 60:91] = 3.0
    seen = Detection(1.0, logits, np.zeros((39, 2)), Crop(127.5, 127.5, 256.0))
    assert seen._place(400, 300) == (42, 82, 109, 159)
    assert seen._place(100, 120) == (42, 82, 100, 120)
    assert seen._place(42, 300) is None
    assert seen._place(400, 82) is None
    right = Detection(1.0, logits, np.zeros((39, 2)), Crop(57.5, 7.5, 256.0))
    assert right._place(400, 300) == (0, 0, 39, 39)
    twice = Detection(1.0, logits, np.zeros((39, 2)), Crop(127.5, 127.5, 512.0))
    middle = np.array([[60 - 18, 100 - 18], [90 + 18, 140 + 18]]) * 2.0 - 127.5
    assert twice._place(400, 300) == (
        0,
        *np.floor(middle[0, 1:]).astype(int),
        *(np.ceil(middle[1]).astype(int) + 1),
    )
    nobody = Detection(1.0, np.zeros((256, 256), np.float32), np.zeros((39, 2)), Crop(127.5, 127.5, 256.0))
    assert nobody._place(400, 300) is None
    assert not nobody.mask(np.zeros((300, 400, 3), np.uint8)).any()
