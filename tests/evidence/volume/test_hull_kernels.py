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
from studio.evidence.volume.hull_octree import colour, first_look, summed_areas
from studio.evidence.volume.reconstruction import radical_inverses
from studio.evidence.yuv_background import YuvBackground, learn_background
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import camera_table, picture_limit
from studio.foundations.geometry.projection import distorted

BARREL = ring(3)[0]
TURN = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
CAMERA = dataclasses.replace(
    BARREL,
    matrix=BARREL.matrix + np.array([[0.0, 7.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 0.0]]),
    distortion=np.array([*BARREL.distortion[:4], 0.02]),
    rotation=TURN @ BARREL.rotation,
    translation=TURN @ BARREL.translation + (40.0, -25.0, 0.0),
)
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
    reach = half * (abs(r[2, 0]) + abs(r[2, 1]) + abs(r[2, 2]))
    bounds = [sum(abs(axis[i]) for axis in axes) * (depth / (depth - reach)) for i in (0, 1)]
    seen = depth - reach >= 100.0 and square <= CAMERAS[0]["limit"]
    return {
        "uv": uv, "depth": depth, "axes": axes, "sinks": sinks, "faces": faces, "bounds": bounds, "seen": seen,
    }  # fmt: skip


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
        assert rows[projection.AREA, lane] == sum(found["faces"])
        assert rows[projection.DEPTH, lane] == found["depth"]
        bounds = rows[projection.BOUND_X, lane], rows[projection.BOUND_Y, lane]
        assert bounds == pytest.approx(found["bounds"], rel=1e-14)
        assert rows[projection.SINKS : projection.SINKS + 3, lane].tolist() == found["sinks"]
        assert bool(rows[projection.SEEN, lane]) == found["seen"]
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


def turned_up(number: int, width: int, height: int) -> Camera:
    """One of a ring, turned about its axis."""
    camera = ring(3)[number]
    cosine, sine = math.cos(0.4 * number + 0.3), math.sin(0.4 * number + 0.3)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return dataclasses.replace(
        camera,
        width=width,
        height=height,
        rotation=turn @ camera.rotation,
        translation=turn @ camera.translation,
    )


VIEWS = [turned_up(0, 320, 240), turned_up(1, 320, 200), turned_up(2, 290, 240)]
TABLE = camera_table(VIEWS, picture_limit)
PIXELS = np.array([camera.width * camera.height for camera in VIEWS])
CORNERS = np.array([(camera.width + 1) * (camera.height + 1) for camera in VIEWS])
BEGINS = np.array([[0, *np.cumsum(PIXELS)], [0, *np.cumsum(CORNERS)]])


def scene_of_masks(seed: int) -> tuple[kernels.Sights, list[np.ndarray]]:
    """Discs in every view, as sums, and as distances where they are looked at by pixels."""
    rng = np.random.default_rng(seed)
    masks, sums = [], np.empty(BEGINS[1, -1], np.int32)
    for number, camera in enumerate(VIEWS):
        rows, columns = np.mgrid[: camera.height, : camera.width]
        mask = np.zeros((camera.height, camera.width), np.uint8)
        for x, y, radius in rng.uniform([0, 0, 20], [camera.width, camera.height, 90], (3, 3)):
            mask[np.hypot(columns - x, rows - y) < radius] = 255
        masks.append(mask)
        summed_areas(mask, sums[BEGINS[1, number] : BEGINS[1, number + 1]])
    picture = rng.integers(0, 256, (BEGINS[0, -1], 3), dtype=np.uint8)
    inside = np.concatenate([mask.ravel() for mask in masks]) > 0
    distances = np.where(inside, rng.uniform(2.0, 30.0, len(inside)), rng.uniform(0.0, 8.0, len(inside)))
    given = False, TABLE, BEGINS, sums, picture, distances.astype(np.float32), HEIGHTS
    return kernels.Sights(*given), masks


def place_of(view: int, half: float, centre: np.ndarray) -> np.ndarray:
    """(rows, 16) projections of a voxel."""
    rows = np.ones((projection.ROWS, projection.LANES))
    rows[projection.CENTRE : projection.CENTRE + 3] = centre[:, None]
    projection.place_voxels(TABLE, view, half, rows.reshape(-1))
    return rows


