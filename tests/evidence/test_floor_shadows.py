"""What looks like a shadow is one only where every camera that sees that place of the floor sees it changed."""

import cv2
import numpy as np
import pytest
from drawn_people import ring_of_cameras
from toy_footage import looking_at

from studio.evidence.floor_shadows import (
    BARELY_SEEN,
    DENIED,
    DOUBTED,
    LIES_THERE,
    SEEN_ONCE,
    SUBJECT,
    UNKNOWN,
    Cells,
    FloorShadows,
    _drop_lesser_parts,
    _maps,
    _middle_seen,
    _settled,
    cells_of,
    lowest_changed,
    on_floor,
    pixels_of,
    seen_at,
)
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

CAMERAS = ring_of_cameras(4, 640, 480)


def not_measured(kinds: np.ndarray, size: int) -> Cells:
    """Cells whose brightness is not known."""
    return Cells(kinds, size, np.zeros(kinds.shape, np.float32))


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> np.ndarray:
    """(8, 3) corners, mm."""
    return np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T


def with_cells(mask: np.ndarray, like: np.ndarray, chosen: np.ndarray, size: int) -> np.ndarray:
    """A mask with what looks like a shadow in cells that are the subject's."""
    grown = pixels_of(like, chosen == SUBJECT, size)
    return mask if grown is None else mask | grown


TRUNK = box((-150.0, -150.0, 0.0), (150.0, 150.0, 1700.0))
ARM = box((150.0, -40.0, 1300.0), (650.0, 40.0, 1380.0))
SHADOW = box((-900.0, 100.0, 0.0), (-200.0, 700.0, 0.0))


def drawn(camera: Camera, corners: np.ndarray) -> np.ndarray:
    """(H, W) 255 inside the projection of a convex thing."""
    picture = np.zeros((camera.height, camera.width), np.uint8)
    hull = cv2.convexHull(np.rint(project(camera, corners)[0]).astype(np.int32))
    return cv2.fillConvexPoly(picture, hull, 255)


def told(raised: float = 0.0, cameras: tuple[Camera, ...] = CAMERAS) -> tuple[float, float]:
    """Shares of an arm and of a shadow that count as the subject, where both look like shadows. raised : mm of all."""
    up = np.array((0.0, 0.0, raised))
    trunks, arms, shadows = (
        [drawn(camera, thing + up) for camera in cameras] for thing in (TRUNK, ARM, SHADOW)
    )
    arms = [arm & ~trunk for arm, trunk in zip(arms, trunks, strict=True)]
    shadows = [shadow & ~trunk & ~arm for shadow, trunk, arm in zip(shadows, trunks, arms, strict=True)]
    like = [arm | shadow for arm, shadow in zip(arms, shadows, strict=True)]
    seen = [cells_of(trunk, one) for trunk, one in zip(trunks, like, strict=True)]
    tells = FloorShadows(cameras)
    assert tells.usable
    chosen = tells.unexplained(seen)
    masks = [
        with_cells(trunk, one, own, cells.size)
        for trunk, one, own, cells in zip(trunks, like, chosen, seen, strict=True)
    ]
    assert all((mask >= trunk).all() for mask, trunk in zip(masks, trunks, strict=True))

    def share(wanted: list[np.ndarray]) -> float:
        return sum(int((m & w).sum()) for m, w in zip(masks, wanted, strict=True)) / sum(
            int(w.sum()) for w in wanted
        )

    return share(arms), share(shadows)


def test_an_arm_is_the_subjects_and_a_shadow_is_not() -> None:
    arm, shadow = told()
    assert arm > 0.75
    assert shadow < 0.01


def test_a_floor_that_is_not_at_zero_is_found() -> None:
    """Else the shadow on a table would lie well above the floor, and be taken for the subject."""
    arm, shadow = told(raised=500.0)
    assert arm > 0.75
    assert shadow < 0.02


def test_two_cameras_tell_too() -> None:
    arm, shadow = told(cameras=CAMERAS[:2])
    assert arm > 0.4
    assert shadow < 0.05


def test_nothing_changes_without_anything_like_a_shadow() -> None:
    seen = [cells_of(drawn(camera, TRUNK), None) for camera in CAMERAS]
    assert not any(one.any() for one in FloorShadows(CAMERAS).unexplained(seen))


