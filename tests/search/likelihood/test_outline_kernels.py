"""The parts of the outlines' kernels: angles, frames and corners against NumPy, SciPy and the geometry's own code."""

import numpy as np
import pytest
from made_outlines import outlines_of
from scipy.spatial.transform import Rotation
from weighting_scene import looking_at, scattered

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_frames
from studio.body.model import kinematic_tables
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import camera_table, outward_limit
from studio.foundations.geometry.cones import limb_outlines
from studio.foundations.geometry.projection import project
from studio.search.likelihood.kinematic_program import (
    FIXED_MOTION,
    FIXED_MOVE,
    KinematicProgram,
    compile_program,
)
from studio.search.likelihood.outline_kernels import (
    LANES,
    ROWS,
    block_frames,
    outline_blocks,
    outline_of,
    projected,
    read_corners,
    read_slopes,
    sideways,
    sine_cosine,
    view_of,
)

PLAIN = Camera(
    "plain", 64, 48, np.array([[100.0, 0.0, 31.0], [0.0, 100.0, 23.0], [0.0, 0.0, 1.0]]), np.zeros(5), np.eye(3),
    np.zeros(3),
)  # fmt: skip
NOWHERE = (np.float32(0.0),) * 3


def table_of(*cameras: Camera) -> Array:
    return camera_table(cameras, outward_limit, np.float32)


def single(*numbers: float) -> tuple[np.float32, ...]:
    return tuple(np.float32(number) for number in numbers)


def test_sine_and_cosine_of_half_a_turn_either_way() -> None:
    angles = np.linspace(-np.pi, np.pi, 4001).astype(np.float32)
    found = np.array([sine_cosine(angle) for angle in angles])
    exact = angles.astype(float)
    np.testing.assert_allclose(found, np.stack([np.sin(exact), np.cos(exact)], axis=1), atol=7e-7)


def every_kind() -> KinematicProgram:
    """Three frames of all kinds of operation: the second hangs from the first, the third from the world."""
    rng = np.random.default_rng(8)
    kind = np.array([3, 0, 1, FIXED_MOVE, 2, 4, FIXED_MOTION, 1, 5, 2, FIXED_MOTION, 0])
    parameter = np.array([0, 1, 2, -1, 3, 4, -1, 1, 5, 2, -1, 0])
    fixed = np.zeros((12, 3, 4))
    fixed[:, :, :3] = np.eye(3)
    for number in np.flatnonzero(kind >= FIXED_MOVE):
        fixed[number, :, 3] = rng.uniform(-200.0, 200.0, 3)
    for number in np.flatnonzero(kind == FIXED_MOTION):
        fixed[number, :, :3] = Rotation.random(random_state=int(number)).as_matrix()
    return KinematicProgram(
        np.array([-1, 0, -1]), np.array([0, 5, 9, 12]), kind, parameter,
        np.array([2.0, -1.0, 1.0, 0.0, 0.5, 1.0, 0.0, 1.5, -3.0, 1.0, 0.0, 1.0], np.float32),
        fixed.astype(np.float32), np.arange(3), np.ones((3, 5), np.float32), 6,
    )  # fmt: skip


def frames_of(program: KinematicProgram, poses: Array, block: int) -> Array:
    """(16, F, 3, 4) by the kernel."""
    frames = np.zeros((len(program.parent), 12 * LANES), np.float32)
    entries, motions = np.zeros((poses.shape[1], LANES)), np.zeros((len(program.kind), 2 * LANES), np.float32)
    block_frames(block, poses, program, entries, motions, frames)
    return frames.reshape(-1, 3, 4, LANES).transpose(3, 0, 1, 2)


def test_frames_are_products_of_all_motions() -> None:
    program = every_kind()
    poses = np.random.default_rng(0).uniform(-40.0, 40.0, (21, 6))
    for block in (0, 1):
        found = frames_of(program, poses, block)
        for lane in range(LANES):
            # Lanes past the last pose repeat it.
            pose, frames = poses[min(16 * block + lane, 20)], []
            for joint, parent in enumerate(program.parent):
                frame = np.eye(4) if parent < 0 else frames[parent]
                for k in range(program.first_operation[joint], program.first_operation[joint + 1]):
                    kind, motion = program.kind[k], np.eye(4)
                    amount = program.value[k] * pose[program.parameter[k]]
                    if kind < 3:
                        motion[:3, :3] = Rotation.from_euler("xyz"[kind], amount).as_matrix()
                    elif kind < 6:
                        motion[kind - 3, 3] = amount
                    else:
                        motion[:3] = program.fixed[k]
                    frame = frame @ motion
                frames.append(frame)
            np.testing.assert_allclose(found[lane], np.array(frames)[:, :3], atol=2e-3)


