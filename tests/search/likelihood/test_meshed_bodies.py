"""Outlines and silhouettes of a body with meshes, against plain drawing and differences."""

import numpy as np
import pytest
from meshed_arm import CAMERAS, TRUE, arm
from pixel_centres import triangles_drawn
from scipy.ndimage import gaussian_filter
from weighting_scene import looking_at

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.search.likelihood import mesh_outlines
from studio.search.likelihood.mesh_outlines import MeshOutlines, all_meshes
from studio.search.likelihood.mesh_silhouettes import MeshSilhouettes

BENT = looking_at("bent", np.array([1900.0, 300.0, 900.0]), np.array([0.0, 0.0, 700.0]), (161, 120), 110.0)
NEAR = looking_at("near", np.array([700.0, 300.0, 900.0]), np.array([0.0, 0.0, 700.0]), (120, 90), 110.0)


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return arm()


def drawn(
    body: BodyModel, camera: Camera, pose: np.ndarray, shrink: int = 1, share: float = 0.0
) -> np.ndarray:
    """(H, W) whether a pixel's centre lies in the body's picture, which is `shrink` times smaller."""
    points, triangles, joints = all_meshes(body, share)
    frames = joint_frames(body, pose)[0][joints]
    pixels, depths = project(camera, np.einsum("kij,kj->ki", frames[..., :3], points) + frames[..., 3])
    seen = np.column_stack([(pixels + 0.5) / shrink - 0.5, depths])
    return triangles_drawn(seen, triangles, camera.width // shrink, camera.height // shrink)[0] >= 0


def test_all_meshes_are_joined_with_their_joints(body: BodyModel) -> None:
    points, triangles, joints = all_meshes(body)
    assert len(body.meshes) == 6
    corners = np.concatenate([mesh.points[mesh.triangles] for mesh in body.meshes])
    np.testing.assert_array_equal(points[triangles], corners)
    owners = np.concatenate([np.full(len(mesh.points), mesh.joint) for mesh in body.meshes])
    np.testing.assert_array_equal(joints, owners)


def test_a_coarser_mesh_keeps_one_point_of_every_cube(body: BodyModel) -> None:
    points, triangles, joints = all_meshes(body, 0.2)
    whole = all_meshes(body)
    assert len(points) < len(whole[0])
    assert len(triangles) < len(whole[1])
    first = points[joints == body.meshes[0].joint]
    # A link's mesh is 400 mm long, its crossbar 300 mm.
    apart = np.linalg.norm(first[:, None] - whole[0][whole[2] == body.meshes[0].joint], axis=2).min(axis=1)
    assert apart.max() <= 80.0 * np.sqrt(3.0)
    assert triangles.max() < len(points)


@pytest.mark.parametrize("camera", [BENT, NEAR], ids=lambda camera: camera.name)
def test_a_silhouette_is_the_union_of_all_triangles(body: BodyModel, camera: Camera) -> None:
    (found,) = MeshOutlines(body, (camera,)).silhouettes(TRUE)
    wanted = drawn(body, camera, TRUE)
    assert 500 < wanted.sum() < wanted.size
    np.testing.assert_array_equal(found, np.where(wanted, 255, 0))


@pytest.mark.parametrize("camera", [BENT, NEAR], ids=lambda camera: camera.name)
def test_an_outline_is_all_pixels_beside_others_with_its_normals(body: BodyModel, camera: Camera) -> None:
    (outline,) = MeshOutlines(body, (camera,)).of(TRUE)
    inside = drawn(body, camera, TRUE)
    around = np.pad(inside, 1)
    amid = around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:]
    border = inside & ~amid
    border[[0, -1]] = border[:, [0, -1]] = False
    y, x = np.nonzero(border)
    np.testing.assert_array_equal(outline.border, np.stack([x, y], axis=1))
    smooth = gaussian_filter(inside.astype(float), 1.5)
    away = np.stack([smooth[y, x - 1] - smooth[y, x + 1], smooth[y - 1, x] - smooth[y + 1, x]], axis=1)
    # The picture's own border is smoothed otherwise.
    kept = (x > 8) & (y > 8) & (x < camera.width - 9) & (y < camera.height - 9)
    wanted = away / np.linalg.norm(away, axis=1, keepdims=True)
    np.testing.assert_allclose(outline.outward[kept], wanted[kept], atol=1e-4)