def test_cells_say_what_most_of_their_pixels_are() -> None:
    mask, shadow = np.zeros((480, 640), np.uint8), np.zeros((480, 640), np.uint8)
    mask[100:120, 100:120], shadow[100:120, 120:140] = 255, 255
    shadow[200, 200] = 255  # a speck
    cells = cells_of(mask, shadow)
    assert cells.kinds.shape == (240, 320)
    wanted = np.zeros((240, 320), np.uint8)
    wanted[50:60, 50:60], wanted[50:60, 60:70] = 1, 2
    np.testing.assert_array_equal(cells.kinds, wanted)
    chosen = np.zeros_like(wanted)
    chosen[50:60, 60:65] = 1
    grown = with_cells(mask, shadow, chosen, cells.size)
    np.testing.assert_array_equal(grown - mask, np.where(np.arange(640) < 130, shadow, 0) * (grown > 0))


@pytest.mark.parametrize("size", [(640, 480), (650, 487)])
def test_pictures_that_are_no_whole_number_of_cells(size: tuple[int, int]) -> None:
    full = np.full(size[::-1], 255, np.uint8)
    cells = cells_of(full, np.zeros_like(full))
    assert (cells.kinds[:-1, :-1] == 1).all()
    everything = with_cells(np.zeros_like(full), full, np.ones_like(cells.kinds), cells.size)
    np.testing.assert_array_equal(everything, full)


def test_cameras_that_all_look_one_way_or_lie_on_the_floor_tell_nothing() -> None:
    assert not FloorShadows(CAMERAS[:1]).usable
    stereo = (CAMERAS[0], CAMERAS[0])
    assert not FloorShadows(stereo).usable
    sunk = [Camera(**{**fields(camera), "translation": lowered(camera)}) for camera in CAMERAS]
    assert not FloorShadows(sunk).usable


def fields(camera: Camera) -> dict[str, object]:
    return {name: getattr(camera, name) for name in Camera.__dataclass_fields__}


def lowered(camera: Camera) -> np.ndarray:
    """The translation of a camera at z = 0."""
    centre = camera.centre * (1.0, 1.0, 0.0)
    return -camera.rotation @ centre


def test_a_shadow_that_only_one_camera_films_stays_one() -> None:
    """No other camera can deny it."""
    alone = [not_measured(np.zeros((240, 320), np.uint8), 2) for _ in CAMERAS]
    alone[0].kinds[200:210, 5:15] = 2
    assert not any(one.any() for one in FloorShadows(CAMERAS).unexplained(alone))


