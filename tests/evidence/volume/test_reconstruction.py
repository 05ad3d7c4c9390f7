"""Hulls of a body of cones: how much of it they hold (Show 1), against a full grid, on any number of threads."""

import dataclasses

import numba
import numpy as np
import pytest
from posed_cones import Cones, evidence_of, ring

from studio.body.catalogue import load_body
from studio.evidence.frame_evidence import FrameEvidence
from studio.evidence.volume import hull_kernels as kernels
from studio.evidence.volume import reconstruction
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_octree import first_look
from studio.evidence.volume.hull_settings import HullSettings
from studio.evidence.volume.reconstruction import (
    Reconstructor,
    check_views,
    grid_limits,
    grid_within,
    radical_inverses,
    reconstruct,
)
from studio.evidence.volume.tracking_space import Box, box_of
from studio.evidence.yuv_background import learn_background
from studio.foundations.errors import FootageError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

BODY = load_body("human25")
SPACING = 14.0


@dataclasses.dataclass(frozen=True)
class Scene:
    """A body in a ring of cameras. points : a fine grid's in the body."""

    cones: Cones
    cameras: tuple[Camera, ...]
    box: Box
    points: np.ndarray
    masks: FrameEvidence
    pixels: FrameEvidence

    def contained(self, hull: Hull) -> float:
        return float(hull.contains(self.points).mean())

    def volumes(self, hull: Hull) -> float:
        return hull.volume() / (len(self.points) * SPACING**3)


@pytest.fixture(scope="module")
def scene() -> Scene:
    rng = np.random.default_rng(1)
    pose = BODY.neutral.copy()
    for entry, value in (("left_shoulder_swing", 0.9), ("heading", 0.4), ("right_shoulder_swing", -0.5)):
        pose[[parameter.name for parameter in BODY.parameters].index(entry)] = value
    cones, cameras = Cones(BODY, pose), ring(5)
    masks = evidence_of([cones.mask(camera) for camera in cameras], cameras, rng)
    empty = [np.zeros((camera.height, camera.width), np.uint8) for camera in cameras]
    clips = [evidence_of(empty, cameras, rng).views for _ in range(12)]
    views = tuple(
        dataclasses.replace(
            view, mask=np.zeros_like(view.mask), background=learn_background([f[i].picture for f in clips])
        )
        for i, view in enumerate(masks.views)
    )
    return Scene(cones, cameras, box_of(cameras), cones.points(SPACING), masks, FrameEvidence(0, views))


def test_the_hull_holds_the_body_and_no_more_than_twice_its_volume(scene: Scene) -> None:
    hull = reconstruct(scene.masks, scene.cameras, scene.box)
    assert scene.contained(hull) >= 0.99
    assert scene.volumes(hull) <= 2.0


@pytest.mark.parametrize(("depth", "contained", "volumes"), [(6, 0.96, 1.9), (7, 0.975, 1.6), (8, 0.97, 1.4)])
def test_a_hull_from_pixels_holds_nearly_as_much(
    scene: Scene, depth: int, contained: float, volumes: float
) -> None:
    """Samples miss some tips of limbs."""
    hull = reconstruct(scene.pixels, scene.cameras, scene.box, HullSettings(hull_depth=depth))
    assert scene.contained(hull) >= contained
    assert scene.volumes(hull) <= volumes


def test_more_samples_miss_less(scene: Scene) -> None:
    few, many = (
        reconstruct(scene.pixels, scene.cameras, scene.box, HullSettings(hull_depth=8, hull_sampling=factor))
        for factor in (1.0, 2.0)
    )
    assert scene.contained(many) >= 0.99 > scene.contained(few)


def test_fewer_cameras_make_a_larger_hull_that_holds_the_body_too(scene: Scene) -> None:
    sizes = []
    for count in (3, 4, 5):
        cameras = scene.cameras[:count]
        seen = dataclasses.replace(scene.masks, views=scene.masks.views[:count])
        hull = reconstruct(seen, cameras, scene.box)
        assert scene.contained(hull) >= 0.99
        sizes.append(hull.volume())
    assert sizes[0] > sizes[1] > sizes[2]


