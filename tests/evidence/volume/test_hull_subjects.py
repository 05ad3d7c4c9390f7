"""Whose voxels are whose, on hulls drawn voxel by voxel, against plain loops."""

import numpy as np
import pytest
from toy_footage import rig

from studio.evidence.volume import hull_subjects
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_pieces import chosen_voxels, piece_numbers
from studio.evidence.volume.hull_silhouette import silhouette
from studio.evidence.volume.hull_subjects import (
    NOBODY,
    HullFollower,
    HullSubject,
    label_silhouettes,
    labels_at,
    real_pieces,
    subjects_of,
)
from studio.evidence.volume.tracking_space import Box

UNIT = 50.0
BOX = Box(np.array([-1600.0, -1600.0, 0.0]), np.array([1600.0, 1600.0, 3200.0]))
Cells = list[tuple[int, int, int]]


def block(x: int, y: int, wide: int, deep: int = 1, high: int = 1) -> Cells:
    return [(x + i, y + j, k) for i in range(wide) for j in range(deep) for k in range(high)]


def hull_of(cells: Cells, sides: list[int] | None = None) -> Hull:
    """Voxels by their lowest cells of 50 mm, the middle of the first at x = y = 25 mm."""
    edges = UNIT * np.array(sides or [1] * len(cells), float)
    centres = np.array(cells, float).reshape(-1, 3) * UNIT + 0.5 * edges[:, None]
    unseen = np.zeros((len(cells), 3), np.float32)
    return Hull(centres, edges, unseen, unseen[:, None], 6, BOX)


Seen = dict[int, tuple[str, ...]]


def see(monkeypatch: pytest.MonkeyPatch, seen: Seen) -> None:
    """Give pieces of so many voxels their silhouettes: a row of pixels, X covered, for each camera."""
    monkeypatch.setattr(
        hull_subjects, "silhouette", lambda hull, camera: row_of(seen[len(hull.centres)][camera])
    )


def row_of(pixels: str) -> np.ndarray:
    return np.array([[255 if pixel == "X" else 0 for pixel in pixels]], np.uint8)


THREE = [*block(0, 0, 30), *block(0, 5, 20), *block(0, 9, 10)]
"""Pieces of 30, 20 and 10 voxels."""
WALL, BESIDE, EMPTY = "X" * 25 + "." * 25, "." * 25 + "X" * 25, "." * 50
FULL = row_of("X" * 50)


@pytest.mark.parametrize(
    ("begins", "kept"),
    [
        # Twenty pixels each, of which three, two, none are before nothing else.
        ((8, 8, 2), [0, 1, 2]),
        ((8, 7, 2), [0, 1]),
        ((8, 2, 2), [0, 1]),
        ((8, 2, 8), [0, 1, 2]),
        ((2, 2, 2), [0, 1]),
    ],
)
def test_a_piece_is_real_where_two_views_have_more_than_a_tenth_of_it_to_itself(
    monkeypatch: pytest.MonkeyPatch, begins: tuple[int, ...], kept: list[int]
) -> None:
    third = (*("." * begin + "X" * 20 + "." * (30 - begin) for begin in begins),)
    far = "." * 30 + "X" * 20
    see(monkeypatch, {30: (WALL, WALL, WALL), 20: (far, far, far), 10: third})
    numbers, real = real_pieces(hull_of(THREE), [FULL] * 3, [0, 1, 2])
    assert real == kept
    assert numbers.tolist() == [0] * 30 + [1] * 20 + [2] * 10


def test_what_is_alone_counts_only_where_the_mask_is_foreground(monkeypatch: pytest.MonkeyPatch) -> None:
    see(monkeypatch, {30: (WALL, WALL), 20: (WALL, WALL), 10: (BESIDE, BESIDE)})
    hull = hull_of(THREE)
    half = row_of(WALL)
    # Of two that explain the same the larger stays, though nothing is its own when the smaller is tested.
    assert real_pieces(hull, [FULL, FULL], [0, 1])[1] == [0, 2]
    assert real_pieces(hull, [FULL, half], [0, 1])[1] == [0]
    assert real_pieces(hull, [half, half], [0, 1])[1] == [0]
    # Of one camera one view is enough, and what is alone in the hull stays.
    assert real_pieces(hull, [FULL], [0])[1] == [0, 2]
    assert real_pieces(hull_of(THREE[:30]), [row_of(EMPTY)] * 2, [0, 1])[1] == [0]


