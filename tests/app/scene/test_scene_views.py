"""What the handles hold after drawing: the kinematics' own numbers, in metres."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from swaying_session import LAYERS, PARTICLES, cloud_record, swaying_pose

from studio.app.scene import particle_view
from studio.app.scene.body_view import BodyView
from studio.app.scene.camera_views import BACKDROP_DEPTH, DEPTH, CameraViews
from studio.app.scene.floor_view import floor_extent
from studio.app.scene.guarded_server import GuardedServer
from studio.app.scene.line_views import TrailView, TruthView, trail_segments
from studio.app.scene.particle_view import MOST_DRAWN, CloudStyle, ParticleView, cloud_points, weight_shares
from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions
from studio.body.forward_kinematics import limb_ends, limb_frames, marker_points
from studio.body.model import BodyModel, extremities
from studio.foundations.geometry.camera import Camera
from studio.runs.drawing.colour_tokens import colour_tokens
from studio.runs.drawing.marker_lines import extremity_markers

DARK, LIGHT = colour_tokens(True), colour_tokens(False)


def style(limbs: tuple[int, ...], colour_by: str = "layer", layer: int | None = None) -> CloudStyle:
    return CloudStyle(limbs, colour_by, layer, LAYERS, 0.01)


def test_limbs_stand_where_the_kinematics_puts_them(server: GuardedServer, human: BodyModel) -> None:
    view = BodyView(server, human, name="/body")
    pose = swaying_pose(human, 3)
    view.show(pose, DARK, 0.6)
    frames = limb_frames(human, pose)[0]
    for handle, frame, limb in zip(view.handles, frames, human.drawn, strict=True):
        np.testing.assert_allclose(handle.position, frame[:, 3] / 1000.0, atol=1e-12)
        turn = Rotation.from_quat(handle.wxyz, scalar_first=True).as_matrix()
        np.testing.assert_allclose(turn, frame[:, :3], atol=1e-12)
        assert handle.visible
        assert handle.opacity == pytest.approx(0.6)
        assert handle.color == DARK[f"limb-{limb.side}"]
    view.show(pose, LIGHT)
    assert view.handles[0].color == LIGHT[f"limb-{human.drawn[0].side}"]
    view.show(None, LIGHT)
    assert not any(handle.visible for handle in view.handles)


def test_moving_the_body_sends_no_mesh_again(server: GuardedServer, human: BodyModel) -> None:
    view = BodyView(server, human, name="/moving")
    view.show(swaying_pose(human, 0), DARK)
    buffer = server._websock_server._broadcast_buffer
    before = buffer.message_counter
    view.show(swaying_pose(human, 1), DARK)
    sent = [buffer.message_from_id[number] for number in range(before, buffer.message_counter)]
    assert {type(message).__name__ for message in sent} == {"SetOrientationMessage", "SetPositionMessage"}


@pytest.mark.parametrize("name", ["human31", "planar_arm4", "dog"])
def test_clouds_equal_the_kinematics_of_the_stored_particles(server: GuardedServer, name: str) -> None:
    body = load_body(name)
    rng = np.random.default_rng(1)
    record = cloud_record(load_body("human31"), 0, 0)
    poses = body.neutral + rng.normal(0.0, 0.2, (PARTICLES, len(body.parameters)))
    record = type(record)(**{key: getattr(record, key) for key in record.__slots__} | {"poses": poses})
    view = ParticleView(server, body)
    limbs = extremities(body)
    view.show([record], style(limbs), DARK)
    ends = np.stack([limb_ends(body, pose)[0, list(limbs), 1] for pose in poses]).reshape(-1, 3) / 1000.0
    assert view.handles[0].points.dtype == np.float32
    np.testing.assert_allclose(view.handles[0].points, ends, rtol=1e-6, atol=1e-6)


def test_layers_are_shown_together_or_one_at_a_time(server: GuardedServer, human: BodyModel) -> None:
    view = ParticleView(server, human)
    records = [cloud_record(human, 2, layer) for layer in range(LAYERS)]
    view.show(records, style((0, 1)), DARK)
    assert [handle.visible for handle in view.handles] == [True] * LAYERS
    colours = [tuple(int(channel) for channel in handle.colors) for handle in view.handles]
    assert colours == [DARK.layer(layer, LAYERS) for layer in range(LAYERS)]
    assert colours[0] == DARK["layer-0"]
    assert colours[-1] == DARK["layer-9"]
    view.show(records, style((0, 1), layer=2), DARK)
    assert [handle.visible for handle in view.handles] == [False, False, True, False]
    view.show(records[:2], style((0, 1)), DARK)
    assert [handle.visible for handle in view.handles] == [True, True, False, False]
    view.show(records, style(()), DARK)
    assert not any(handle.visible for handle in view.handles)


def test_only_what_is_new_of_a_cloud_is_drawn_again(
    server: GuardedServer, human: BodyModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[float] = []

    def counted(body: BodyModel, poses: np.ndarray, limbs: tuple[int, ...]) -> np.ndarray:
        drawn.append(float(poses.sum()))
        return cloud_points(body, poses, limbs)

    monkeypatch.setattr(particle_view, "cloud_points", counted)
    view = ParticleView(server, human)
    records = [cloud_record(human, 2, layer) for layer in range(LAYERS)]
    for count in range(1, LAYERS + 1):
        view.show(records[:count], style((0, 1)), DARK)
    assert drawn == [float(record.poses.sum()) for record in records]
    for look, tokens in ((style((0,)), DARK), (style((0,)), LIGHT)):
        drawn.clear()
        view.show(records, look, tokens)
        assert len(drawn) == LAYERS
    # Another answer of the same layer, as after a knob was moved.
    drawn.clear()
    view.show([*records[:3], cloud_record(human, 3, 3)], style((0,)), LIGHT)
    assert len(drawn) == 1
    np.testing.assert_allclose(
        view.handles[3].points, cloud_points(human, cloud_record(human, 3, 3).poses, (0,)), atol=1e-6
    )


def test_weights_colour_from_the_lowest_to_the_highest(server: GuardedServer, human: BodyModel) -> None:
    view = ParticleView(server, human)
    record = cloud_record(human, 2, 1)
    view.show([record], style((3, 5), "weight"), DARK)
    colours = view.handles[1].colors.reshape(PARTICLES, 2, 3)
    np.testing.assert_array_equal(colours[:, 0], colours[:, 1])
    assert tuple(colours[record.log_weights.argmin(), 0]) == DARK["layer-0"]
    assert tuple(colours[record.log_weights.argmax(), 0]) == DARK["layer-9"]
    np.testing.assert_array_equal(weight_shares(np.array([2.0, 2.0]), 2.0, 2.0), [1.0, 1.0])


def test_the_extremities_are_hands_feet_and_head(human: BodyModel) -> None:
    names = {human.drawn[index].name for index in extremities(human)}
    assert names == {"left shin", "right shin", "left forearm", "right forearm", "head"}
    assert [load_body("planar_arm4").drawn[i].name for i in extremities(load_body("planar_arm4"))] == [
        "link 4"
    ]


def test_the_truth_is_drawn_in_white_and_leaves_out_what_is_missing(
    server: GuardedServer, human: BodyModel
) -> None:
    names = tuple(marker.name for marker in human.markers)
    view = TruthView(server, human, names)
    points = marker_points(human, swaying_pose(human, 1))[0]
    view.show(points, DARK)
    assert view.handle.visible
    assert view.handle.points.shape == (14, 2, 3)
    np.testing.assert_allclose(view.handle.points[0], points[list(view.links[0])] / 1000.0, atol=1e-6)
    assert tuple(view.handle.colors) == (255, 255, 255)
    points[names.index("RKnee")] = np.nan
    view.show(points, DARK)
    assert view.handle.points.shape == (12, 2, 3)
    view.show(None, DARK)
    assert not view.handle.visible


def test_trails_join_neighbouring_frames_only() -> None:
    frames = np.array([0, 1, 2, 5, 6])
    path = np.arange(15.0).reshape(5, 3)
    segments, tints = trail_segments(frames, {"a": path}, {"a": (1, 2, 3)}, (1, 6))
    np.testing.assert_allclose(segments, np.array([path[[1, 2]], path[[3, 4]]]) / 1000.0, rtol=1e-6)
    assert (tints == (1, 2, 3)).all()


def test_trails_grow_and_follow_the_shown_frame(server: GuardedServer, human: BodyModel) -> None:
    view = TrailView(server, human)
    poses = np.stack([swaying_pose(human, frame) for frame in range(9)])
    view.set_poses(np.arange(5), poses[:5])
    view.set_poses(np.arange(9), poses)
    view.show(4, ("LWrist",), 2, DARK)
    names = [marker.name for marker in human.markers]
    expected = marker_points(human, poses[2:7])[:, names.index("LWrist")] / 1000.0
    np.testing.assert_allclose(view.handle.points[:, 0], expected[:-1], atol=1e-6)
    np.testing.assert_allclose(view.handle.points[:, 1], expected[1:], atol=1e-6)
    assert set(extremity_markers(human)) == {"LAnkle", "RAnkle", "LWrist", "RWrist", "Head"}
    view.show(4, extremity_markers(human), 0, DARK)
    assert view.handle.points.shape == (5 * 8, 2, 3)
    view.show(4, (), 0, DARK)
    assert not view.handle.visible


def test_looking_through_a_camera_puts_its_picture_behind_and_the_others_away(
    server: GuardedServer, cameras: tuple[Camera, ...]
) -> None:
    views = CameraViews(server, cameras)
    views.hang({camera.name: np.full((240, 320, 3), 80, dtype=np.uint8) for camera in cameras})
    views.show(DARK, True, True)
    assert all(view.picture.visible for view in views.views.values())
    views.show(DARK, True, True, "cam2")
    chosen = views.views["cam2"]
    assert chosen.picture.visible
    assert chosen.picture.scale == pytest.approx(BACKDROP_DEPTH / DEPTH)
    np.testing.assert_allclose(chosen.picture.position, chosen.plane.middle * BACKDROP_DEPTH)
    assert not chosen.bars.visible
    assert not views.views["cam1"].picture.visible
    views.show(DARK, True, True)
    assert all(view.picture.visible and view.bars.visible for view in views.views.values())
    assert chosen.picture.scale == pytest.approx(1.0)
    views.show(DARK, True, False)
    assert not any(view.picture.visible for view in views.views.values())


def test_a_picture_on_its_side_hangs_upright(server: GuardedServer, cameras: tuple[Camera, ...]) -> None:
    views = CameraViews(server, cameras)
    picture = np.zeros((240, 320, 3), dtype=np.uint8)
    picture[:, 300:] = (255, 0, 0)
    views.hang({"cam4": picture})
    hung = views.views["cam4"].picture.image
    assert hung.shape == (320, 240, 3)
    assert hung[310, 120].tolist() == [0, 0, 255], (
        "blue in BGR is blue in RGB; the right end hangs at the bottom"
    )


def test_the_floor_lies_under_all_cameras(cameras: tuple[Camera, ...]) -> None:
    (x, y), half = floor_extent([camera.centre for camera in cameras])
    for camera in cameras:
        assert abs(camera.centre[0] / 1000.0 - x) <= half
        assert abs(camera.centre[1] / 1000.0 - y) <= half
    assert (2 * x) % 1 == pytest.approx(0.0)
    assert floor_extent([np.zeros(3)]) == ((0.0, 0.0), 2.0)


def test_of_an_enormous_set_evenly_spaced_particles_are_drawn(
    server: GuardedServer, human: BodyModel
) -> None:
    record = cloud_record(human, 0, 0)
    many = MOST_DRAWN * 2 + 10
    fields = {key: getattr(record, key) for key in record.__slots__}
    fields |= {
        "poses": np.resize(record.poses, (many, 31)),
        "log_weights": np.resize(record.log_weights, many),
    }
    view = ParticleView(server, human)
    view.show([type(record)(**fields)], style((0,), "weight"), DARK)
    assert view.handles[0].points.shape == (-(-many // 3), 3)


def test_hands_and_feet_without_markers_leave_their_trails_to_wrists_and_ankles(human: BodyModel) -> None:
    ends = [f"{side}_{part}_length" for side in ("left", "right") for part in ("hand", "foot")]
    whole = with_dimensions(human, human.dimensions | dict.fromkeys(ends, 150.0))
    assert len(whole.drawn) == 14
    assert set(extremity_markers(whole)) == {"LAnkle", "RAnkle", "LWrist", "RWrist", "Head"}