def test_deeper_hulls_are_tighter(scene: Scene) -> None:
    sizes = [
        reconstruct(scene.masks, scene.cameras, scene.box, HullSettings(hull_depth=depth)).volume()
        for depth in (5, 6, 7, 8)
    ]
    assert sizes == sorted(sizes, reverse=True)


@pytest.mark.parametrize("kind", ["masks", "pixels"])
def test_the_octree_keeps_the_voxels_of_a_full_grid(scene: Scene, kind: str) -> None:
    """Masks: nothing is lost above the last depth, so the very same voxels. Pixels: samples above it may miss."""
    settings = HullSettings(hull_depth=6)
    reconstructor = Reconstructor(scene.cameras, scene.box, settings)
    evidence = scene.masks if kind == "masks" else scene.pixels
    hull = reconstructor.hull(evidence)
    nodes, edge = grid_within(scene.box, 6), scene.box.edge / 64.0
    seen = reconstructor._sights_of(evidence)
    verdicts, states = np.zeros(len(nodes), np.uint8), np.zeros((len(nodes), 3), np.uint32)
    given = nodes, states, verdicts, scene.box.corner, edge, seen, reconstructor._rules._replace(last=True)
    kernels.judge(0, len(nodes), *given)
    full = scene.box.corner + (nodes[verdicts == kernels.KEPT] + 0.5) * edge
    centres = scene.box.corner + (nodes + 0.5) * edge
    in_octree, in_grid = hull.contains(centres), verdicts == kernels.KEPT
    assert 400 < len(full) < 3000
    if kind == "masks":
        np.testing.assert_array_equal(in_octree, in_grid)
    else:
        assert (in_octree & in_grid).sum() > 0.93 * (in_octree | in_grid).sum()


def test_a_hull_of_masks_agrees_with_projected_points(scene: Scene) -> None:
    """Independent of the kernels: 5 x 5 x 5 points in each voxel, projected. Where half of them land on every mask the
    voxel is kept, where hardly any land on one it is not; a quarter of the area lies between.
    """
    hull = reconstruct(scene.masks, scene.cameras, scene.box, HullSettings(hull_depth=6))
    nodes, edge = grid_within(scene.box, 6), scene.box.edge / 64.0
    steps = (np.arange(5) + 0.5) / 5.0
    inside = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    centres = scene.box.corner + (nodes + 0.5) * edge
    near = np.linalg.norm(centres[:, :2] - scene.points[:, :2].mean(axis=0), axis=1) < 600.0
    nodes, least = nodes[near], np.ones(int(near.sum()))
    for camera, view in zip(scene.cameras, scene.masks.views, strict=True):
        points = scene.box.corner + (nodes[:, None] + inside) * edge
        pixels = np.floor(project(camera, points)[0] + 0.5).astype(int)
        x, y = np.clip(pixels[..., 0], 0, camera.width - 1), np.clip(pixels[..., 1], 0, camera.height - 1)
        least = np.minimum(least, (view.mask[y, x] > 0).mean(axis=1))
    found = hull.contains(scene.box.corner + (nodes + 0.5) * edge)
    assert found[least >= 0.5].mean() > 0.995
    assert found[least < 0.06].sum() < 0.01 * found.sum()