@pytest.mark.parametrize("name", ["human31", "fly48", "hand25"])
def test_frames_of_limbs_are_those_of_the_kinematics(name: str) -> None:
    body = load_body(name)
    program, poses = compile_program(kinematic_tables(body)), scattered(body, 16)
    found = frames_of(program, poses, 0)[:, program.limb_frame]
    np.testing.assert_allclose(found, limb_frames(body, poses), atol=2e-3)


def test_a_point_of_a_limb_is_projected_as_the_geometry_does() -> None:
    camera = looking_at("c", np.array([900.0, 200.0, 300.0]), np.zeros(3))
    view, rng = view_of(table_of(camera)[0]), np.random.default_rng(1)
    kinds = set()
    for _ in range(200):
        world = rng.uniform(-700.0, 700.0, 3)
        axis, across = rng.uniform(-100.0, 100.0, 3), rng.uniform(-1.0, 1.0, 3)
        along, radius = rng.uniform(0.0, 1.0), rng.uniform(-50.0, 50.0)
        start = camera.rotation @ world + camera.translation
        place = start + along * axis + radius * across
        u, v, state = projected(
            view, single(*start), single(*axis), single(*across), np.float32(along), np.float32(radius)
        )
        back = camera.rotation.T @ (place - camera.translation)
        pixel = project(camera, back[None])[0][0]
        flat = (place[:2] ** 2).sum() / place[2] ** 2
        if place[2] < 10.0 or flat > outward_limit(camera):
            assert (u, v, state) == (-1e6, -1e6, -1.0)
            kinds.add(-1)
            continue
        np.testing.assert_allclose([u, v], pixel, rtol=1e-5, atol=0.01)
        inside = (pixel > -0.49).all() and (pixel < np.array([camera.width, camera.height]) - 0.51).all()
        assert state == float(inside)
        kinds.add(int(inside))
    assert {0, 1} <= kinds


def test_a_place_is_inside_up_to_a_hundredth_of_a_pixel_from_the_border() -> None:
    view = view_of(table_of(PLAIN)[0])
    middle = np.array([30.0, 20.0])

    def state_at(x: float, y: float, z: float = 1000.0) -> float:
        start = single((x - 31.0) * z / 100.0, (y - 23.0) * z / 100.0, z)
        return projected(view, start, NOWHERE, NOWHERE, np.float32(0.0), np.float32(0.0))[2]

    for axis, last in ((0, 63.5), (1, 47.5)):
        for place, wanted in (
            (-0.485, 1),
            (-0.495, 0),
            (-0.6, 0),
            (last - 0.015, 1),
            (last - 0.005, 0),
            (last + 0.1, 0),
        ):
            point = middle.copy()
            point[axis] = place
            assert state_at(*point) == wanted
    assert [state_at(31.0, 23.0, z) for z in (10.01, 9.99, -5.0)] == [1.0, -1.0, -1.0]


def test_a_point_beyond_the_lens_is_not_seen() -> None:
    lens = np.array([-0.5, 0.0, 0.0, 0.0, 0.0])
    view = view_of(table_of(Camera("c", 640, 480, PLAIN.matrix, lens, np.eye(3), np.zeros(3)))[0])
    fold = np.sqrt(2.0 / 3.0)
    for tangent, seen in ((fold - 1e-3, True), (fold + 1e-3, False)):
        for x, y in ((tangent, 0.0), (0.0, tangent), (tangent / 2**0.5, tangent / 2**0.5)):
            start = single(100.0 * x, 100.0 * y, 100.0)
            state = projected(view, start, NOWHERE, NOWHERE, np.float32(0.0), np.float32(0.0))[2]
            assert (state >= 0.0) == seen


def test_the_way_across_a_limb_is_square_to_where_the_camera_lies() -> None:
    for x, y, scale_x, scale_y in ((3.0, 4.0, 1.0, 1.0), (-200.0, 90.0, 0.7, 1.3), (0.0, -2.0, 2.0, 0.5)):
        flat = np.array([x / scale_x, y / scale_y])
        wanted = np.array([flat[1], -flat[0]]) / np.linalg.norm(flat) * [scale_x, scale_y]
        np.testing.assert_allclose(sideways(*single(x, y, scale_x, scale_y)), wanted, rtol=1e-6, atol=1e-6)
    # Seen from its own axis a limb is as wide any way.
    np.testing.assert_allclose(sideways(*single(0.0, 0.0, 0.7, 1.3)), [0.7, 0.0])


