"""Bodies of many sizes weighed at once, against bodies built and weighed one by one."""

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.model import kinematic_tables
from studio.body.shape_space import shape_space
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.errors import FootageError
from studio.results.drawing_footage.cameras import placed_camera
from studio.search.likelihood.kinematic_program import compile_program
from studio.search.likelihood.outlines import OutlineProjector
from studio.search.likelihood.shape_silhouettes import (
    POSES,
    ShapePrograms,
    ShapeSilhouettes,
    limbs_of_ball_joints,
    round_off,
)
from studio.search.likelihood.silhouette_areas import HALF, Silhouettes

CAMERAS = tuple(
    placed_camera(f"c{n}", place, (0.0, 0.0, 900.0), size=(160, 120), focal_px=110.0)
    for n, place in enumerate([(3500.0, 0.0, 1500.0), (0.0, 3500.0, 1500.0), (-2500.0, -2500.0, 1500.0)])
)


def frames(rng: np.random.Generator, count: int) -> list[FrameEvidence]:
    """Masks of random blocks; the last camera of the first frame sees nothing."""
    found = []
    for number in range(count):
        views = []
        for index, camera in enumerate(CAMERAS):
            mask = np.zeros((120, 160), np.uint8)
            if (number, index) != (0, 2):
                top, left = rng.integers(10, 40), rng.integers(40, 80)
                mask[top : top + 70, left : left + 30] = 255
            views.append(ViewEvidence(camera.name, np.zeros((120, 160, 3), np.uint8), mask, mask))
        found.append(FrameEvidence(number, tuple(views)))
    return found


def test_programs_of_shapes_are_those_of_their_bodies() -> None:
    rng = np.random.default_rng(0)
    for name in ("human31", "human35", "dog"):
        space = shape_space(load_body(name), flesh=True)
        programs = ShapePrograms(space)
        shape = rng.normal(0.0, 0.1, len(space.groups))
        ours = programs.program(shape)
        built = compile_program(kinematic_tables(space.body_of(shape)))
        np.testing.assert_allclose(ours.fixed, built.fixed, atol=2e-3)
        np.testing.assert_allclose(ours.limb_shape, built.limb_shape, atol=2e-3)
        assert (ours.kind == built.kind).all()


def test_fitness_is_that_of_rounded_bodies_one_by_one() -> None:
    rng = np.random.default_rng(1)
    space = shape_space(load_body("human31"))
    seen = frames(rng, 2)
    shapes = rng.normal(0.0, 0.08, (3, len(space.groups)))
    poses = space.body.neutral + rng.normal(0.0, 0.2, (3, 2, POSES, len(space.body.neutral)))
    found = ShapeSilhouettes(space, CAMERAS, seen).fitness(shapes, poses)
    assert found.shape == (3, 2, POSES)
    for m, shape in enumerate(shapes):
        projector = OutlineProjector.of_body(space.body_of(shape), CAMERAS)
        for k, evidence in enumerate(seen):
            outlines = projector.blocks(poses[m, k])
            round_off(outlines, limbs_of_ball_joints(space.body))
            areas = Silhouettes(evidence, HALF).areas(outlines, POSES).fitness()
            expected = areas[:, :2].mean(axis=1) if k == 0 else areas.mean(axis=1)
            np.testing.assert_allclose(found[m, k], expected, atol=3e-3)


def test_masks_of_other_cameras_are_refused() -> None:
    space = shape_space(load_body("human31"))
    with pytest.raises(FootageError):
        ShapeSilhouettes(space, CAMERAS[:2], frames(np.random.default_rng(0), 1))