def test_pieces_below_a_hundredth_of_the_largest_are_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    see(monkeypatch, {100: (WALL, WALL), 101: (WALL, WALL), 1: (BESIDE, BESIDE)})
    for size, kept in ((100, [0, 1]), (101, [0])):
        cells = [*block(0, 0, 10, 10, 2)[:size], (0, 30, 0)]
        assert real_pieces(hull_of(cells), [FULL] * 2, [0, 1])[1] == kept


def all_real(monkeypatch: pytest.MonkeyPatch) -> None:
    def pieces(hull: Hull, *_: object) -> tuple[np.ndarray, list[int]]:
        numbers, volumes = piece_numbers(hull)
        return numbers, list(range(len(volumes)))

    monkeypatch.setattr(hull_subjects, "real_pieces", pieces)


def test_subjects_are_the_pieces_from_fifteen_hundredths_of_the_largest_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    all_real(monkeypatch)
    cells = [*block(0, 0, 2), *block(0, 5, 20), *block(5, 9, 3), (0, 20, 4)]
    hull = hull_of(cells, [1] * 25 + [2])
    labels, subjects = subjects_of(hull, [], [])
    # 20, 8 (one of twice the side), 3 and 2 voxels.
    assert labels.tolist() == [NOBODY] * 2 + [0] * 20 + [2] * 3 + [1]
    assert NOBODY == -1
    assert [one.volume for one in subjects] == [count * UNIT**3 for count in (20, 8, 3)]
    assert [one.top for one in subjects] == [50.0, 300.0, 50.0]
    np.testing.assert_allclose([one.place for one in subjects], [(500, 275), (50, 1050), (325, 475)])
    mixed = hull_of([(0, 0, 0), (2, 0, 0)], [2, 1])
    np.testing.assert_allclose(
        subjects_of(mixed, [], [])[1][0].place, ((8 * 50 + 125) / 9, (8 * 50 + 25) / 9)
    )


def subject(x: float, y: float = 25.0) -> HullSubject:
    return HullSubject(np.array([x, y]), 1.0, 1.0)


def test_places_name_the_subjects_near_them() -> None:
    hull = hull_of([*block(0, 0, 2), *block(30, 0, 2), *block(0, 20, 2)])
    labels = np.repeat([0, 1, 2], 2)
    subjects = [subject(50.0), subject(1550.0), subject(50.0, 1025.0)]
    owners, count = labels_at(hull, labels, subjects, np.array([[1525.0, 625.0], [25.0, 1025.0]]))
    assert owners.tolist() == [2, 2, 0, 0, 1, 1]
    assert count == 3
    # Only the nearest of its voxels counts, 600 mm away at most, of a larger body in proportion.
    near = np.array([[75.0 + 600.0, 25.0]])
    assert labels_at(hull, labels, subjects, near)[0].tolist() == [0, 0, 1, 1, 2, 2]
    beyond = np.array([[75.0, 25.0], [75.0 + 601.0, 25.0]])
    assert labels_at(hull, labels, subjects, beyond) == (None, 1)
    assert labels_at(hull, labels, subjects, np.array([[1.0, -1150.0]]), 2.0)[0].tolist() == [
        0,
        0,
        1,
        1,
        2,
        2,
    ]
    assert labels_at(hull, labels, subjects, near, 0.9)[0] is None
    ghosts = np.array([0, 0, NOBODY, NOBODY, 1, 1])
    assert labels_at(hull, ghosts, [subject(50.0), subject(50.0, 1025.0)], near)[0].tolist() == [
        0,
        0,
        -1,
        -1,
        1,
        1,
    ]


def test_of_two_near_a_place_it_is_whose_voxel_is_there_and_else_whose_middle_is_nearer() -> None:
    hull = hull_of([*block(0, 0, 4), *block(6, 0, 2)])
    labels = np.repeat([0, 1], [4, 2])
    subjects = [subject(100.0), subject(350.0)]
    assert labels_at(hull, labels, subjects, np.array([[175.0, 25.0]]))[0].tolist() == [0] * 4 + [1] * 2
    far = [subject(-400.0), subject(350.0)]
    assert labels_at(hull, labels, far, np.array([[175.0, 25.0]]))[0].tolist() == [0] * 4 + [1] * 2
    assert labels_at(hull, labels, far, np.array([[175.5, 25.0]]))[0].tolist() == [1] * 4 + [0] * 2
    assert labels_at(hull, labels, subjects, np.array([[250.0, 25.0]]))[0].tolist() == [1] * 4 + [0] * 2