def test_an_outline_has_its_corners_the_least_of_their_states_and_the_depth_of_its_middle() -> None:
    rng = np.random.default_rng(2)
    cameras = tuple(
        looking_at(f"c{k}", np.array(place), np.zeros(3), size)
        for k, (place, size) in enumerate(
            [((900.0, 200.0, 300.0), (320, 240)), ((-400.0, 700.0, 100.0), (200, 260))]
        )
    )
    table, states = table_of(*cameras), set()
    for seed in range(40):
        turn, place = Rotation.random(random_state=seed).as_matrix(), rng.uniform(-450.0, 450.0, 3)
        frame = np.column_stack([turn, place])
        shape = np.array([rng.uniform(-300.0, 300.0), 40.0, 25.0, 0.8, 1.2])
        for row, camera in zip(table, cameras, strict=True):
            found = outline_of(single(*frame.ravel()), single(*shape), view_of(row))
            places = limb_outlines(shape[None], frame[None, None], camera)[0, 0]
            pixels, depth = project(camera, places)
            ends = np.stack([place, place + shape[0] * turn[:, 2]]) @ camera.rotation.T + camera.translation
            assert found[9] == pytest.approx(ends[:, 2].mean(), abs=1e-2)
            if depth.min() < 10.0:
                assert found[8] == -1.0
                continue
            if found[8] >= 0.0:
                np.testing.assert_allclose(found[:8], pixels.ravel(), atol=0.02)
                inside = (pixels > -0.49).all() and (
                    pixels < [camera.width - 0.51, camera.height - 0.51]
                ).all()
                assert found[8] == float(inside)
            states.add(float(found[8]))
    assert {0.0, 1.0} <= states


def test_blocks_hold_the_outlines_of_all_limbs_in_all_views() -> None:
    program, poses = every_kind(), np.random.default_rng(0).uniform(-2.0, 2.0, (18, 6))
    program = program._replace(
        limb_frame=np.array([2, 0]),
        limb_shape=np.array([[300, 60, 40, 1, 0.7], [-250, 50, 20, 0.8, 1]], np.float32),
    )
    table = table_of(
        looking_at("c", np.array([2500.0, 300.0, 800.0]), np.zeros(3)),
        looking_at("d", np.array([300.0, -2500.0, 800.0]), np.zeros(3)),
    )
    out = np.zeros((2, 2, 2, ROWS * LANES), np.float32)
    outline_blocks(0, 2, poses, program, table, out)
    numbers = out.reshape(2, 2, 2, ROWS, LANES)
    for block in (0, 1):
        frames = frames_of(program, poses, block)
        for view, limb, lane in np.ndindex(2, 2, LANES):
            frame = frames[lane, program.limb_frame[limb]].ravel()
            wanted = outline_of(single(*frame), single(*program.limb_shape[limb]), view_of(table[view]))
            np.testing.assert_allclose(numbers[block, view, limb, :, lane], wanted, rtol=1e-4, atol=1e-3)
    first = np.zeros_like(out)
    outline_blocks(1, 2, poses, program, table, first)
    assert not first[0].any()
    np.testing.assert_array_equal(first[1], out[1])


def test_corners_and_slopes_are_read_from_blocks() -> None:
    rng = np.random.default_rng(4)
    corners = rng.uniform(0.0, 50.0, (32, 2, 3, 4, 2)).astype(np.float32).astype(float)
    seen = rng.choice([-1.0, 0.0, 1.0], (32, 2, 3))
    blocks = outlines_of(corners, seen, np.zeros_like(seen))
    found, states = np.zeros((20, 2, 3, 4, 2)), np.zeros((20, 2, 3), np.int8)
    read_corners(blocks, found, states)
    wanted = np.where(seen[..., None, None] < 0.0, np.nan, corners)
    np.testing.assert_array_equal(found, wanted[:20])
    np.testing.assert_array_equal(states, seen[:20])
    middle, slopes = np.zeros((2, 3, 4, 2)), np.zeros((2, 3, 4, 2, 15))
    read_slopes(blocks, 0.5, middle, slopes)
    np.testing.assert_array_equal(middle, wanted[0])
    np.testing.assert_allclose(slopes, np.moveaxis((wanted[1:16] - wanted[16:31]) / 0.5, 0, -1))
