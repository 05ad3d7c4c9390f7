"""What is made of areas, jumps and deviations of limbs, and of cells where something hides them, on made-up numbers."""

from dataclasses import dataclass

import numpy as np
import pytest
from drawn_people import ring_of_cameras
from moving_bodies import standing

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, rigid_limbs
from studio.body.scale import scale_of
from studio.search.trackers.agreement import Agreement, Disagreement, limb_names
from studio.search.trackers.hidden_areas import cell_size, counts_of, learnt, without_hidden
from studio.search.trackers.limb_certainty import ENDS, JUMPS, Certainty, CertaintyOfLimbs
from studio.search.trackers.refinement import RefinementSettings, Refiner, mm_at
from studio.search.trackers.tracker import HIDDEN

Array = np.ndarray
CAMERAS = ring_of_cameras(2, 160, 120)
LIMBS = ("arm", "leg")


def disagreement(area: Array, outside: Array, bare: Array, limbs: tuple[str, ...]) -> Disagreement:
    return Disagreement(
        area, outside, bare, limbs, np.zeros((len(area), len(limbs), 4, 2)), [1.0] * len(area)
    )


def test_shares_are_of_a_limbs_area_in_all_views_which_is_never_taken_as_too_small() -> None:
    """Two parts of an arm; a leg that no view sees counts as 1000 mm²."""
    area = np.array([[3000.0, 900.0, 0.0], [1000.0, 300.0, 10.0]])
    outside = np.array([[300.0, 0.0, 0.0], [100.0, 40.0, 0.0]])
    bare = np.array([[0.0, 60.0, 0.0], [20.0, 0.0, 50.0]])
    found = disagreement(area, outside, bare, ("arm", "arm", "leg")).shares()
    assert found == pytest.approx({"arm": 520.0 / (4000.0 + 1200.0), "leg": 50.0 / 1000.0})


def certainty(deviation: float, jump: float) -> Certainty:
    return Certainty(LIMBS, np.array([deviation, 5.0]), np.array([jump, 0.0]), {})


@pytest.mark.parametrize(
    ("outside", "bare", "deviation", "jump"),
    [(0.0, 0.0, 30.0, 0.0), (0.02, 0.01, 30.0, 50.0), (0.04, 0.05, 10.0, 500.0), (0.2, 0.06, 8.0, 300.0)],
)
def test_signs_are_added_up_as_the_regression_weighs_them(
    outside: float, bare: float, deviation: float, jump: float
) -> None:
    off = disagreement(
        np.array([[4000.0, 6000.0, 5000.0]]),
        np.array([[4000.0, 6000.0, 0.0]]) * outside,
        np.array([[10000.0 * bare, 0.0, 0.0]]),
        ("arm", "arm", "leg"),
    )
    odds = 3.90 + 1.37 * np.log(min(outside, 0.05) + 0.005) + 0.44 * np.log(bare + 0.003)
    odds += 1.81 * np.log(1.0 + jump / 100.0) * np.log(max(deviation / 10.0, 1.0))
    none = 3.90 + 1.37 * np.log(0.005) + 0.44 * np.log(0.003)
    found = certainty(deviation, jump).lost(off)
    assert found == pytest.approx({"arm": 1.0 / (1.0 + np.exp(-odds)), "leg": 1.0 / (1.0 + np.exp(-none))})


def test_a_limb_that_leaves_more_than_six_hundredths_bare_is_lost() -> None:
    for bare, sure in ((0.061, True), (0.06, False)):
        off = disagreement(np.full((1, 2), 1e4), np.zeros((1, 2)), np.array([[1e4 * bare, 0.0]]), LIMBS)
        lost = certainty(5.0, 0.0).lost(off)
        assert (lost["arm"] == 1.0) == sure
        assert lost["leg"] < 0.5