@pytest.mark.parametrize("kind", ["masks", "pixels"])
def test_any_number_of_threads_finds_the_same(
    scene: Scene, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    evidence = scene.masks if kind == "masks" else scene.pixels
    hulls = []
    for threads in (1, 2, 3):
        monkeypatch.setattr(numba, "get_num_threads", lambda threads=threads: threads)
        monkeypatch.setattr(reconstruction, "VOXELS_A_THREAD", 64)
        hulls.append(reconstruct(evidence, scene.cameras, scene.box))
    for other in hulls[1:]:
        np.testing.assert_array_equal(other.centres, hulls[0].centres)
        np.testing.assert_array_equal(other.view_colours, hulls[0].view_colours)


def test_voxels_have_the_bodys_colour(scene: Scene) -> None:
    """The body is 150 in every colour before a background of 60: edges are not mixed with it."""
    for evidence in (scene.masks, scene.pixels):
        hull = reconstruct(evidence, scene.cameras, scene.box)
        assert hull.view_colours.shape == (len(hull.centres), 5, 3)
        np.testing.assert_allclose(np.nanmean(hull.view_colours, axis=1), hull.colours, rtol=1e-4)
        assert np.median(np.abs(hull.colours - 150.0)) < 3.0
        assert (np.abs(hull.colours - 150.0) < 15.0).mean() > 0.97


def test_areas_outside_a_picture_are_left_to_the_other_views(scene: Scene) -> None:
    """A camera whose picture ends at the knees: legs stay; at least the given number of views must see a voxel."""
    camera, view = scene.cameras[0], scene.masks.views[0]
    knees = int(np.floor(project(camera, np.array([0.0, 0.0, 500.0]))[0][1]))
    short = dataclasses.replace(camera, height=knees)
    cut = dataclasses.replace(
        view, picture=view.picture[:knees], mask=view.mask[:knees], edges=view.edges[:knees]
    )
    cameras = (short, *scene.cameras[1:])
    evidence = dataclasses.replace(scene.masks, views=(cut, *scene.masks.views[1:]))
    hull = reconstruct(evidence, cameras, scene.box)
    assert scene.contained(hull) >= 0.99
    all_five = reconstruct(evidence, cameras, scene.box, HullSettings(hull_least_views=5))
    assert all_five.centres[:, 2].min() > 350.0
    in_sight = scene.points[:, 2] > 700.0
    assert all_five.contains(scene.points[in_sight]).mean() >= 0.99


def test_what_a_view_cannot_tell_does_not_carve(scene: Scene) -> None:
    first, *others = scene.masks.views
    lower = first.mask.copy()
    lower[: first.mask.shape[0] // 2] = 0
    told = reconstruct(scene.masks, scene.cameras, scene.box)
    untold, carved = (
        reconstruct(
            FrameEvidence(0, (dataclasses.replace(first, mask=first.mask - lower, unknown=unknown), *others)),
            scene.cameras,
            scene.box,
        )
        for unknown in (lower, None)
    )
    np.testing.assert_array_equal(untold.centres, told.centres)
    assert carved.volume() < 0.8 * told.volume()


def test_nothing_seen_is_an_empty_hull(scene: Scene) -> None:
    views = tuple(dataclasses.replace(view, mask=np.zeros_like(view.mask)) for view in scene.masks.views)
    hull = reconstruct(FrameEvidence(0, views), scene.cameras, scene.box)
    assert hull.empty
    assert hull.view_colours.shape == (0, 5, 3)


def test_an_empty_room_seen_in_pixels_leaves_next_to_nothing(scene: Scene) -> None:
    """Each view misclassifies one background area of a hundred; all five hardly ever the same."""
    rng = np.random.default_rng(7)
    nothing = [np.zeros_like(view.mask) for view in scene.pixels.views]
    pictures = evidence_of(nothing, scene.cameras, rng).views
    views = tuple(
        dataclasses.replace(view, picture=other.picture)
        for view, other in zip(scene.pixels.views, pictures, strict=True)
    )
    hull = reconstruct(FrameEvidence(0, views), scene.cameras, scene.box)
    assert hull.volume() < 1e-3 * len(scene.points) * SPACING**3


def test_evidence_that_does_not_fit_is_refused(scene: Scene) -> None:
    with pytest.raises(FootageError, match="4 views for 5 cameras"):
        reconstruct(dataclasses.replace(scene.masks, views=scene.masks.views[:4]), scene.cameras, scene.box)
    wrong = dataclasses.replace(scene.cameras[0], width=300)
    with pytest.raises(FootageError, match="ring0"):
        reconstruct(scene.masks, (wrong, *scene.cameras[1:]), scene.box)
    with pytest.raises(FootageError, match="from 0 cameras"):
        Reconstructor((), scene.box, HullSettings())


def test_a_grid_reaches_over_the_box() -> None:
    """Of a cube of 1600 mm about the middle of the floor, sixteen voxels a side at depth 4."""
    box = Box(np.array([-450.0, 100.0, 0.0]), np.array([450.0, 900.0, 1600.0]))
    assert grid_limits(box, 4).tolist() == [[3, 4, 0], [12, 11, 15]]
    assert grid_limits(box, 5).tolist() == [[7, 8, 0], [24, 23, 31]]
    assert grid_limits(Box(box.lower, box.upper + 1e-9), 4).tolist() == [[3, 4, 0], [12, 11, 15]]
    cells = [(x, y, z) for x in range(3, 13) for y in range(4, 12) for z in range(16)]
    assert grid_within(box, 4).tolist() == [list(cell) for cell in cells]


def test_radical_inverses_mirror_the_binary_digits() -> None:
    assert radical_inverses(9).tolist() == [0.0, 0.5, 0.25, 0.75, 0.125, 0.625, 0.375, 0.875, 0.0625]


def test_the_shape_of_masks_is_their_hull_without_colours(scene: Scene) -> None:
    reconstructor = Reconstructor(scene.cameras, scene.box, HullSettings(hull_depth=6))
    masks = [view.mask for view in scene.masks.views]
    shape, hull = reconstructor.shape(masks), reconstructor.hull(scene.masks)
    np.testing.assert_array_equal(shape.centres, hull.centres)
    np.testing.assert_array_equal(shape.edges, hull.edges)
    assert shape.colours.shape == hull.colours.shape
    assert shape.view_colours.shape == hull.view_colours.shape
    assert np.isnan(shape.colours).all()
    assert np.isnan(shape.view_colours).all()
    assert (shape.depth, shape.box) == (6, scene.box)
    with pytest.raises(FootageError, match="4 masks for 5 cameras"):
        reconstructor.shape(masks[:4])
    with pytest.raises(FootageError, match="ring1"):
        reconstructor.shape([masks[0], masks[1][:-1], *masks[2:]])


def test_a_hull_is_carved_from_32_cameras_at_most(scene: Scene) -> None:
    check_views([scene.cameras[0]])
    check_views([scene.cameras[0]] * 32)
    for count in (0, 33):
        with pytest.raises(FootageError, match=f"from {count} cameras"):
            check_views([scene.cameras[0]] * count)


def test_the_first_depth_has_the_voxels_that_enough_views_see(scene: Scene) -> None:
    for least in (1, 4, 5, 9):
        reconstructor = Reconstructor(scene.cameras, scene.box, HullSettings(hull_least_views=least))
        edge = scene.box.edge / 16.0
        nodes = grid_within(scene.box, 4)
        states, samples = np.zeros((len(nodes), 3), np.uint32), np.zeros(len(nodes), np.int64)
        first_look(nodes, scene.box.corner, edge, reconstructor._table, 1.0, states, samples)
        seeing = np.array([5 - sum(int(bits) >> view & 1 for view in range(5)) for bits in states[:, 1]])
        kept = seeing >= min(least, 5)
        np.testing.assert_array_equal(reconstructor._first, nodes[kept])
        np.testing.assert_array_equal(reconstructor._first_states, states[kept])
        assert len(reconstructor._heights) == samples.max()
        assert reconstructor._rules.least_views == min(least, 5)
    sizes = [
        (camera.width * camera.height, (camera.width + 1) * (camera.height + 1)) for camera in scene.cameras
    ]
    assert reconstructor._starts.tolist() == np.cumsum([(0, 0), *sizes], axis=0).T.tolist()
