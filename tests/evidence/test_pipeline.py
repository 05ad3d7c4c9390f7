"""A frame's evidence from footage on disk."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest
from toy_footage import looking_at, write_pictures, write_video

from studio.evidence.backgrounds import Backgrounds, fitted_plate
from studio.evidence.edges import bodytrack_edges
from studio.evidence.pipeline import EvidenceMaker
from studio.evidence.settings import BACKGROUND_MODELS, EvidenceSettings
from studio.footage.capture.footage import Footage, open_footage
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.errors import FootageError

WIDTH, HEIGHT, COUNT = 128, 96, 24
NAMES = ("masked", "plate", "clip", "bare")
CAMERAS = tuple(looking_at(name, (3000.0, 0.0, 1500.0), (0.0, 0.0, 1000.0)) for name in NAMES)
SETTINGS = EvidenceSettings()


def room() -> np.ndarray:
    noise = np.random.default_rng(3).uniform(95.0, 150.0, (HEIGHT // 16, WIDTH // 16, 3))
    return cv2.resize(noise, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)


def noisy(light: np.ndarray, seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0.0, 2.0, light.shape)
    return np.clip(np.round(light + noise), 0, 255).astype(np.uint8)


def true_mask(frame: int) -> np.ndarray:
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    cv2.ellipse(mask, (14 + 4 * frame, 48), (10, 30), 0, 0, 360, 255, cv2.FILLED)
    return mask


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Footage:
    folder = tmp_path_factory.mktemp("footage")
    frames = []
    for number in range(COUNT):
        light = room()
        light[true_mask(number) > 0] = (20.0, 40.0, 235.0)
        frames.append(noisy(light, number))
    masks = [np.repeat(true_mask(number)[:, :, None], 3, axis=2) for number in range(COUNT)]
    write_pictures(folder / "frames", frames)
    write_pictures(folder / "masks", masks)
    cv2.imwrite(str(folder / "plate.png"), noisy(room(), 99))
    write_video(folder / "clip.mp4", [noisy(room(), 200 + k) for k in range(15)])
    extra = {
        "masked": {"masks": "masks"},
        "plate": {"background": "plate.png"},
        "clip": {"background": "clip.mp4"},
    }
    sources = tuple(
        CameraSource(name, "pictures", "frames", WIDTH, HEIGHT, COUNT, **extra.get(name, {}))
        for name in NAMES
    )
    return open_footage(FootageSource(30.0, COUNT, sources), folder)


def overlap(found: np.ndarray, wanted: np.ndarray) -> float:
    """Intersection over union of two masks."""
    return float(np.sum((found > 0) & (wanted > 0)) / np.sum((found > 0) | (wanted > 0)))


def test_auto_takes_given_masks_else_the_best_background(footage: Footage) -> None:
    maker = EvidenceMaker(CAMERAS, footage, Backgrounds(footage), SETTINGS)
    found = maker.evidence(9)
    assert found.frame == 9
    assert [view.camera for view in found.views] == list(NAMES)
    np.testing.assert_array_equal(found.views[0].mask, true_mask(9))
    for view in found.views:
        assert overlap(view.mask, true_mask(9)) > 0.9
        assert set(np.unique(view.mask)) == {0, 255}
        np.testing.assert_array_equal(view.picture, footage.picture(view.camera, 9))
        outline = cv2.morphologyEx(true_mask(9), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0
        assert view.edges[outline].mean() > 115 > 4.0 * view.edges.mean()


@pytest.mark.parametrize(
    "model", [name for name in BACKGROUND_MODELS if name not in ("auto", "mask", "threshold")]
)
def test_every_model_finds_the_person(footage: Footage, model: str) -> None:
    settings = dataclasses.replace(SETTINGS, background_model=model)
    maker = EvidenceMaker(CAMERAS, footage, Backgrounds(footage), settings)
    for view in maker.evidence(12).views:
        assert overlap(view.mask, true_mask(12)) > 0.8, view.camera


def test_threads_and_order_change_nothing(footage: Footage) -> None:
    with ThreadPoolExecutor(2) as executor:
        for model in ("auto", "mog2", "knn"):
            settings = dataclasses.replace(SETTINGS, background_model=model)
            alone = EvidenceMaker(CAMERAS, footage, Backgrounds(footage), settings)
            shared = EvidenceMaker(CAMERAS, footage, Backgrounds(footage), settings, executor=executor)
            expected = [alone.evidence(frame) for frame in range(4)]
            for frame in (3, 1, 0, 2):
                for view, other in zip(shared.evidence(frame).views, expected[frame].views, strict=True):
                    np.testing.assert_array_equal(view.mask, other.mask)
                    np.testing.assert_array_equal(view.edges, other.edges)


def test_with_a_plate_little_of_the_combined_background_is_doubtful_and_without_one_all(
    footage: Footage,
) -> None:
    backgrounds = Backgrounds(footage)
    assert backgrounds.combined("bare")[1].all()
    model, doubtful = backgrounds.combined("plate")
    assert doubtful.mean() < 0.02
    assert np.abs(model.mean - room()).mean() < 2.0


def test_models_are_fitted_once(footage: Footage) -> None:
    backgrounds = Backgrounds(footage)
    assert backgrounds.model("plate", "gaussian") is backgrounds.model("plate", "gaussian")
    assert backgrounds.model("plate", "gaussian") is not backgrounds.model("plate", "median")


def test_edge_kinds(footage: Footage) -> None:
    backgrounds = Backgrounds(footage)
    benchmark = EvidenceMaker(CAMERAS, footage, backgrounds, SETTINGS, "bodytrack").view("plate", 2)
    np.testing.assert_array_equal(benchmark.edges, bodytrack_edges(benchmark.picture))
    assert EvidenceMaker(CAMERAS, footage, backgrounds, SETTINGS, "none").view("plate", 2).edges.max() == 0
    with pytest.raises(ValueError, match="canny"):
        EvidenceMaker(CAMERAS, footage, backgrounds, SETTINGS, "canny")


def test_masks_that_are_asked_for_and_missing(footage: Footage) -> None:
    settings = dataclasses.replace(SETTINGS, background_model="mask")
    maker = EvidenceMaker(CAMERAS, footage, Backgrounds(footage), settings)
    np.testing.assert_array_equal(maker.view("masked", 1).mask, true_mask(1))
    with pytest.raises(FootageError, match="Camera plate has no masks"):
        maker.view("plate", 1)


def test_too_few_frames_for_a_median(tmp_path: Path) -> None:
    write_pictures(tmp_path / "p", [noisy(room(), 0)] * 2)
    source = CameraSource("c", "pictures", "p", WIDTH, HEIGHT, 2)
    footage = open_footage(FootageSource(30.0, 2, (source,)), tmp_path)
    with pytest.raises(FootageError, match="only 2 frames"):
        Backgrounds(footage).model("c", "gaussian")


def test_a_plate_of_nearly_the_footages_size_is_fitted() -> None:
    size = (408, 306)
    plate = noisy(cv2.resize(room(), size, interpolation=cv2.INTER_CUBIC), 1)
    cropped = plate[2:-2, 4:-4]
    np.testing.assert_array_equal(fitted_plate(plate, cropped, "p"), cropped)
    shrunk = cv2.resize(plate, (402, 302), interpolation=cv2.INTER_AREA)
    barred = cv2.copyMakeBorder(shrunk, 2, 2, 0, 0, cv2.BORDER_CONSTANT)
    found = fitted_plate(plate, barred, "p")
    assert np.abs(found.astype(int) - barred).mean() < 3.0
    with pytest.raises(FootageError, match="408x306"):
        fitted_plate(plate, plate[:, :350], "p")


@pytest.mark.parametrize("turned", [False, True])
def test_a_plate_of_another_shape_is_centred_between_bars(turned: bool) -> None:
    plate = noisy(cv2.resize(room(), (408, 300), interpolation=cv2.INTER_CUBIC), 1)
    if turned:
        plate = np.ascontiguousarray(plate.transpose(1, 0, 2))
    shrunk = cv2.resize(plate, (294, 400) if turned else (400, 294), interpolation=cv2.INTER_AREA)
    bars = (0, 0, 3, 3) if turned else (3, 3, 0, 0)
    barred = cv2.copyMakeBorder(shrunk, *bars, cv2.BORDER_CONSTANT)
    np.testing.assert_array_equal(fitted_plate(plate, barred, "p"), barred)


def test_a_hull_is_carved_from_pixels_only_where_every_camera_has_an_empty_view(footage: Footage) -> None:
    backgrounds = Backgrounds(footage)

    def maker(cameras: slice, **changes: str) -> EvidenceMaker:
        settings = dataclasses.replace(SETTINGS, **changes)
        return EvidenceMaker(CAMERAS[cameras], footage, backgrounds, settings, "hull")

    plates = slice(1, 3)
    assert maker(plates).hull_of_pixels
    assert not maker(slice(0, 3)).hull_of_pixels
    assert not maker(slice(1, 4)).hull_of_pixels
    assert not maker(plates, hull_evidence="masks").hull_of_pixels
    assert not maker(plates, background_model="knn").hull_of_pixels
    assert maker(slice(0, 4), hull_evidence="pixels").hull_of_pixels
    for view in maker(slice(0, 4), hull_evidence="pixels").evidence(9).views:
        assert view.mask.max() == view.edges.max() == 0
        assert overlap(view.background.squared_distances(view.picture) > 60.0, true_mask(9)) > 0.8
    for view in maker(slice(0, 4)).evidence(9).views:
        assert view.background is None
        assert view.edges.max() == 0
        assert overlap(view.mask, true_mask(9)) > 0.9
    assert not EvidenceMaker(CAMERAS[plates], footage, backgrounds, SETTINGS).hull_of_pixels


def test_empty_views_are_learnt_once_for_a_noise_floor(footage: Footage) -> None:
    backgrounds = Backgrounds(footage)
    first = backgrounds.yuv("clip", 2.5)
    assert backgrounds.yuv("clip", 2.5) is first
    noisier = backgrounds.yuv("clip", 20.0)
    picture = footage.picture("clip", 3)
    assert np.median(noisier.squared_distances(picture)) < 0.2 * np.median(first.squared_distances(picture))
