"""Masks of an animal before known backgrounds: drawn pictures of a black body with its shadow and a tail."""

import dataclasses

import cv2
import numpy as np
import pytest
from drawn_people import ring_of_cameras

from studio.evidence.background import GaussianBackground
from studio.evidence.masks import disc
from studio.evidence.settings import EvidenceSettings
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.runs.setup import animal_masks
from studio.runs.setup.animal_masks import darkest_shadow, unshaded, without_ghosts

WIDTH, HEIGHT = 360, 180
FLOOR, BLACK, PINK = (90, 100, 105), (18, 18, 20), (95, 100, 150)


def floor() -> Bytes:
    rng = np.random.default_rng(1)
    picture = np.full((HEIGHT, WIDTH, 3), FLOOR, np.float64) + rng.normal(0.0, 2.0, (HEIGHT, WIDTH, 3))
    return np.clip(picture, 0, 255).astype(np.uint8)


def with_animal(x: int, seed: int = 0) -> tuple[Bytes, Bytes, Bytes]:
    """A picture of a body at x, its shadow below it and its tail to the right; the true body, and the true tail."""
    rng = np.random.default_rng(seed)
    picture = floor().astype(np.float64)
    shadow, body, tail = (np.zeros((HEIGHT, WIDTH), np.uint8) for _ in range(3))
    cv2.ellipse(shadow, (x + 6, 112), (34, 12), 0, 0, 360, 255, -1)
    cv2.ellipse(body, (x, 90), (32, 22), 0, 0, 360, 255, -1)
    cv2.line(tail, (x + 30, 92), (x + 90, 80), 255, 2)
    picture[shadow > 0] *= 0.62
    picture[tail > 0] = PINK
    picture[body > 0] = BLACK
    picture = cv2.GaussianBlur(picture, (3, 3), 0.6) + rng.normal(0.0, 1.5, picture.shape)
    return np.clip(picture, 0, 255).astype(np.uint8), body, tail & ~body


class Drawn:
    """Footage of one camera in memory."""

    def __init__(self, pictures: list[Bytes]) -> None:
        self.pictures, self.frame_count = pictures, len(pictures)

    def picture(self, _camera: str, frame: int) -> Bytes:
        return self.pictures[frame]

    def absent(self, _frame: int) -> frozenset[str]:
        return frozenset()


@pytest.fixture(scope="module")
def learnt() -> "animal_masks.Learnt":
    pictures = [with_animal(40 + 9 * number, number)[0] for number in range(20)]
    return animal_masks.learn("one", Drawn(pictures), {"one": floor()})  # type: ignore[arg-type]


def test_the_shadow_is_left_out_and_the_tail_is_kept(learnt: "animal_masks.Learnt") -> None:
    picture, body, tail = with_animal(88, 7)
    mask = animal_masks.with_thin_limbs(animal_masks.body_alone(picture, learnt), picture, learnt)
    elsewhere = np.asarray(cv2.dilate(tail, disc(2)), np.uint8) == 0
    both = np.count_nonzero((mask > 0) & (body > 0))
    assert both / np.count_nonzero(((mask > 0) | (body > 0)) & elsewhere) > 0.93
    assert np.count_nonzero(mask & tail) > 0.8 * np.count_nonzero(tail)
    # The shadows that the views agree on are body to the usual test.
    wide = EvidenceSettings(mask_shadow_darkest=0.75, mask_shadow_colour=0.03)
    usual, beside = learnt.model.foreground(picture, wide).mask, elsewhere & (body == 0)
    assert np.count_nonzero((usual > 0) & beside) > 4 * np.count_nonzero((mask > 0) & beside)


def test_shadows_end_where_the_subject_begins() -> None:
    rng = np.random.default_rng(3)
    dark, shade = rng.normal(0.2, 0.04, 3000), rng.normal(0.65, 0.06, 2000)
    assert 0.3 <= darkest_shadow(np.concatenate([dark, shade]).astype(np.float32)) <= 0.5
    # A bright subject says nothing of how dark shadows are.
    assert darkest_shadow(rng.normal(1.6, 0.1, 3000).astype(np.float32)) == animal_masks.USUAL_DARKEST


def test_a_background_with_an_animal_in_it_is_mended() -> None:
    ghost = with_animal(290)[0]
    pictures = [with_animal(40 + 12 * number, number)[0] for number in range(12)]
    mended = without_ghosts(ghost, pictures)
    assert np.abs(mended.astype(float) - floor()).max(axis=2)[60:130, 265:330].mean() < 6.0
    # So is one who sits where it shows him for half of the time.
    pictures[:6] = [with_animal(290, number)[0] for number in range(6)]
    mended = without_ghosts(ghost, pictures)
    assert np.abs(mended.astype(float) - floor()).max(axis=2)[60:130, 265:330].mean() < 6.0
    # What is right stays as it was.
    np.testing.assert_array_equal(without_ghosts(floor(), pictures), floor())


def test_shades_do_not_count_and_colours_do() -> None:
    background = np.full((20, 20, 3), FLOOR, np.uint8)
    shade = (0.6 * background).astype(np.uint8)
    tinted = np.clip(background * [0.6, 0.6, 1.0], 0, 255).astype(np.uint8)
    ones = np.ones(3, np.float32)
    assert unshaded(shade, background, ones, 0.45).max() < 1.5
    assert unshaded(tinted, background, ones, 0.45).min() > 15.0
    assert unshaded((0.2 * background).astype(np.uint8), background, ones, 0.45).min() > 100.0