@pytest.mark.parametrize("name", ["human31", "human25"])
def test_deviations_of_ends_come_of_the_equations_and_the_joints_ranges(name: str) -> None:
    """The covariance of least squares with a prior of a quarter of each range, carried to the ends of limbs."""
    own = load_body(name)
    refiner = Refiner(own, CAMERAS, RefinementSettings())
    size, rng = len(refiner.neutral), np.random.default_rng(0)
    square = 100.0 * rng.normal(size=(size, size))
    matrix, pose = square @ square.T, standing(own)
    found = CertaintyOfLimbs(refiner).of(pose, matrix, {})
    reach = (refiner.upper - refiner.lower) / refiner.unit
    prior = np.where(np.isfinite(reach), 0.25 * reach, 1.0)
    covariance = np.linalg.inv(matrix / 40.0**2 + np.diag(prior**-2.0))
    slopes = []
    for at in range(size):
        step = 1e-5 * refiner.unit[at] * np.eye(size)[at]
        ahead, back = (limb_ends(own, (pose + sign * step)[None])[0] for sign in (1.0, -1.0))
        slopes.append((ahead - back) / 2e-5 / scale_of(own))
    jacobian = np.moveaxis(np.array(slopes), 0, -1)
    variances = np.einsum("lpid,de,lpie->lp", jacobian, covariance, jacobian)
    names, rigid = np.array(limb_names(own)), rigid_limbs(own)
    assert found.limbs == tuple(dict.fromkeys(names.tolist()))
    for limb, deviation in zip(found.limbs, found.deviation, strict=True):
        # Rigid hands and feet say nothing beside the limb that bears them.
        measured = (names == limb) & ~rigid if not rigid[names == limb].all() else names == limb
        assert deviation == pytest.approx(np.sqrt(variances[measured].max()), rel=1e-3), limb


def test_a_jump_is_how_far_ends_are_from_where_they_moved_to_and_fades_by_a_fifth_a_frame(
    body: BodyModel,
) -> None:
    refiner = Refiner(body, CAMERAS, RefinementSettings())
    finder, matrix = CertaintyOfLimbs(refiner), np.eye(len(refiner.neutral))
    names, memory, jumps = [entry.name for entry in body.parameters], {}, []
    for x in (0.0, 10.0, 20.0, 50.0, 80.0, 110.0):
        pose = standing(body)
        pose[names.index("pelvis_x")] += x
        found = finder.of(pose, matrix, memory)
        memory = found.moved
        jumps.append(found.jump)
        assert memory[JUMPS] is found.jump
        assert len(memory[ENDS]) == min(len(jumps), 2)
    # Moved on by 10 it would be at 30 where it is at 50; then it moves on by 30.
    np.testing.assert_allclose(np.array(jumps).max(axis=1), [0.0, 0.0, 0.0, 20.0, 16.0, 12.8], atol=1e-6)
    arm = names.index("left_shoulder_rx")
    pose[arm] += 0.5
    pose[names.index("pelvis_x")] += 30.0
    found = finder.of(pose, matrix, memory)
    wanted = standing(body)
    wanted[names.index("pelvis_x")] = pose[names.index("pelvis_x")]
    apart = np.linalg.norm(limb_ends(body, pose[None])[0] - limb_ends(body, wanted[None])[0], axis=2).max(
        axis=1
    )
    rigid, owners = rigid_limbs(body), np.array(limb_names(body))
    largest = apart[(owners == "left arm") & ~rigid].max()
    of_limbs = dict(zip(found.limbs, found.jump, strict=True))
    assert of_limbs["left arm"] == pytest.approx(largest)
    assert of_limbs["right leg"] == pytest.approx(0.8 * 12.8)


# ------------------------------------------------------------------ hidden areas


@dataclass
class View:
    """A silhouette's distances, as `Distances`."""

    size: tuple[int, int]
    corner: tuple[int, int]
    signed: Array
    border: Array
    outward: Array


def view_of(corner: tuple[int, int], signed: Array, border: list[list[float]]) -> View:
    places = np.array(border, dtype=float).reshape(-1, 2)
    return View((160, 120), corner, signed.astype(np.float32), places, places + 0.5)


