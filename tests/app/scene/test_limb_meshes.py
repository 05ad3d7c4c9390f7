"""Limb meshes against closed forms and the kinematics' own end points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studio.app.scene.body_view import SECTIONS, limb_frames, limb_mesh
from studio.body.catalogue import list_bodies, load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.model import Limb


@pytest.mark.parametrize("length", [400.0, -400.0])
def test_a_cone_has_the_volume_and_extent_of_its_shape(length: float) -> None:
    limb = Limb("limb", 0, length, 90.0, 60.0, 0.8, 1.1, "left")
    mesh = limb_mesh(limb)
    # A cone of regular polygons: Simpson's formula is exact for its quadratic cross-section.
    polygon = 0.5 * SECTIONS * np.sin(2.0 * np.pi / SECTIONS) * 0.8 * 1.1
    volume = polygon * abs(length) / 6.0 * (90.0**2 + 4.0 * 75.0**2 + 60.0**2) * 1e-9
    assert mesh.volume == pytest.approx(volume, rel=1e-9)
    low, high = mesh.bounds
    assert (low[2], high[2]) == pytest.approx((min(0.0, length) / 1000.0, max(0.0, length) / 1000.0))
    assert high[0] == pytest.approx(0.8 * 0.09, rel=0.01)
    assert high[1] == pytest.approx(1.1 * 0.09, rel=0.01)


@pytest.mark.parametrize("name", list_bodies())
def test_every_drawn_limb_of_every_body_is_a_closed_surface_facing_outwards(name: str) -> None:
    for limb in load_body(name).drawn:
        mesh = limb_mesh(limb)
        mesh.merge_vertices()
        assert mesh.is_watertight
        assert mesh.volume > 0.0


@pytest.mark.parametrize("name", list_bodies())
def test_frames_carry_the_axes_to_the_kinematics_end_points(name: str) -> None:
    body = load_body(name)
    rng = np.random.default_rng(3)
    pose = body.neutral + rng.uniform(-0.5, 0.5, len(body.parameters))
    wxyz, positions = limb_frames(body, pose)
    ends = limb_ends(body, pose)[0] / 1000.0
    turns = Rotation.from_quat(wxyz, scalar_first=True)
    lengths = np.array([limb.length for limb in body.drawn]) / 1000.0
    tips = positions + turns.apply(np.stack([0 * lengths, 0 * lengths, lengths], axis=-1))
    np.testing.assert_allclose(positions, ends[:, 0], atol=1e-12)
    np.testing.assert_allclose(tips, ends[:, 1], atol=1e-12)
