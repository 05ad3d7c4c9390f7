"""Classification of voxels by pixels and masks: against plain NumPy and Eq. 6 written out."""

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest
from posed_cones import ring

from studio.evidence.volume import hull_kernels as kernels
from studio.evidence.volume import hull_projection as projection
from studio.evidence.volume.chi_square import fitted_thresholds
from studio.evidence.volume.hull_kernels import find_distances
from studio.evidence.volume.hull_octree import summed_areas
from studio.evidence.volume.reconstruction import radical_inverses
from studio.evidence.yuv_background import YuvBackground, learn_background
from studio.foundations.geometry.camera_table import camera_table, picture_limit
from studio.foundations.geometry.projection import distorted

BARREL = ring(3)[0]
CAMERA = dataclasses.replace(BARREL, distortion=np.array([*BARREL.distortion[:4], 0.02]))
CAMERAS = camera_table([CAMERA], picture_limit)
STARTS = np.array([[0, 320 * 240], [0, 321 * 241]])
MIDDLE = np.array([0.0, 0.0, 900.0])
POLYNOMIAL = fitted_thresholds(40, 0.99)
NO_FLOATS, NO_SUMS, NO_PICTURE = np.zeros(1, np.float32), np.zeros(1, np.int32), np.zeros((1, 3), np.uint8)
HEIGHTS = radical_inverses(512)


def rules(*, last: bool = False, share: float = 0.5) -> kernels.Rules:
    polynomial = (*map(float, POLYNOMIAL.coefficients),)
    return kernels.Rules(last, 0, share, 1.0, POLYNOMIAL.single, polynomial)


def sights(distances: np.ndarray = NO_FLOATS) -> kernels.Sights:
    return kernels.Sights(True, CAMERAS, STARTS, NO_SUMS, NO_PICTURE, distances, HEIGHTS)


def placed(half: float, centres: np.ndarray = MIDDLE) -> np.ndarray:
    """Projections (rows, 16) of sixteen voxels, of which (N, 3) or (3,) are the centres of the first."""
    rows = np.ones((projection.ROWS, projection.LANES))
    rows[projection.CENTRE : projection.CENTRE + 3] = MIDDLE[:, None]
    rows[projection.CENTRE : projection.CENTRE + 3, : len(np.atleast_2d(centres))] = np.atleast_2d(centres).T
    projection.place_voxels(CAMERAS, 0, half, rows.reshape(-1))
    return rows


def samples(rows: np.ndarray, sampling: float = 1.0) -> np.ndarray:
    """Pixels (K, 16) of the voxels' samples."""
    most = projection.count_samples(rows.reshape(-1), projection.LANES, sampling)
    pixels = np.empty((most, projection.LANES))
    projection.sample_pixels(rows.reshape(-1), most, 320.0, 240.0, HEIGHTS, pixels.reshape(-1))
    return pixels


def scene(seed: int = 0) -> tuple[YuvBackground, np.ndarray]:
    """A background and a picture of it."""
    rng = np.random.default_rng(seed)
    shade = rng.uniform(50, 200, (240, 320, 3))
    clip = [np.round(shade + rng.normal(0, 3, shade.shape)).astype(np.uint8) for _ in range(60)]
    return learn_background(clip[1:]), clip[0]


def look(distances: np.ndarray, half: float, row: kernels.Rules, at: np.ndarray = MIDDLE) -> int:
    rows = placed(half, at)
    assert rows[projection.SEEN, 0]
    pixels = samples(rows)
    return kernels.look_at_pixels(sights(distances), 0, row, rows.reshape(-1), 0, pixels.reshape(-1))