def test_two_places_in_one_piece_part_it() -> None:
    hull = hull_of([*block(0, 0, 9, 2), *block(30, 0, 1)])
    labels = np.repeat([0, 1], [18, 1])
    places = np.array([[1500.0, 25.0], [25.0, 25.0], [425.0, 25.0]])
    owners, count = labels_at(hull, labels, [subject(225.0), subject(1525.0)], places)
    assert owners.tolist() == [1 if x <= 225.0 else 2 for x in hull.centres[:18, 0]] + [0]
    assert count == 3


class Follower:
    """`HullFollower` step by step, over pairs of voxels."""

    def __init__(self, hull: Hull, labels: np.ndarray, scale: float) -> None:
        self.reach = 150.0 * scale
        self.known = [hull.centres[labels == label] for label in range(labels.max() + 1)]
        self.middles = [np.median(own[:, :2], axis=0) for own in self.known]
        self.farthest = [
            max(np.hypot(*(place[:2] - middle)) for place in own) + 250.0 * scale
            for own, middle in zip(self.known, self.middles, strict=True)
        ]
        self.velocities = [np.zeros(2) for _ in self.known]

    def apart(self, label: int, centre: np.ndarray, moved: np.ndarray) -> float:
        place = centre - np.array([*moved, 0.0])
        if np.hypot(*(place[:2] - self.middles[label])) > self.farthest[label]:
            return np.inf
        return float(np.linalg.norm(self.known[label] - place, axis=1).min())

    def step(self, hull: Hull) -> np.ndarray:
        numbers, volumes = piece_numbers(hull)
        moved = self.velocities
        for _ in range(2):
            guess = np.full(len(numbers), -1)
            for index, centre in enumerate(hull.centres):
                apart = [self.apart(label, centre, to) for label, to in enumerate(moved)]
                if min(apart) <= self.reach:
                    guess[index] = int(np.argmin(apart))
            owners = np.full(len(numbers), -1)
            for piece in range(len(volumes)):
                own = (numbers == piece) & (guess >= 0)
                shares = [hull.volumes()[own & (guess == label)].sum() for label in range(len(self.known))]
                if own.any() and max(shares) >= 0.97 * sum(shares):
                    owners[numbers == piece] = int(np.argmax(shares))
                else:
                    owners[own] = guess[own]
            moved = [
                np.median(hull.centres[owners == label, :2], axis=0) - middle
                if (owners == label).any()
                else np.zeros(2)
                for label, middle in enumerate(self.middles)
            ]
        for label, to in enumerate(moved):
            self.velocities[label] = to
            if (owners == label).any():
                self.middles[label] = self.middles[label] + to
                self.known[label] = hull.centres[owners == label]
        return owners


@pytest.mark.parametrize("scale", [1.0, 0.6])
def test_voxels_that_touch_go_to_whom_they_were_nearest_as_he_moved(
    monkeypatch: pytest.MonkeyPatch, scale: float
) -> None:
    """Two that pass through each other, with a fringe that changes from frame to frame and some larger voxels."""
    all_real(monkeypatch)
    rng = np.random.default_rng(8)
    differing = 0
    for _ in range(6):
        frames = []
        for number in range(5):
            cells: Cells = []
            for x, y in ((2 * number, 3), (14 - 2 * number, 3 + int(rng.integers(0, 6)))):
                own = np.array(block(x, y, 4, 4, 3))
                cells += [tuple(cell) for cell in own[rng.random(len(own)) < 0.7].tolist()]
            cells = sorted(set(cells))
            frames.append(
                hull_of([*cells, (4 * number, 24, 0)], [1] * len(cells) + [int(rng.integers(1, 3))])
            )
        labels = np.where(frames[0].centres[:, 0] < 350.0, 0, 1)
        follower, plain = HullFollower(frames[0], labels, scale), Follower(frames[0], labels, scale)
        for hull in frames[1:]:
            expected = plain.step(hull)
            np.testing.assert_array_equal(follower.step(hull, [], []), expected)
            differing += len(np.unique(expected)) > 1
    assert differing > 12