def plain_mask_look(mask: np.ndarray, place: np.ndarray, row: kernels.Rules) -> tuple[int, float | None]:
    """The answer of the rectangle around a voxel, pixel by pixel, and its share of foreground."""
    height, width = mask.shape
    u, v = place[projection.U], place[projection.V]
    across, down = place[projection.BOUND_X], place[projection.BOUND_Y]
    if row.last:
        shrunk = math.sqrt(place[projection.AREA] / (4.0 * across * down))
        across, down = across * shrunk, down * shrunk
    columns = range(math.floor(u - across + 0.5), math.floor(u + across + 0.5) + 1)
    rows = range(math.floor(v - down + 0.5), math.floor(v + down + 0.5) + 1)
    pixels = [(y, x) for y in rows for x in columns]
    within = [(y, x) for y, x in pixels if 0 <= y < height and 0 <= x < width]
    if not within:
        return kernels.UNSEEN, None
    foreground = sum(mask[at] > 0 for at in within)
    if row.last:
        if not (-0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5):
            return kernels.UNSEEN, None
        enough = foreground > 0 and foreground >= row.edge_share * len(within)
        return (kernels.FOREGROUND if enough else kernels.BACKGROUND), None
    share = foreground / len(within)
    if len(within) < len(pixels):
        return kernels.EDGE, share
    return {0: kernels.BACKGROUND, len(within): kernels.FOREGROUND}.get(foreground, kernels.EDGE), share