def test_what_looks_like_the_subject_before_its_own_colour_is_unknown(learnt: "animal_masks.Learnt") -> None:
    black = GaussianBackground(np.full((HEIGHT, WIDTH, 3), BLACK, np.uint8))
    picture = with_animal(88, 7)[0]
    before = animal_masks.unknown_pixels(picture, dataclasses.replace(learnt, model=black))
    body = with_animal(88, 7)[1] > 0
    assert before[body].mean() > 0.9
    assert before[~body].mean() < 0.05
    assert not animal_masks.unknown_pixels(picture, learnt).any()


def test_a_tail_of_a_shadows_colour_is_kept_where_a_shadow_of_its_darkness_is_not(
    learnt: "animal_masks.Learnt",
) -> None:
    picture, body, tail = with_animal(88, 7)
    shade = np.clip(0.7 * floor().astype(float), 0, 255).astype(np.uint8)
    grey = np.where(tail[..., None] > 0, shade, picture)
    grey[118:143, 130:190] = shade[118:143, 130:190]
    mask = animal_masks.with_thin_limbs(animal_masks.body_alone(grey, learnt), grey, learnt)
    beyond = tail & ~np.asarray(cv2.dilate(body, disc(3)), np.uint8)
    assert np.count_nonzero(mask & beyond) > 0.8 * np.count_nonzero(beyond)
    assert (mask[118:143, 130:190] > 0).mean() < 0.05


SIDES = tuple(
    dataclasses.replace(camera, translation=camera.translation / 10.0)
    for camera in ring_of_cameras(2, 200, 160)
)
"""Two that look at a hand's length of floor from two sides."""
PLACE, BESIDE = np.array([20.0, 10.0, 0.0]), np.array([-70.0, -30.0, 0.0])
"""mm, on the floor."""


def disc_at(camera: Camera, place: Array, radius: float = 18.0) -> Bytes:
    """(H, W) 255 where a camera sees a disc on the floor, or the same disc elsewhere."""
    around = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    ring = place + radius * np.stack([np.cos(around), np.sin(around), np.zeros(60)], axis=1)
    picture = np.zeros((camera.height, camera.width), np.uint8)
    cv2.fillPoly(picture, [np.round(project(camera, ring)[0]).astype(np.int32)], 255)
    return picture


def seen_by_both(dark: Array, plain: Array) -> Bytes:
    """What the first camera's dark disc is confirmed to be, where the second one sees a shadow."""
    nothing = np.zeros((SIDES[0].height, SIDES[0].width), np.uint8)
    shades = [(nothing, disc_at(SIDES[0], dark)), (disc_at(SIDES[1], plain), nothing)]
    return animal_masks.confirmed_shadows(SIDES, shades)[0]


def test_a_pixel_sees_the_floor_where_its_ray_ends_and_none_above_the_horizon() -> None:
    camera = SIDES[0]
    pixels = np.round(project(camera, np.stack([PLACE, BESIDE]))[0]).astype(np.int64)
    places = animal_masks.places_on_floor(camera, pixels)
    np.testing.assert_allclose(places[:, 2], 0.0, atol=1e-9)
    # A pixel is some 4 mm of the floor.
    np.testing.assert_allclose(project(camera, places)[0], pixels, atol=1e-6)
    np.testing.assert_allclose(places, [PLACE, BESIDE], atol=8.0)
    # Level, 100 mm above the floor, looking along x: 45 degrees below the horizon lies what is 100 mm ahead.
    ahead = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    lens = np.array([[50.0, 0.0, 100.0], [0.0, 50.0, 80.0], [0.0, 0.0, 1.0]])
    level = dataclasses.replace(
        camera, rotation=ahead, translation=-ahead @ [0.0, 0.0, 100.0], matrix=lens, distortion=np.zeros(5)
    )
    below, above = animal_masks.places_on_floor(level, np.array([[100, 130], [100, 30]]))
    np.testing.assert_allclose(below, [100.0, 0.0, 0.0], atol=1e-9)
    assert np.isnan(above).all()


def test_a_shadow_as_dark_as_the_subject_is_one_where_another_camera_sees_a_shadow() -> None:
    whole = np.count_nonzero(disc_at(SIDES[0], PLACE))
    assert np.count_nonzero(seen_by_both(PLACE, PLACE)) > 0.9 * whole
    assert not seen_by_both(PLACE, BESIDE).any()
    # What stands 40 mm above the floor hides other places of it.
    above = PLACE + np.array([0.0, 0.0, 40.0])
    assert np.count_nonzero(seen_by_both(above, PLACE)) < 0.5 * whole


def test_what_is_as_dark_as_the_subject_or_brighter_than_the_floor_is_no_shadow(
    learnt: "animal_masks.Learnt",
) -> None:
    picture, body, _ = with_animal(88, 7)
    deep = floor().astype(float)
    deep[130:150, 200:260] *= 0.35
    deep[130:150, 100:160] *= 1.5
    picture = np.where(body[..., None] > 0, picture, np.clip(deep, 0, 255).astype(np.uint8))
    _, dark = animal_masks.shades_of(picture, learnt)
    inside = cv2.erode(body, disc(3)) > 0
    assert dark[inside].mean() < 0.05 * 255
    assert (dark[132:148, 202:258] > 0).mean() > 0.95
    assert not dark[132:148, 102:158].any()
    # It is darker than shadows are in this footage, so that a camera alone takes it for the subject.
    alone = animal_masks.body_alone(picture, learnt)
    wide = np.asarray(cv2.morphologyEx(dark, cv2.MORPH_OPEN, disc(3)), np.uint8)
    told = animal_masks.body_alone(picture, learnt, wide)
    assert (learnt.model.foreground(picture, learnt.settings).mask[132:148, 202:258] > 0).mean() > 0.9
    assert not told[132:148, 202:258].any()
    assert np.count_nonzero(told & body) > 0.97 * np.count_nonzero(alone & body)