def test_a_subject_is_followed_as_fast_as_he_moved(monkeypatch: pytest.MonkeyPatch) -> None:
    """A voxel lies within reach at 150 mm, and no farther; his middle may lie 250 mm farther out than at first."""
    all_real(monkeypatch)

    def follow(*moves: float, scale: float = 1.0) -> list[int]:
        follower = HullFollower(hull_of([(0, 0, 0)]), np.zeros(1, np.int64), scale)
        return [int(follower.step(moved_hull(to), [], [])[0]) for to in moves]

    def moved_hull(to: float) -> Hull:
        hull = hull_of([(0, 0, 0)])
        hull.centres[:, 1] += to
        return hull

    assert follow(150.0) == [0]
    assert follow(151.0) == [NOBODY]
    assert follow(150.0, 450.0) == [0, 0]
    assert follow(150.0, 451.0) == [0, NOBODY]
    # Who is not seen stays where he was, and is not expected to go on.
    assert follow(100.0, 1000.0, 200.0) == [0, NOBODY, 0]
    assert follow(100.0, 1000.0, 251.0) == [0, NOBODY, NOBODY]
    assert follow(300.0, scale=2.0) == [0]
    assert follow(301.0, scale=2.0) == [NOBODY]
    empty = HullFollower(hull_of([(0, 0, 0)]), np.zeros(1, np.int64))
    assert empty.step(hull_of([]), [], []).shape == (0,)
    assert empty.step(moved_hull(150.0), [], []).tolist() == [0]


def test_no_label_creeps_out_of_its_subjects_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    """The voxels of two that touch: a row that grows by two voxels a frame may reach 250 mm farther."""
    all_real(monkeypatch)
    row = block(0, 0, 3)
    follower = HullFollower(hull_of([*row, (0, 1, 0)]), np.array([0, 0, 0, 1]))
    plain = Follower(hull_of([*row, (0, 1, 0)]), np.array([0, 0, 0, 1]), 1.0)
    for longer in range(2, 18, 2):
        hull = hull_of([*block(0, 0, 3 + longer), (0, 1, 0), (0, 2, 0)])
        owners = follower.step(hull, [], [])
        np.testing.assert_array_equal(owners, plain.step(hull))
    assert 0 < np.count_nonzero(owners == NOBODY) < 10


@pytest.mark.parametrize(("others", "whole"), [(3, True), (4, False)])
def test_a_piece_that_is_nearly_all_one_subjects_is_all_his(
    monkeypatch: pytest.MonkeyPatch, others: int, whole: bool
) -> None:
    all_real(monkeypatch)
    cells = block(0, 0, 100, 1)[: 100 - others] + block(100 - others, 0, others)
    labels = np.repeat([0, 1], [100 - others, others])
    follower = HullFollower(hull_of(cells), labels)
    owners = follower.step(hull_of(cells), [], [])
    assert owners.tolist() == ([0] * 100 if whole else labels.tolist())


def test_ghosts_are_nobodys(monkeypatch: pytest.MonkeyPatch) -> None:
    def pieces(hull: Hull, *_: object) -> tuple[np.ndarray, list[int]]:
        return piece_numbers(hull)[0], [1]

    monkeypatch.setattr(hull_subjects, "real_pieces", pieces)
    hull = hull_of([*block(0, 0, 3), *block(6, 0, 2)])
    assert HullFollower(hull, np.repeat([0, 1], [3, 2])).step(hull, [], []).tolist() == [-1, -1, -1, 1, 1]


def test_each_labels_silhouette_is_that_of_its_voxels() -> None:
    hull, camera = hull_of([*block(0, 0, 3, 3, 9), *block(8, 0, 2, 2, 6), (-9, -9, 3)]), rig(1)[0]
    labels = np.repeat([0, 1, NOBODY], [81, 24, 1])
    drawn = label_silhouettes(hull, labels, 2, camera)
    assert len(drawn) == 2
    for label, picture in enumerate(drawn):
        assert picture.any()
        np.testing.assert_array_equal(picture, silhouette(chosen_voxels(hull, labels == label), camera))