def test_cells_are_a_hundred_and_sixtieth_of_the_longer_side() -> None:
    for width, height, cell in ((160, 120, 1), (640, 480, 4), (480, 800, 5), (90, 60, 1), (410, 30, 3)):
        (camera,) = ring_of_cameras(1, width, height)
        assert cell_size(camera) == cell
        assert counts_of({}, camera).shape == (int(np.ceil(height / cell)), int(np.ceil(width / cell)))
        assert not counts_of({}, camera).any()
    known = np.ones((3, 3))
    assert counts_of({HIDDEN + camera.name: known}, camera) is known


def seen(view: View, counts: Array | None, mm: float) -> View:
    (camera,) = ring_of_cameras(1, 160, 120)
    memory = {} if counts is None else {HIDDEN + camera.name: counts}
    (found,) = without_hidden([view], [camera], [mm], memory)
    return found


def test_where_nothing_is_hidden_a_silhouette_is_itself() -> None:
    view = view_of((10, 20), np.ones((30, 40)), [[12.0, 22.0]])
    assert seen(view, None, 10.0) is view
    assert seen(view, np.full((120, 160), 5.9), 10.0) is view
    nothing = view_of((0, 0), np.zeros((0, 0)), [])
    assert seen(nothing, np.full((120, 160), 6.0), 10.0) is nothing


def test_hidden_cells_and_what_is_near_to_them_are_neither_inside_nor_outside() -> None:
    """One hidden cell at (30, 50), and 22.5 mm a pixel: three pixels about it, as 1.5 times 45 mm are."""
    signed = np.where(np.arange(40) % 2 == 0, 5.0, -5.0) * np.ones((30, 1))
    border = [[30.0, 46.0], [30.0, 47.0], [33.0, 50.0], [34.0, 50.0], [32.0, 52.0], [33.0, 52.0]]
    view = view_of((10, 40), signed, border)
    counts = np.zeros((120, 160))
    counts[50, 30], counts[60, 90] = 6.0, 5.0
    found = seen(view, counts, 22.5)
    assert found.border.tolist() == [[30.0, 46.0], [34.0, 50.0], [33.0, 52.0]]
    np.testing.assert_array_equal(found.outward, found.border + 0.5)
    assert (found.size, found.corner, found.signed.shape) == ((160, 120), (10, 40), (30, 40))
    rows, columns = np.mgrid[40:70, 10:50]
    near = np.hypot(columns - 30, rows - 50) <= 3.0
    np.testing.assert_array_equal(found.signed, np.where(near & (signed > 0.0), 0.0, signed))


@pytest.mark.parametrize(
    ("at", "corner", "shape"),
    [
        ((30, 50), (10, 40), (30, 40)),
        ((5, 50), (4, 40), (30, 46)),
        ((55, 50), (10, 40), (30, 47)),
        ((30, 20), (10, 19), (51, 40)),
        ((30, 75), (10, 40), (37, 40)),
        ((0, 0), (0, 0), (70, 50)),
        ((159, 119), (10, 40), (80, 150)),
    ],
)
def test_a_map_is_enlarged_to_hold_what_is_hidden(
    at: tuple[int, int], corner: tuple[int, int], shape: tuple[int, int]
) -> None:
    """By a cell and one pixel about it, within the picture; beyond the map all is far outside."""
    counts = np.zeros((120, 160))
    counts[at[1], at[0]] = 7.0
    found = seen(view_of((10, 40), np.full((30, 40), -2.0), []), counts, 67.5)
    assert (found.corner, found.signed.shape) == (corner, shape)
    inside = found.signed[40 - corner[1] :, 10 - corner[0] :][:30, :40]
    assert (inside == -2.0).all()
    assert (np.delete(found.signed.ravel(), np.flatnonzero(found.signed == -2.0)) >= 0.0).all()
    if shape != (30, 40):
        assert found.signed.max() == 160.0
        assert found.signed[at[1] - corner[1], at[0] - corner[0]] == 0.0