def plain_projection(centre: np.ndarray, half: float) -> dict[str, Any]:
    """One voxel's projection, each number by itself, in the order that the kernel's docstring gives the rules."""
    r, t, m, k = CAMERA.rotation, CAMERA.translation, CAMERA.matrix, CAMERA.distortion
    x, y, z = centre
    depth = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z + t[2]
    near = 1.0 / depth
    a = (r[0, 0] * x + r[0, 1] * y + r[0, 2] * z + t[0]) * near
    b = (r[1, 0] * x + r[1, 1] * y + r[1, 2] * z + t[1]) * near
    xd, yd, radial = distorted(a, b, tuple(k))
    square = a * a + b * b
    slope = 2.0 * (k[0] + square * (2.0 * k[1] + square * 3.0 * k[4]))
    xx = radial + a * a * slope + 2.0 * k[2] * b + 6.0 * k[3] * a
    xy = a * b * slope + 2.0 * k[2] * a + 2.0 * k[3] * b
    yy = radial + b * b * slope + 6.0 * k[2] * b + 2.0 * k[3] * a
    axes: list[tuple[float, float]] = []
    sinks: list[float] = []
    faces: list[float] = []
    eye = CAMERAS[0]["centre"]
    for axis in range(3):
        step = half if eye[axis] - centre[axis] >= 0.0 else -half
        sink = step * r[2, axis]
        along_a, along_b = (step * r[0, axis] - a * sink) * near, (step * r[1, axis] - b * sink) * near
        along_x, along_y = xx * along_a + xy * along_b, xy * along_a + yy * along_b
        axes.append((m[0, 0] * along_x + m[0, 1] * along_y, m[1, 1] * along_y))
        sinks.append(sink)
    for axis in range(3):
        (px, py), (qx, qy) = axes[(axis + 1) % 3], axes[(axis + 2) % 3]
        faces.append(4.0 * abs(px * qy - py * qx))
    uv = m[0, 0] * xd + m[0, 1] * yd + m[0, 2], m[1, 1] * yd + m[1, 2]
    return {"uv": uv, "depth": depth, "axes": axes, "sinks": sinks, "faces": faces}


def plain_samples(found: dict[str, Any], sampling: float) -> list[int]:
    """Pixels of one voxel's samples, sample by sample."""
    (u, v), area = found["uv"], sum(found["faces"])
    count = max(1, math.ceil(sampling * math.sqrt(area) - 1e-9))
    pixels: list[int] = []
    for number in range(count):
        at, face = (number + 0.5) / count * area, 0
        while face < 2 and at >= found["faces"][face]:
            at, face = at - found["faces"][face], face + 1
        p, q = 2.0 * at / found["faces"][face] - 1.0, 2.0 * HEIGHTS[number] - 1.0
        one, two = (face + 1) % 3, (face + 2) % 3
        sink = found["sinks"][face] + p * found["sinks"][one] + q * found["sinks"][two]
        scale, (f, g, h) = (
            found["depth"] / (found["depth"] + sink),
            (found["axes"][n] for n in (face, one, two)),
        )
        x, y = (u + scale * (f[0] + p * g[0] + q * h[0]), v + scale * (f[1] + p * g[1] + q * h[1]))
        column, row = math.floor((u if count == 1 else x) + 0.5), math.floor((v if count == 1 else y) + 0.5)
        inside = 0 <= column < 320 and 0 <= row < 240
        pixels.append(row * 320 + column if inside else -1)
    return pixels


@pytest.mark.parametrize(("half", "sampling"), [(1.0, 1.0), (14.0, 1.0), (90.0, 1.0), (40.0, 4.0)])
def test_sixteen_voxels_at_a_time_are_bit_for_bit_the_voxels_one_by_one(half: float, sampling: float) -> None:
    centres = MIDDLE + np.random.default_rng(2).uniform(-900.0, 900.0, (projection.LANES, 3))
    rows = placed(half, centres)
    pixels = samples(rows, sampling)
    for lane, centre in enumerate(centres):
        found = plain_projection(centre, half)
        axes = rows[projection.AXES : projection.AXES + 6, lane].reshape(3, 2)
        assert (rows[projection.U, lane], rows[projection.V, lane]) == found["uv"]
        assert axes.tolist() == [list(axis) for axis in found["axes"]]
        assert rows[projection.FACES : projection.FACES + 3, lane].tolist() == found["faces"]
        expected = plain_samples(found, sampling)
        assert rows[projection.COUNT, lane] == len(expected)
        assert pixels[: len(expected), lane].tolist() == expected