@pytest.mark.parametrize("camera", [BENT, CAMERAS[0]], ids=lambda camera: camera.name)
def test_points_of_an_outline_lie_on_the_mesh_that_they_move_with(body: BodyModel, camera: Camera) -> None:
    (outline,) = MeshOutlines(body, (camera,)).of(TRUE)
    frames = joint_frames(body, TRUE)[0][outline.joint]
    world = np.einsum("kij,kj->ki", frames[..., :3], outline.own) + frames[..., 3]
    np.testing.assert_allclose(project(camera, world)[0], outline.border, atol=1e-3)
    points, triangles, joints = all_meshes(body)
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    height = np.abs(np.einsum("fi,kfi->kf", normals, outline.own[:, None] - corners[:, 0]))
    height[outline.joint[:, None] != joints[triangles[:, 0]]] = np.inf
    # Depths are in single precision, and even in the picture, though a lens bends it.
    assert height.min(axis=1).max() < 1.0
    assert len(np.unique(outline.joint)) == 3


def test_nothing_seen_has_no_outline(body: BodyModel) -> None:
    away = looking_at("away", np.array([1900.0, 0.0, 700.0]), np.array([4000.0, 0.0, 700.0]))
    (outline,) = MeshOutlines(body, (away,)).of(TRUE)
    assert [part.shape for part in (outline.border, outline.outward, outline.joint, outline.own)] == [
        (0, 2),
        (0, 2),
        (0,),
        (0, 3),
    ]


def test_a_long_outline_is_thinned(body: BodyModel, monkeypatch: pytest.MonkeyPatch) -> None:
    outlines = MeshOutlines(body, (BENT,))
    whole = outlines.of(TRUE)[0].border
    for most in (len(whole), len(whole) - 1, 50):
        monkeypatch.setattr(mesh_outlines, "MOST_POINTS", most)
        np.testing.assert_array_equal(outlines.of(TRUE)[0].border, whole[:: -(-len(whole) // most)])


def test_slopes_are_differences_of_pixels_along_the_normals(body: BodyModel) -> None:
    outlines, size = MeshOutlines(body, (NEAR, BENT)), np.array([1e-3, 2e-3, 5e-4])
    outline = outlines.of(TRUE)[1]
    rows = np.arange(3, len(outline.border), 5)
    found = outlines.slopes(TRUE, 1, outline, rows, size)
    for entry in range(3):
        step, places = np.eye(3)[entry] * size[entry], []
        for pose in (TRUE + step, TRUE - step):
            frames = joint_frames(body, pose)[0][outline.joint[rows]]
            places.append(np.einsum("kij,kj->ki", frames[..., :3], outline.own[rows]) + frames[..., 3])
        moved = project(BENT, places[0])[0] - project(BENT, places[1])[0]
        wanted = (moved * outline.outward[rows]).sum(axis=1) / (2.0 * size[entry])
        np.testing.assert_allclose(found[:, entry], wanted, atol=1e-9)
    assert np.abs(found).max() > 10.0


def evidence_of(cameras: tuple[Camera, ...], masks: list[np.ndarray]) -> FrameEvidence:
    nothing = np.zeros((0, 0, 3), np.uint8)
    return FrameEvidence(
        0, tuple(ViewEvidence(c.name, nothing, mask, mask) for c, mask in zip(cameras, masks, strict=True))
    )


def test_a_log_weight_is_the_share_of_the_masks_that_a_coarse_body_misses(body: BodyModel) -> None:
    """Masks as long as 80, 203 and no pixels: of the whole picture, of one 3 times smaller, of one 4 times smaller."""
    long = looking_at(
        "long", np.array([1500.0, -900.0, 900.0]), np.array([0.0, 0.0, 700.0]), (331, 250), 230.0
    )
    empty = looking_at(
        "empty", np.array([1500.0, 900.0, 900.0]), np.array([0.0, 0.0, 700.0]), (330, 120), 110.0
    )
    cameras, shrink = (BENT, long, empty), (1, 3, 4)
    masks = [np.zeros((camera.height, camera.width), np.uint8) for camera in cameras]
    masks[0][20:101, 70:95], masks[1][30:234, 100:191] = 128, 255
    masks[0][:, 5] = 127  # no foreground
    poses = np.array([TRUE, TRUE + 0.3])
    found = MeshSilhouettes(body, cameras, evidence_of(cameras, masks)).log_likelihood(poses)
    whole, wrong = 0.0, np.zeros(2)
    for camera, mask, factor in zip(cameras, masks, shrink, strict=True):
        height, width = camera.height // factor, camera.width // factor
        kept = (mask >= 128)[: height * factor, : width * factor]
        small = kept.reshape(height, factor, width, factor).mean(axis=(1, 3))
        whole += small.sum()
        for n, pose in enumerate(poses):
            inside = drawn(body, camera, pose, factor, 1.0 / 9.0)
            wrong[n] += np.where(inside, 1.0 - small, small).sum()
    np.testing.assert_allclose(found, -20.0 * 3 * wrong / whole, rtol=1e-4)