def test_cells_of_several_pixels_are_hidden_as_a_whole() -> None:
    (camera,) = ring_of_cameras(1, 640, 480)
    counts = np.zeros((120, 160))
    counts[30, 20] = 6.0
    view = view_of(
        (40, 60), np.full((100, 120), 3.0), [[79.0, 119.0], [80.0, 120.0], [83.0, 123.0], [84.0, 120.0]]
    )
    view.size = (640, 480)
    (found,) = without_hidden([view], [camera], [20.0], {HIDDEN + camera.name: counts})
    # 67.5 mm are 3.4 pixels, less than the four to the next cell.
    hidden = np.argwhere(found.signed == 0.0)
    assert (hidden.min(axis=0).tolist(), hidden.max(axis=0).tolist()) == ([60, 40], [63, 43])
    assert found.border.tolist() == [[79.0, 119.0], [84.0, 120.0]]


@pytest.mark.parametrize(("bare", "counted"), [(99.0, True), (101.0, False)])
def test_frames_are_counted_where_a_pose_leaves_hardly_anything_bare(bare: float, counted: bool) -> None:
    """A limb over the left half of a picture, of which a map shows the upper half to be silhouette."""
    (camera,) = ring_of_cameras(1, 160, 120)
    quad = np.array([[[[-1.0, -1.0], [-1.0, 200.0], [79.0, 200.0], [79.0, -1.0]]]])
    off = Disagreement(np.array([[1e4]]), np.zeros((1, 1)), np.array([[bare]]), ("arm",), quad, [10.0])
    before = {HIDDEN + camera.name: np.full((120, 160), 2.0), "other": np.ones(1)}
    found = learnt(before, off, [camera], [view_of((0, 0), np.full((60, 160), -1.0), [])])
    if not counted:
        assert found is before
        return
    expected = np.full((120, 160), 2.0)
    expected[:60], expected[60:, :80] = 0.0, 3.0
    np.testing.assert_array_equal(found[HIDDEN + camera.name], expected)
    assert found["other"] is before["other"]
    assert (before[HIDDEN + camera.name] == 2.0).all()


def test_what_is_within_reach_of_clothes_is_not_counted_as_hidden() -> None:
    (camera,) = ring_of_cameras(1, 160, 120)
    quad = np.array([[[[-1.0, -1.0], [-1.0, 200.0], [200.0, 200.0], [200.0, -1.0]]]])
    off = Disagreement(np.array([[1e4]]), np.zeros((1, 1)), np.zeros((1, 1)), ("arm",), quad, [15.0])
    signed = np.repeat([[-1.0, 3.0, 3.1]], 120, axis=0)[:, [0] * 50 + [1] * 50 + [2] * 60]
    found = learnt({}, off, [camera], [view_of((0, 0), signed, [])])[HIDDEN + camera.name]
    # 45 mm are three pixels.
    np.testing.assert_array_equal(found, np.repeat([[0.0, 1.0]], 120, axis=0)[:, [0] * 100 + [1] * 60])


# ------------------------------------------------------------------ areas at the body's scale


def test_areas_are_square_millimetres_whatever_the_grid(body: BodyModel) -> None:
    """An empty view: what limbs cover is all outside, counted on points about 14 mm apart."""
    cameras = ring_of_cameras(2, 640, 480)
    agreement, pose = Agreement(body, cameras), standing(body)
    empty = [View((640, 480), (0, 0), np.zeros((0, 0), np.float32), np.zeros((0, 2)), np.zeros((0, 2)))] * 2
    found, mm = agreement.of(pose, empty), np.array(mm_at(body, cameras, pose))
    quads = found.corners
    along = np.roll(quads, -1, axis=2)
    exact = 0.5 * np.abs((quads[..., 0] * along[..., 1] - quads[..., 1] * along[..., 0]).sum(axis=2))
    expected = exact * mm[:, None] ** 2
    assert found.mm == pytest.approx(mm)
    np.testing.assert_allclose(found.area.sum(axis=1), expected.sum(axis=1), rtol=0.03)
    np.testing.assert_array_equal(found.outside, found.area)
    step = np.maximum(1, np.round(14.0 / mm))
    np.testing.assert_allclose(found.area / (step * mm)[:, None] ** 2 % 1.0 % (1.0 - 1e-6), 0.0, atol=1e-6)