@pytest.mark.parametrize("deepest", [0.0, 0.4])
def test_distances_of_all_pixels_are_those_of_the_background(deepest: float) -> None:
    background, picture = scene()
    picture = np.random.default_rng(5).integers(0, 256, picture.shape, dtype=np.uint8)
    expected = background.squared_distances(picture, 0.1, deepest).ravel()
    distances = np.full(320 * 240, np.nan, np.float32)
    shares = np.float32(0.1), np.float32(deepest)
    given = picture.reshape(-1, 3), background.packed(), *shares, distances
    find_distances(3, 5, *given)
    assert np.flatnonzero(np.isfinite(distances)).tolist() == [*range(3 * kernels.BLOCK, 5 * kernels.BLOCK)]
    find_distances(0, -(-len(distances) // kernels.BLOCK), *given)
    np.testing.assert_allclose(distances, expected, rtol=2e-3, atol=0.05)


def test_equation_6() -> None:
    """All of the sum small: background; every sample far: foreground; else edge, decided by share at the last depth."""
    near, far = np.full(320 * 240, 1.0, np.float32), np.full(320 * 240, 400.0, np.float32)
    assert look(near, 100.0, rules()) == kernels.BACKGROUND
    assert look(far, 100.0, rules()) == kernels.FOREGROUND
    left = np.where(np.arange(320) < 160, 400.0, 1.0).astype(np.float32)
    half = np.tile(left, 240)
    assert look(half, 100.0, rules()) == kernels.EDGE
    assert look(half, 100.0, rules(last=True, share=0.3)) == kernels.FOREGROUND
    assert look(half, 100.0, rules(last=True, share=0.7)) == kernels.BACKGROUND


def test_many_slightly_odd_samples_are_no_background_and_none_is_foreground() -> None:
    """9 a sample is below T_1 = 11.3, but the sum of many is above T_k: an edge. 12 is above both."""
    odd = np.full(320 * 240, 9.0, np.float32)
    assert look(odd, 100.0, rules()) == kernels.EDGE
    assert look(odd, 100.0, rules(last=True)) == kernels.BACKGROUND
    assert look(odd, 2.0, rules()) == kernels.BACKGROUND
    assert look(odd + 3.0, 100.0, rules(last=True)) == kernels.FOREGROUND


@pytest.mark.parametrize("half", [6.0, 25.0, 90.0])
def test_background_is_classified_at_the_given_confidence(half: float) -> None:
    rng = np.random.default_rng(11)
    answers: list[int] = []
    for _ in range(30):
        distances = (rng.normal(size=(3, 320 * 240)) ** 2).sum(axis=0).astype(np.float32)
        places = MIDDLE + rng.uniform(-500, 500, (100, 3))
        answers.extend(look(distances, half, rules(), at) for at in places)
    assert np.mean(np.array(answers) == kernels.BACKGROUND) == pytest.approx(0.99, abs=0.012)


def test_voxels_partly_outside_the_picture_are_not_carved() -> None:
    near = np.full(320 * 240, 1.0, np.float32)
    edge_of_picture = CAMERA.centre + CAMERA.rotation.T @ np.array([0.0, 0.415, 1.0]) * 3000.0
    assert look(near, 90.0, rules(), edge_of_picture) == kernels.EDGE
    outside = CAMERA.centre + CAMERA.rotation.T @ np.array([0.0, 0.5, 1.0]) * 3000.0
    assert look(near, 20.0, rules(), outside) == kernels.UNSEEN


def test_summed_areas_count_mask_pixels() -> None:
    mask = np.where(np.random.default_rng(0).random((240, 320)) < 0.3, np.uint8(255), np.uint8(0))
    sums = np.empty(321 * 241, np.int32)
    summed_areas(mask, sums)
    expected = np.pad((mask > 0).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    np.testing.assert_array_equal(sums.reshape(241, 321), expected)


def test_a_mask_carves_only_what_covers_none_of_its_pixels() -> None:
    """On each side of the rectangle its last pixel counts and the next does not."""
    rows = placed(60.0)
    place, sums = rows.reshape(-1), np.empty(321 * 241, np.int32)
    middle = rows[[projection.U, projection.V], 0]
    reach = rows[[projection.BOUND_X, projection.BOUND_Y], 0]
    for axis, way in itertools.product((0, 1), (-1, 1)):
        for beyond, expected in ((0, kernels.EDGE), (way, kernels.BACKGROUND)):
            pixel = np.floor(middle + 0.5).astype(int)
            pixel[axis] = int(np.floor(middle[axis] + way * reach[axis] + 0.5)) + beyond
            mask = np.zeros((240, 320), np.uint8)
            mask[pixel[1], pixel[0]] = 255
            summed_areas(mask, sums)
            assert kernels.look_at_mask(sights()._replace(sums=sums), 0, rules(), place, 0) == expected
    summed_areas(np.full((240, 320), 255, np.uint8), sums)
    assert kernels.look_at_mask(sights()._replace(sums=sums), 0, rules(), place, 0) == kernels.FOREGROUND