@pytest.mark.parametrize("size", [(700, 31), (33, 640), (960, 48), (320, 24), (321, 20)])
def test_a_cells_kind_is_that_of_its_pixels(size: tuple[int, int]) -> None:
    """Changed from 0.375 of its area on, like a shadow from half of what changed in it on; both in bytes."""
    rng = np.random.default_rng(size)
    side = -(-max(size) // 320)
    rows, columns = -(-size[1] // side), -(-size[0] // side)
    share = np.kron(rng.random((rows, columns)) ** 2, np.ones((side, side)))[: size[1], : size[0]]
    passing = np.kron(rng.random((rows, columns)), np.ones((side, side)))[: size[1], : size[0]]
    drawn_pixels = rng.random(share.shape)
    shadow = np.where(
        (drawn_pixels < share) & (rng.random(share.shape) < passing), np.uint8(255), np.uint8(0)
    )
    mask = np.where(drawn_pixels < share, np.uint8(255), np.uint8(0)) & ~shadow
    mask[:5], mask[:, :5], mask[-1], mask[0] = 0, 0, 255, 0
    shadow[:, :7] = 0
    for given in (shadow, None):
        wanted = np.zeros((rows, columns), np.uint8)
        for row, column in np.ndindex(rows, columns):
            place = np.s_[row * side : (row + 1) * side, column * side : (column + 1) * side]
            changed = mask[place] if given is None else mask[place] | shadow[place]
            everything = np.rint(255 * np.count_nonzero(changed) / side**2)
            passing_bytes = (
                np.rint(255 * np.count_nonzero(shadow[place]) / side**2) if given is not None else 0
            )
            if everything / 255 >= 0.375:
                wanted[row, column] = 2 if passing_bytes >= 0.5 * everything else 1
        cells = cells_of(mask, given)
        assert cells.size == side
        np.testing.assert_array_equal(cells.kinds, wanted)
        assert given is None or len(np.unique(wanted)) == 3
    nothing = cells_of(np.zeros_like(mask), np.zeros_like(mask))
    assert nothing.kinds.shape == (rows, columns)
    assert not nothing.kinds.any()


def small(number: int, bent: float = 1.0) -> Camera:
    """One of a ring, of a few pixels, turned about its axis and moved aside, of a lens that folds within sight."""
    camera = ring_of_cameras(4, 24, 20)[number]
    lens = bent * np.array([-0.3 - 0.1 * number, 0.02, 0.004, -0.003, 0.001])
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    skewed = camera.matrix + np.array(
        [[0.0, 0.2 * (number if bent == 1.0 else 0), 0.0], [0, 0, 0], [0, 0, 0]]
    )
    changes = {
        "matrix": skewed,
        "distortion": lens,
        "rotation": turn @ camera.rotation,
        "translation": turn @ camera.translation + (150.0, -90.0, 0.0),
    }
    return Camera(**{**fields(camera), **changes})


SMALL = tuple(small(number) for number in range(4))
SIDES = (4, 2, 3, 1)


def views_of(cameras: tuple[Camera, ...]) -> np.ndarray:
    return FloorShadows(cameras)._views


def random_cells(seed: int, share: float = 0.5) -> list[Cells]:
    rng = np.random.default_rng(seed)
    return [
        not_measured(
            (rng.random((-(-20 // side), -(-24 // side))) < share).astype(np.uint8) * rng.integers(1, 3), side
        )
        for side in SIDES
    ]


def plainly_seen(cells: list[Cells], owner: int, place: np.ndarray, most: int) -> tuple[int, int]:
    changed = unchanged = 0
    for number, (camera, one) in enumerate(zip(SMALL, cells, strict=True)):
        x, y, depth = camera.rotation @ place + camera.translation
        square = (x * x + y * y) / depth**2
        k1, k2, _, _, k3 = camera.distortion
        if number == owner or depth <= 0.0 or 1.0 + k1 * square + k2 * square**2 + k3 * square**3 <= 0.0:
            continue
        pixel = np.nan_to_num(project(camera, place)[0], nan=-99.0).clip(-99.0, 99.0)
        column, row = np.floor((pixel + 0.5) / one.size).astype(int)
        if 0 <= column < one.kinds.shape[1] and 0 <= row < one.kinds.shape[0]:
            if one.kinds[row, column]:
                changed += 1
            else:
                unchanged += 1
                if unchanged == most:
                    break
    return changed, unchanged


def test_how_many_see_a_place_is_what_its_projections_say() -> None:
    rng = np.random.default_rng(4)
    cells = random_cells(0)
    kinds, maps = np.concatenate([one.kinds.ravel() for one in cells]), _maps(cells)
    places = np.concatenate(
        [
            rng.uniform([-3000, -3000, -500], [3000, 3000, 3000], (600, 3)),
            rng.uniform(-9000, 9000, (600, 3)),
            *(camera.centre + np.array((0.03, 0.05, 0.5)) @ camera.rotation for camera in SMALL),
        ],
        axis=None,
    ).reshape(-1, 3)
    views, answers = views_of(SMALL), set()
    for place in places:
        for owner, most in ((0, 1), (1, 2), (3, 4)):
            expected = plainly_seen(cells, owner, place, most)
            assert seen_at(kinds, maps, views, owner, *place, most) == expected
            answers.add(expected)
    assert len(answers) > 8


def random_rays(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Cameras' numbers and directions of unit length, some of them upwards."""
    rng = np.random.default_rng(count)
    owners = rng.integers(0, 4, count)
    aims = rng.uniform([-900, -900, 0], [900, 900, 1800], (count, 3))
    rays = aims - np.array([SMALL[owner].centre for owner in owners])
    rays[::7, 2] *= -1.0
    return owners, rays / np.linalg.norm(rays, axis=1, keepdims=True)


def cell_around(one: Cells, camera: Camera, place: np.ndarray) -> tuple[slice, slice] | None:
    """Rows and columns of the cell in which a camera sees a place and those beside it; None where it does not."""
    x, y, depth = camera.rotation @ place + camera.translation
    square = (x * x + y * y) / depth**2
    k1, k2, _, _, k3 = camera.distortion
    if depth <= 0.0 or 1.0 + k1 * square + k2 * square**2 + k3 * square**3 <= 0.0:
        return None
    pixel = np.nan_to_num(project(camera, place)[0], nan=-99.0).clip(-99.0, 99.0)
    column, row = np.floor((pixel + 0.5) / one.size).astype(int)
    if not (0 <= column < one.kinds.shape[1] and 0 <= row < one.kinds.shape[0]):
        return None
    return slice(max(0, row - 1), row + 2), slice(max(0, column - 1), column + 2)


def plainly_explained(
    cells: list[Cells], owner: int, place: np.ndarray, own: float, tolerance: float, doubts: bool
) -> int:
    seen = []
    for number, (camera, one) in enumerate(zip(SMALL, cells, strict=True)):
        around = None if number == owner else cell_around(one, camera, place)
        if around is None:
            continue
        kinds, light = one.kinds[around], one.brightness[around]
        if own == 0.0:
            seen.append("shadow" if kinds.any() else "bare")
            continue
        like = kinds == 2
        if like.any():
            logs = np.log(light[like])
            if logs.min() - tolerance <= np.log(own) <= logs.max() + tolerance:
                seen.append("shadow")
                continue
        seen.append("hidden" if cell_middle(one, camera, place) == 1 else "bare")
    shadows, bare = seen.count("shadow"), seen.count("bare")
    if own == 0.0 or not doubts:
        return LIES_THERE if shadows or (seen and not bare) else DENIED
    if shadows == 0:
        return DOUBTED if seen and not bare else DENIED
    if shadows >= 2 or len(seen) == 1:
        return LIES_THERE
    return BARELY_SEEN if bare >= 2 else SEEN_ONCE


def cell_middle(one: Cells, camera: Camera, place: np.ndarray) -> int:
    column, row = np.floor((project(camera, place)[0] + 0.5) / one.size).astype(int)
    return int(one.kinds[row, column])


@pytest.mark.parametrize("height", [0.0, 300.0])
@pytest.mark.parametrize(("known", "doubts"), [(False, False), (True, False), (False, True), (True, True)])
def test_the_floor_explains_a_cell_where_another_camera_sees_a_shadow_as_dark(
    height: float, known: bool, doubts: bool
) -> None:
    """Or, where the cell's own brightness is not known, anything that changed. Where doubts are asked for, one camera
    of several is not enough to be certain, and less so where two see bare floor.
    """
    owners, rays = random_rays(300)
    rng = np.random.default_rng(9)
    own = rng.uniform(0.4, 1.0, 300).astype(np.float32) * known
    told_apart: set[int] = set()
    for share in (0.1, 0.9):
        cells = [
            Cells(
                np.where(rng.random(one.kinds.shape) < share, rng.integers(1, 3, one.kinds.shape), 0).astype(
                    np.uint8
                ),
                one.size,
                rng.uniform(0.4, 1.0, one.kinds.shape).astype(np.float32),
            )
            for one in random_cells(1)
        ]
        kinds, light = (
            np.concatenate([getattr(one, name).ravel() for one in cells]) for name in ("kinds", "brightness")
        )
        explained = on_floor(
            kinds, light, _maps(cells), views_of(SMALL), owners, rays, own, 0.05, height, doubts
        )
        expected = []
        for owner, ray, mine in zip(owners, rays, own, strict=True):
            centre = SMALL[owner].centre
            place = centre + (height - centre[2]) / ray[2] * ray
            told = plainly_explained(cells, int(owner), place, float(mine), 0.05, doubts)
            expected.append(told if ray[2] < 0.0 else DENIED)
        np.testing.assert_array_equal(explained, expected)
        assert 2 < np.count_nonzero(expected) < 290
        told_apart.update(expected)
    everything = {DENIED, BARELY_SEEN, DOUBTED, SEEN_ONCE, LIES_THERE}
    assert told_apart == (everything if known and doubts else {DENIED, LIES_THERE})


@pytest.mark.parametrize("certain", [0.2, 0.8])
def test_what_one_camera_confirms_is_a_shadow_where_nearly_all_around_are_confirmed(certain: float) -> None:
    """Of the cells around, seven along a side, those that look like a shadow; without them one half is no shadow."""
    rng, shape = np.random.default_rng(3), (40, 50)
    own = np.sort(rng.choice(40 * 50, 1200, replace=False))
    others = (1.0 - certain) / 4
    codes = [DENIED, BARELY_SEEN, DOUBTED, SEEN_ONCE, LIES_THERE]
    said = rng.choice(codes, 1200, p=[others / 4, others, others / 4, 2.5 * others, certain]).astype(np.uint8)
    picture = np.full(shape, -1)
    picture.ravel()[own] = said
    expected = []
    for cell, code in zip(own, said, strict=True):
        row, column = divmod(int(cell), 50)
        # Beyond its border the picture is mirrored there.
        rows, columns = (
            np.array([min(abs(i), 2 * (count - 1) - abs(i)) for i in range(at - 3, at + 4)])
            for at, count in ((row, 40), (column, 50))
        )
        around = picture[np.ix_(rows, columns)]
        like, confirmed = (around >= 0).sum(), np.isin(around, [BARELY_SEEN, SEEN_ONCE, LIES_THERE]).sum()
        if code in (BARELY_SEEN, SEEN_ONCE):
            unsure = DENIED if code == BARELY_SEEN else DOUBTED
            code = LIES_THERE if confirmed >= 0.97 * like else unsure
        expected.append(code)
    np.testing.assert_array_equal(_settled(said, own, shape), expected)
    waiting = np.isin(said, [BARELY_SEEN, SEEN_ONCE])
    settled = (np.array(expected)[waiting] == LIES_THERE).mean()
    assert 0.02 < settled < 0.98


LEG = box((-120.0, -120.0, 150.0), (120.0, 120.0, 500.0))


@pytest.mark.parametrize("alike", [False, True])
def test_a_leg_before_a_shadow_that_is_not_as_dark_is_the_subjects(alike: bool) -> None:
    """It stands in its own shadow, so that all cameras see the floor behind it changed."""
    upper = [drawn(camera, box((-150.0, -150.0, 500.0), (150.0, 150.0, 1700.0))) for camera in CAMERAS]
    legs = [drawn(camera, LEG) & ~own for camera, own in zip(CAMERAS, upper, strict=True)]
    around = [
        drawn(camera, box((-850.0, -850.0, 0.0), (850.0, 850.0, 0.0))) & ~own & ~leg
        for camera, own, leg in zip(CAMERAS, upper, legs, strict=True)
    ]
    seen = []
    for own, leg, shadow in zip(upper, legs, around, strict=True):
        like = leg | shadow
        cells = cells_of(own, like)
        small = cv2.resize(leg, cells.kinds.shape[::-1], interpolation=cv2.INTER_AREA)
        light = np.where(small > 127, 0.6 if alike else 0.9, 0.6).astype(np.float32)
        seen.append(cells_of(own, like, np.where(cells.kinds == 2, light, 0.0).astype(np.float32)))
    tells, shares = FloorShadows(CAMERAS), []
    for tolerance in (0.1, 0.0):
        chosen = tells.unexplained(seen if tolerance else [without(one) for one in seen], tolerance)
        masks = [
            with_cells(np.zeros_like(own), leg | shadow, cell, one.size)
            for own, leg, shadow, cell, one in zip(upper, legs, around, chosen, seen, strict=True)
        ]
        shares += [
            sum(int((mask & part).sum()) for mask, part in zip(masks, parts, strict=True))
            / sum(int(part.sum()) for part in parts)
            for parts in (legs, around)
        ]
    leg, shadow, before, shadow_before = shares
    assert before < 0.05
    assert max(shadow, shadow_before) < 0.01
    assert leg < 0.05 if alike else leg > 0.75


@pytest.mark.parametrize(
    ("confirming", "strip", "unknown"), [(2, True, True), (2, False, False), (4, False, False)]
)
def test_what_one_camera_alone_confirms_is_unknown_unless_all_around_is_confirmed(
    confirming: int, strip: bool, unknown: bool
) -> None:
    """Two cameras see the shadow, and its place is hidden from the two others, which see what stands above it: of these
    two each has one that confirms it, of four that see it each has three. Or the second sees a strip of it alone.
    """
    above = box((-200.0, -200.0, 250.0), (200.0, 200.0, 450.0))
    things = [drawn(camera, above) for camera in CAMERAS]
    floor = [drawn(camera, box((-1800.0, -1800.0, 0.0), (1800.0, 1800.0, 0.0))) for camera in CAMERAS]
    seen = []
    for number, (camera, thing, shadow) in enumerate(zip(CAMERAS, things, floor, strict=True)):
        passing = thing | shadow if number < confirming else np.zeros_like(thing)
        if strip and number == 1:
            passing = drawn(camera, box((-1800.0, -30.0, 0.0), (1800.0, 30.0, 0.0)))
        mask = (thing | shadow) & ~passing
        kinds = cells_of(mask, passing).kinds
        seen.append(cells_of(mask, passing, np.where(kinds == 2, 0.6, 0.0).astype(np.float32)))
    for doubts in (False, True):
        cells = FloorShadows(CAMERAS).unexplained(seen, 0.1, doubts)[0]
        own = cv2.resize(things[0], cells.shape[::-1], interpolation=cv2.INTER_AREA) > 127
        assert not (cells[own] == SUBJECT).any()
        share = float((cells[own] == UNKNOWN).mean())
        assert share > 0.8 if unknown and doubts else share < 0.02


def test_what_is_no_shadow_and_nothing_else_either_is_unknown() -> None:
    """The other cameras see the floor there bare, and nothing above it."""
    seen = [cells_of(drawn(camera, TRUNK), None) for camera in CAMERAS]
    seen[0].kinds[200:230, 5:35], seen[0].brightness[200:230, 5:35] = 2, 0.6
    patch = np.zeros_like(seen[0].kinds)
    patch[200:230, 5:35] = UNKNOWN
    known, doubted = (FloorShadows(CAMERAS).unexplained(seen, 0.1, doubts) for doubts in (False, True))
    assert not any(one.any() for one in known)
    np.testing.assert_array_equal(doubted[0], patch)
    assert not any(one.any() for one in doubted[1:])


def without(cells: Cells) -> Cells:
    return not_measured(cells.kinds, cells.size)


@pytest.mark.parametrize("least", [1, 2])
def test_the_lowest_place_on_a_ray_is_the_first_from_its_far_end(least: int) -> None:
    owners, rays = random_rays(150)
    cells = random_cells(2, 0.85)
    kinds = np.concatenate([one.kinds.ravel() for one in cells])
    explained = np.random.default_rng(2).random(len(rays)) < 0.1
    box = np.array([[-2500.0, -900.0, 100.0], [800.0, 2600.0, 1900.0]])
    places = lowest_changed(kinds, _maps(cells), views_of(SMALL), owners, rays, explained, box, 70.0, least)
    expected = np.full_like(places, np.inf)
    for k, (owner, ray) in enumerate(zip(owners, rays, strict=True)):
        centre = SMALL[owner].centre
        ends = np.sort((box - centre) / ray, axis=0)
        first, along = max(0.0, ends[0].max()), ends[1].min()
        while not explained[k] and along > first:
            changed, unchanged = plainly_seen(cells, int(owner), centre + along * ray, 9)
            if changed >= least and not unchanged:
                expected[k] = centre + along * ray
                break
            along -= 70.0
    np.testing.assert_allclose(places, expected, atol=1e-9)
    assert 30 < np.isfinite(places[:, 0]).sum() < 130


def test_cells_rays_pass_through_their_middles() -> None:
    mild = (small(1, 0.1), small(2, 0.1))
    tells, cells = (
        FloorShadows(mild),
        [not_measured(np.zeros((10, 12), np.uint8), 2), not_measured(np.zeros((7, 8), np.uint8), 3)],
    )
    owners, rays = tells._rays_through(cells, [np.array([5, 13, 117]), np.array([0, 9, 33, 55])])
    assert owners.tolist() == [0, 0, 0, 1, 1, 1, 1]
    middles = [(10.5, 0.5), (2.5, 2.5), (18.5, 18.5), (1.0, 1.0), (4.0, 4.0), (4.0, 13.0), (22.0, 19.0)]
    for owner, ray, middle in zip(owners, rays, middles, strict=True):
        camera = mild[owner]
        assert np.linalg.norm(ray) == pytest.approx(1.0)
        np.testing.assert_allclose(project(camera, camera.centre + 2000.0 * ray)[0], middle, atol=0.02)
    assert _maps(cells).tolist() == [[0, 10, 12, 2], [120, 7, 8, 3]]


def test_pieces_of_which_too_little_is_chosen_are_dropped() -> None:
    kinds = np.zeros((20, 60), np.uint8)
    kinds[2:7, 2:12], kinds[2:7, 20:30], kinds[12:17, 2:12] = 2, 2, 2
    kinds[7, 12] = 2  # touches the first by a corner: 51 cells
    kinds[10, 40:50] = 1
    chosen = np.zeros_like(kinds)
    chosen[3, 3:6] = chosen[3, 21:24] = chosen[13, 3:5] = 1
    _drop_lesser_parts(chosen, kinds)
    wanted = np.zeros_like(kinds)
    wanted[3, 21:24] = 1
    np.testing.assert_array_equal(chosen, wanted)


def test_the_middle_is_where_the_axes_meet() -> None:
    target, places = (
        np.array([200.0, -300.0, 900.0]),
        np.array([[3.0, 0, 1], [0, 4.0, 1], [-1.0, 0, 2.0]]) * 1000.0,
    )
    axes = (target - places) / np.linalg.norm(target - places, axis=1, keepdims=True)
    middle, distance = _middle_seen(places, axes)
    np.testing.assert_allclose(middle, target, atol=1e-6)
    assert distance == pytest.approx(np.median(np.linalg.norm(target - places, axis=1)))
    for degrees, seen in ((5.6, False), (5.9, True)):
        turn = np.deg2rad(degrees)
        two = np.array([[np.cos(turn), np.sin(turn), 0.0], [np.cos(turn), -np.sin(turn), 0.0]])
        middle, distance = _middle_seen(-1000.0 * two, two)
        assert np.isfinite(distance) == seen
        np.testing.assert_allclose(middle, np.zeros(3), atol=1e-6)


@pytest.mark.parametrize(("height", "usable"), [(0.075, False), (0.085, True)])
def test_cameras_have_to_stand_well_above_the_floor(height: float, usable: bool) -> None:
    """All of them, in shares of their distance from what they look at: a camera that is lowered looks on as before."""
    cameras = [looking_at("a", place, (0.0, 0.0, 1000.0 * height)) for place in SIDEWAYS[:2]]
    cameras.append(looking_at("low", (0.0, -1000.0, 1000.0 * height), (0.0, 0.0, 1000.0 * height)))
    assert FloorShadows(cameras).usable == usable


SIDEWAYS = ((1000.0, 0.0, 200.0), (0.0, 1000.0, 200.0))


def test_the_scene_is_around_what_changed_from_the_floor_upwards() -> None:
    """With a share of the cameras' distance around it. What stands well above z = 0 stands on the lowest of it."""
    for raised in (0.0, 700.0):
        cells = [
            cells_of(drawn(camera, TRUNK + np.array((300.0, -200.0, raised))), None) for camera in CAMERAS
        ]
        tells, maps = FloorShadows(CAMERAS), _maps(cells)
        kinds = np.concatenate([one.kinds.ravel() for one in cells])
        scene = tells._scene(kinds, cells, maps)
        distance = np.median([np.linalg.norm(camera.centre - tells._middle) for camera in CAMERAS])
        around = 0.05 * distance
        chosen = [np.flatnonzero(one.kinds) for one in cells]
        stride = 1 + sum(map(len, chosen)) // 800
        owners, rays = tells._rays_through(cells, [own[::stride] for own in chosen])
        box = np.array([[-1.5, -1.5, 0.0], [1.5, 1.5, 1.5]]) * distance + tells._middle * (1.0, 1.0, 0.0)
        none = np.zeros(len(rays), np.bool_)
        places = lowest_changed(kinds, maps, tells._views, owners, rays, none, box, 0.012 * distance, 2)
        places = places[np.isfinite(places[:, 0])]
        wanted = np.array([places.min(axis=0) - around, places.max(axis=0) + around])
        wanted[0, 2] = np.quantile(places[:, 2], 0.03) if raised else 0.0
        np.testing.assert_allclose(scene, wanted)
        assert abs(scene[0, 2] - raised) < 60.0
        np.testing.assert_allclose(scene[0, :2], (150.0 - around, -350.0 - around), atol=150.0)
    nothing = [not_measured(np.zeros((240, 320), np.uint8), 2) for _ in CAMERAS]
    assert FloorShadows(CAMERAS)._scene(np.zeros(4 * 240 * 320, np.uint8), nothing, _maps(nothing)) is None
