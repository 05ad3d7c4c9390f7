"""Meshes of bodies: written into a body's file and read again, broken ones, cones as meshes, coarser ones."""

import numpy as np
import pytest

from studio.body.meshes import MeshEntry, coarser, cone_mesh, mesh_entry, mesh_of

POINTS = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def test_a_mesh_comes_back() -> None:
    points, triangles = mesh_of(mesh_entry("arm", POINTS, FACES))
    np.testing.assert_array_equal(points, POINTS)
    np.testing.assert_array_equal(triangles, FACES)


@pytest.mark.parametrize(
    ("points", "triangles"),
    [
        (POINTS, FACES[:0]),
        (POINTS[:3], FACES),
        (np.where(POINTS == 10.0, np.nan, POINTS), FACES),
    ],
)
def test_what_is_no_mesh_is_refused(points: np.ndarray, triangles: np.ndarray) -> None:
    with pytest.raises(ValueError, match="no mesh"):
        mesh_of(mesh_entry("arm", points, triangles))


def test_text_that_was_cut_off_is_refused() -> None:
    whole = mesh_entry("arm", np.random.default_rng(0).normal(size=(200, 3)), FACES)
    with pytest.raises(ValueError, match=r"cut off|padding|base64"):
        mesh_of(MeshEntry("arm", whole.points[: len(whole.points) // 8 * 4], whole.triangles))


def test_a_cones_mesh_is_closed_and_as_wide_and_long_as_it() -> None:
    points, triangles = cone_mesh(300.0, (40.0, 20.0), (1.5, 0.5))
    low, high = points[points[:, 2] == 0.0], points[points[:, 2] == 300.0]
    np.testing.assert_allclose(np.ptp(low[:, :2], axis=0), [120.0, 40.0], rtol=1e-3)
    np.testing.assert_allclose(np.ptp(high[:, :2], axis=0), [60.0, 20.0], rtol=1e-3)
    edges = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1
    )
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    one, two, three = (points[triangles[:, corner]] for corner in range(3))
    volume = float(np.einsum("ij,ij->i", one, np.cross(two, three)).sum()) / 6.0
    assert abs(volume) == pytest.approx(np.pi * 0.75 * 300.0 / 3.0 * (40**2 + 40 * 20 + 20**2), rel=0.03)


def test_a_cones_mesh_is_of_two_rings_and_their_middles_and_faces_outwards() -> None:
    points, triangles = cone_mesh(300.0, (40.0, 20.0), (1.5, 0.5))
    assert (len(points), len(triangles)) == (66, 128)
    for corner in range(32):
        angle = corner * np.pi / 16
        for start, radius, z in ((0, 40.0, 0.0), (32, 20.0, 300.0)):
            place = [1.5 * radius * np.cos(angle), 0.5 * radius * np.sin(angle), z]
            np.testing.assert_allclose(points[start + corner], place, atol=1e-9)
    np.testing.assert_array_equal(points[64:], [[0.0, 0.0, 0.0], [0.0, 0.0, 300.0]])
    one, two, three = (points[triangles[:, corner]] for corner in range(3))
    outward = np.cross(two - one, three - one)
    assert (np.einsum("ij,ij->i", outward, (one + two + three) / 3.0 - [0.0, 0.0, 150.0]) > 0.0).all()


@pytest.mark.parametrize("offset", [0.0, -17.0])
def test_points_of_one_cube_become_their_mean_and_faces_that_are_none_go(offset: float) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [4, 0, 0], [0, 4, 0], [0, 5, 0], [4, 1, 3]]) + offset
    triangles = np.array([[2, 5, 4], [0, 2, 3], [4, 1, 2], [0, 1, 2], [2, 4, 3], [4, 3, 4], [1, 2, 0]])
    fewer, faces = coarser(points, triangles, 2.0)
    np.testing.assert_allclose(fewer, np.array([[0.5, 0, 0], [0, 4.5, 0], [4, 0, 0], [4, 1, 3]]) + offset)
    assert faces.tolist() == [[2, 3, 1], [0, 2, 1]]


def test_a_mesh_may_have_a_million_numbers_and_no_more() -> None:
    assert len(mesh_of(mesh_entry("arm", np.zeros((333_333, 3)), FACES))[0]) == 333_333
    with pytest.raises(ValueError, match="too large"):
        mesh_of(mesh_entry("arm", np.zeros((333_334, 3)), FACES))


def test_points_have_three_columns_and_faces_points_that_there_are() -> None:
    with pytest.raises(ValueError, match="three columns"):
        mesh_of(mesh_entry("arm", np.zeros((2, 2)), FACES))
    with pytest.raises(ValueError, match="no mesh"):
        mesh_of(mesh_entry("arm", POINTS, FACES + 1))


def test_a_coarser_mesh_stays_within_half_a_cell_and_loses_what_has_shrunk_to_a_line() -> None:
    points, triangles = cone_mesh(300.0, (40.0, 20.0), (1.0, 1.0))
    fewer, faces = coarser(points, triangles, 25.0)
    assert len(fewer) < len(points)
    apart = np.linalg.norm(points[:, None] - fewer[None], axis=2).min(axis=1)
    assert apart.max() < 25.0
    assert (np.sort(faces, axis=1)[:, :-1] < np.sort(faces, axis=1)[:, 1:]).all()
    assert len(np.unique(np.sort(faces, axis=1), axis=0)) == len(faces)