def places(seed: int, count: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform([-1500, -1500, -600], [1500, 1500, 2600], (count, 3))


@pytest.mark.parametrize("last", [False, True])
def test_the_answer_of_a_mask_is_that_of_the_pixels_around_a_voxel(last: bool) -> None:
    seen, masks = scene_of_masks(1)
    row, answers = rules(last=last, share=0.5), []
    for half in (4.0, 30.0, 110.0):
        for centre in places(3, 160):
            for view, mask in enumerate(masks):
                rows = place_of(view, half, centre)
                if not rows[projection.SEEN, 3]:
                    continue
                expected, share = plain_mask_look(mask, rows[:, 3], row)
                assert kernels.look_at_mask(seen, view, row, rows.reshape(-1), 3) == expected
                if share is not None:
                    assert rows[projection.SHARE, 3] == share
                answers.append(expected)
    assert len(set(answers)) == (3 if last else 4)


def plain_pixels_look(
    distances: np.ndarray, view: int, place: np.ndarray, pixels: np.ndarray, row: kernels.Rules
) -> tuple[int, float]:
    """Eq. 6 over all samples, whose sums end where they decide."""
    one, linear, square = row.polynomial
    width, height = VIEWS[view].width, VIEWS[view].height
    count, inside, far, total = int(place[projection.COUNT]), 0, 0, np.float32(0.0)
    for pixel in pixels[:count].astype(int):
        if pixel >= 0:
            distance = distances[BEGINS[0, view] + pixel]
            total, inside, far = total + distance, inside + 1, far + int(distance > np.float32(row.single))
            if not row.last and total > one + count * (linear + count * square) and far < inside:
                return kernels.EDGE, far / inside
    if inside == 0:
        u, v = place[projection.U], place[projection.V]
        across, down = place[projection.BOUND_X], place[projection.BOUND_Y]
        beside = u + across < 0 or u - across > width - 1 or v + down < 0 or v - down > height - 1
        return (kernels.UNSEEN if row.last or beside else kernels.EDGE), 0.0
    if total <= one + inside * (linear + inside * square):
        return (kernels.EDGE if inside < count and not row.last else kernels.BACKGROUND), far / inside
    if row.last:
        return (kernels.FOREGROUND if far >= row.edge_share * inside else kernels.BACKGROUND), far / inside
    everything = far == inside == count
    return (kernels.FOREGROUND if everything else kernels.EDGE), far / inside


@pytest.mark.parametrize("last", [False, True])
def test_the_answer_of_pixels_is_equation_6_sample_by_sample(last: bool) -> None:
    seen, _ = scene_of_masks(2)
    seen = seen._replace(distances=np.where(seen.distances > 8.0, np.float32(40.0), seen.distances))
    row, answers = rules(last=last, share=0.5), []
    for half in (2.0, 30.0, 110.0):
        for centre in places(4, 160):
            for view, camera in enumerate(VIEWS):
                rows = place_of(view, half, centre)
                if not rows[projection.SEEN, 3]:
                    continue
                most = projection.count_samples(rows.reshape(-1), projection.LANES, 1.0)
                pixels = np.empty((most, projection.LANES))
                given = most, float(camera.width), float(camera.height), HEIGHTS, pixels.reshape(-1)
                projection.sample_pixels(rows.reshape(-1), *given)
                expected, share = plain_pixels_look(seen.distances, view, rows[:, 3], pixels[:, 3], row)
                answer = kernels.look_at_pixels(seen, view, row, rows.reshape(-1), 3, pixels.reshape(-1))
                assert answer == expected
                assert rows[projection.SHARE, 3] == share
                answers.append(expected)
    assert len(set(answers)) == (3 if last else 4)


@pytest.mark.parametrize("by_pixels", [False, True])
@pytest.mark.parametrize(("last", "least_views"), [(False, 1), (False, 3), (True, 2)])
def test_a_voxels_verdict_is_that_of_its_views_one_after_the_other(
    by_pixels: bool, last: bool, least_views: int
) -> None:
    seen, masks = scene_of_masks(3)
    inside = np.concatenate([mask.ravel() for mask in masks]) > 0
    distances = np.where(inside, np.float32(40.0), np.float32(1.0))
    seen = seen._replace(by_pixels=by_pixels, distances=distances)
    rng, corner, edge = np.random.default_rng(5), np.array([-960.0, -960.0, -60.0]), 60.0
    row = rules(last=last)._replace(least_views=least_views)
    nodes = np.unique(rng.integers(0, 32, (400, 3)), axis=0).astype(np.int32)
    states = np.zeros((len(nodes), 3), np.uint32)
    states[:, 2] = rng.integers(0, 3, len(nodes))
    states[rng.random(len(nodes)) < 0.2, 0 if not by_pixels else 1] |= np.uint32(2)
    before, verdicts = states.copy(), np.full(len(nodes), 9, np.uint8)
    kernels.judge(10, 330, nodes, states, verdicts, corner, edge, seen, row)
    for index, node in enumerate(nodes):
        sure, blind, begins = (int(value) for value in before[index])
        if not 10 <= index < 330:
            assert verdicts[index] == 9
            assert (states[index] == before[index]).all()
            continue
        looked = edges = 0
        least, first, carved = 2.0, begins, False
        for turn in range(3):
            view = (begins + turn) % 3
            if sure >> view & 1:
                looked += 1
                continue
            if blind >> view & 1:
                continue
            rows = place_of(view, 0.5 * edge, corner + (node + 0.5) * edge)
            answer = kernels.UNSEEN
            if rows[projection.SEEN, 0]:
                if by_pixels:
                    most = projection.count_samples(rows.reshape(-1), projection.LANES, 1.0)
                    pixels = np.empty(most * projection.LANES)
                    size = float(VIEWS[view].width), float(VIEWS[view].height)
                    projection.sample_pixels(rows.reshape(-1), most, *size, HEIGHTS, pixels)
                    answer = kernels.look_at_pixels(seen, view, row, rows.reshape(-1), 0, pixels)
                else:
                    answer = kernels.look_at_mask(seen, view, row, rows.reshape(-1), 0)
            if answer == kernels.BACKGROUND:
                carved = True
                break
            if answer == kernels.UNSEEN:
                blind |= 1 << view
                continue
            looked += 1
            if rows[projection.SHARE, 0] < least and not (last and not by_pixels):
                least, first = rows[projection.SHARE, 0], view
            edges += answer == kernels.EDGE
            if answer == kernels.FOREGROUND and not by_pixels:
                sure |= 1 << view
        if carved or looked < least_views:
            assert verdicts[index] == kernels.CARVED
        else:
            assert verdicts[index] == (kernels.SPLIT if edges else kernels.KEPT)
        if not carved:
            assert states[index, :2].tolist() == [sure, blind]
            assert last or states[index, 2] == first
    assert {kernels.CARVED, kernels.KEPT} <= set(verdicts.tolist())
    assert last or kernels.SPLIT in verdicts


def test_a_first_look_says_who_sees_a_voxel_and_how_many_samples_it_takes() -> None:
    rng, corner, edge = np.random.default_rng(6), np.array([-2400.0, -2400.0, -1500.0]), 150.0
    nodes = np.unique(rng.integers(0, 32, (400, 3)), axis=0).astype(np.int32)
    states, samples = np.zeros((len(nodes), 3), np.uint32), np.zeros(len(nodes), np.int64)
    first_look(nodes, corner, edge, TABLE, 1.5, states, samples)
    for node, state, most in zip(nodes, states, samples, strict=True):
        blind, whole, expected = 0, 0, 0
        for view, camera in enumerate(VIEWS):
            place = place_of(view, 75.0, corner + (node + 0.5) * edge)[:, 0]
            if not place[projection.SEEN]:
                blind |= 1 << view
                continue
            expected = max(expected, math.ceil(1.5 * math.sqrt(place[projection.AREA]) - 1e-9))
            middle = place[[projection.U, projection.V]]
            reach = place[[projection.BOUND_X, projection.BOUND_Y]]
            size = np.array([camera.width, camera.height])
            if (middle + reach < -0.5).any() or (middle - reach > size - 0.5).any():
                blind |= 1 << view
            elif (middle - reach >= 0.0).all() and (middle + reach <= size - 1.0).all():
                whole = view
        assert state.tolist() == [0, blind, whole]
        assert most == expected
    assert len(np.unique(states[:, 1])) > 5
    assert len(np.unique(states[:, 2])) == 3


@pytest.mark.parametrize("by_pixels", [False, True])
def test_a_voxels_colour_is_that_of_its_samples_before_the_background(by_pixels: bool) -> None:
    seen, masks = scene_of_masks(4)
    inside = np.concatenate([mask.ravel() for mask in masks]) > 0
    rule = rules()
    differs = seen.distances > np.float32(rule.single) if by_pixels else inside
    seen = seen._replace(by_pixels=by_pixels)
    centres, edges = places(7, 120), np.repeat([20.0, 60.0, 150.0], [70, 1, 49])
    views, means = np.full((120, 3, 3), -1.0, np.float32), np.full((120, 3), -1.0, np.float32)
    colour(20, 115, centres, edges, seen, rule, views, means)
    assert (views[:20] == -1.0).all()
    assert (means[115:] == -1.0).all()
    unseen = 0
    for index in range(20, 115):
        everything, of_views = [], []
        for view, camera in enumerate(VIEWS):
            rows = place_of(view, 0.5 * edges[index], centres[index])
            most = projection.count_samples(rows.reshape(-1), projection.LANES, 1.0)
            pixels = np.empty((most, projection.LANES))
            size = float(camera.width), float(camera.height)
            projection.sample_pixels(rows.reshape(-1), most, *size, HEIGHTS, pixels.reshape(-1))
            count = int(rows[projection.COUNT, 0]) if rows[projection.SEEN, 0] else 0
            at = [BEGINS[0, view] + int(pixel) for pixel in pixels[:count, 0] if pixel >= 0]
            everything += at
            shown = [pixel for pixel in at if differs[pixel]]
            if shown:
                of_views.append(seen.picture[shown].mean(axis=0))
                np.testing.assert_allclose(views[index, view], of_views[-1], rtol=1e-5)
            else:
                assert np.isnan(views[index, view]).all()
        if of_views:
            np.testing.assert_allclose(means[index], np.mean(of_views, axis=0), rtol=1e-5)
        elif everything:
            np.testing.assert_allclose(means[index], seen.picture[everything].mean(axis=0), rtol=1e-5)
            unseen += 1
        else:
            assert np.isnan(means[index]).all()
    assert 5 < unseen < 90


def test_voxels_of_one_edge_are_set_together_up_to_sixteen() -> None:
    centres, edges = np.arange(90.0).reshape(30, 3), np.repeat([2.0, 3.0, 2.0], [20, 4, 6])
    for first, end, count in ((0, 30, 16), (16, 30, 4), (20, 30, 4), (20, 22, 2), (24, 30, 6), (29, 30, 1)):
        rows = np.zeros((projection.ROWS, projection.LANES))
        assert projection.set_centres(rows.reshape(-1), centres, edges, first, end) == count
        set_rows = rows[projection.CENTRE : projection.CENTRE + 3, :count].T
        np.testing.assert_array_equal(set_rows, centres[first : first + count])
        assert not rows[:, count:].any()
        assert not np.delete(rows, range(projection.CENTRE, projection.CENTRE + 3), axis=0).any()
