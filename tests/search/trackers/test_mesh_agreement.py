"""Links compared with masks by their own silhouettes: what agrees, is bare or hidden, and what is drawn of them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from meshed_arm import CAMERAS, TRUE, arm
from meshed_masks import posed_triangles, triangles_mask

from studio.body.model import BodyModel
from studio.evidence.distance_maps import SilhouetteDistances, distances_of
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.runs.drawing.overlay_drawing import projected_silhouette
from studio.search.likelihood.mesh_outlines import MeshOutlines, _closed_lines
from studio.search.likelihood.overlay import limb_contours
from studio.search.trackers.agreement import FAR_MM, Agreement, Disagreement
from studio.search.trackers.hidden_areas import cell_size, counts_of, learnt
from studio.search.trackers.loss_detection import Onlooker
from studio.search.trackers.tracker import HIDDEN, LIMB_LOST_SHARE

Array = np.ndarray
ASTRAY = TRUE + np.radians([0.0, 0.0, 70.0])


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return arm()


@pytest.fixture(scope="module")
def masks(body: BodyModel) -> list[Array]:
    return [triangles_mask(camera, posed_triangles(body, TRUE)) for camera in CAMERAS]


@pytest.fixture(scope="module")
def seen(masks: list[Array]) -> list[SilhouetteDistances]:
    return [distances_of(mask, 300) for mask in masks]


def without_meshes(body: BodyModel) -> BodyModel:
    return replace(body, meshes=())


def off(body: BodyModel, pose: Array, seen: list[SilhouetteDistances]) -> Disagreement:
    return Agreement(body, CAMERAS).of(pose, seen)


def test_links_that_are_where_they_seem_agree_though_their_cones_do_not(
    body: BodyModel, seen: list[SilhouetteDistances]
) -> None:
    assert off(body, TRUE, seen).shares() == {"arm": 0.0}
    assert off(without_meshes(body), TRUE, seen).shares()["arm"] > LIMB_LOST_SHARE


def test_a_turned_link_is_outside_and_leaves_bare_what_is_far_from_all_links(
    body: BodyModel, masks: list[Array], seen: list[SilhouetteDistances]
) -> None:
    """Beside areas by OpenCV's distances, pixel by pixel."""
    found = off(body, ASTRAY, seen)
    assert found.shares()["arm"] > LIMB_LOST_SHARE
    for view, (camera, mask, mm) in enumerate(zip(CAMERAS, masks, found.mm, strict=True)):
        links = triangles_mask(camera, posed_triangles(body, ASTRAY))
        for column, (whole, other) in zip(
            (found.bare, found.outside), ((mask, links), (links, mask)), strict=True
        ):
            away = cv2.distanceTransform(255 - other, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
            expected = np.count_nonzero((whole > 0) & (away > FAR_MM / mm)) * mm**2
            assert column[view].sum() == pytest.approx(expected, rel=0.15, abs=3000.0)
        assert found.area[view].sum() == pytest.approx(np.count_nonzero(links) * mm**2, rel=0.12)
    # Only the last link has moved; what it left is nearest to it.
    assert found.outside[:, 2].sum() == found.outside.sum() > 0.0
    assert not found.bare[:, :2].any()


def test_the_place_that_the_masks_show_disagrees_least(
    body: BodyModel, seen: list[SilhouetteDistances]
) -> None:
    drawn = np.repeat(TRUE[None], 25, axis=0)
    drawn[:, 2] = np.radians(np.linspace(-140.0, 140.0, 25)) + (TRUE[2] - np.radians(35.0))
    found = Agreement(body, CAMERAS).of_places(drawn, seen)
    assert np.abs(np.degrees(drawn[np.argmin(found), 2] - TRUE[2])) < 7.0


def test_the_overlap_is_that_of_the_links(body: BodyModel, masks: list[Array]) -> None:
    views = [
        ViewEvidence(camera.name, np.repeat(mask[..., None], 3, axis=2) // 2 + 20, mask, np.zeros_like(mask))
        for camera, mask in zip(CAMERAS, masks, strict=True)
    ]
    evidence = FrameEvidence(0, tuple(views))
    for pose, least, most in ((TRUE, 0.93, 1.0), (ASTRAY, 0.5, 0.85)):
        both = [
            (mask > 0, triangles_mask(camera, posed_triangles(body, pose)) > 0)
            for camera, mask in zip(CAMERAS, masks, strict=True)
        ]
        shares = [np.count_nonzero(m & own) * (0.5 / m.sum() + 0.5 / own.sum()) for m, own in both]
        sight = Onlooker(body, CAMERAS).sight(evidence, pose)
        assert sight.seen
        assert sight.overlap == pytest.approx(np.mean(shares), abs=0.05)
        assert least < sight.overlap < most
    assert Onlooker(without_meshes(body), CAMERAS).sight(evidence, TRUE).overlap < 0.85


def test_only_what_links_cover_is_counted_as_hidden(body: BodyModel, masks: list[Array]) -> None:
    """Masks that lack the upper half: links are expected there, and what cones cover beside them is not."""
    cut = [mask.copy() for mask in masks]
    for mask in cut:
        mask[: int(np.median(np.nonzero(mask)[0]))] = 0
    views = [distances_of(mask, 300) for mask in cut]
    found = off(body, TRUE, views)
    memory = learnt({}, found, CAMERAS, views)
    for camera, mask in zip(CAMERAS, masks, strict=True):
        cell, counts = cell_size(camera), memory[HIDDEN + camera.name]
        rows, columns = (np.argwhere(counts > 0.0) * cell + cell // 2).T
        assert counts.shape == counts_of({}, camera).shape
        assert len(rows)
        near = cv2.dilate(mask, np.ones((3, 3), np.uint8))
        inside = (rows < mask.shape[0]) & (columns < mask.shape[1])
        assert (near[rows[inside], columns[inside]] > 0).all()


def test_contours_of_links_fill_what_the_links_cover(body: BodyModel, masks: list[Array]) -> None:
    outlines = MeshOutlines(body, CAMERAS).silhouettes(TRUE)
    views = zip(CAMERAS, limb_contours(body, CAMERAS, TRUE), outlines, masks, strict=True)
    for camera, contours, silhouette, mask in views:
        assert len(contours) == len(body.drawn)
        filled = projected_silhouette(contours, camera.height, camera.width)
        np.testing.assert_array_equal(filled, silhouette)
        both, either = np.count_nonzero(filled & mask), np.count_nonzero(filled | mask)
        assert both > 0.9 * either


def test_closed_lines_go_around_pieces_and_holes() -> None:
    inside = np.zeros((40, 50), np.bool_)
    inside[4:30, 6:28], inside[10:20, 12:20] = True, False
    inside[33:38, 40:49] = inside[0, 0] = True
    lines = _closed_lines(inside)
    assert sorted(len(line) for line in lines) == [2, 25, 37, 93]
    filled = np.zeros(inside.shape, np.uint8)
    cv2.fillPoly(filled, [line.astype(np.int32) for line in lines], (1,))
    np.testing.assert_array_equal(filled > 0, inside)
    assert _closed_lines(np.zeros((3, 4), np.bool_)) == []
