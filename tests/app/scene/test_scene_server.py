"""The scene as a whole, on a session from disk, with a tracking process that a test plays."""

import asyncio
import dataclasses
import shutil
import socket
import sqlite3
from contextlib import closing, nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import viser
from scene_fakes import FakeControl, by_hand
from swaying_session import FRAMES, LAYERS, cloud_record, frame_result, swaying_pose
from waiting import until
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from studio.app.scene.controller import ANNEALED_PICTURES_WAIT, PICTURES_WAIT, Due
from studio.app.scene.model import Model, Selection
from studio.app.scene.panel import Panel
from studio.app.scene.scene_server import SceneServer
from studio.app.scene.scene_views import SceneViews
from studio.app.scene.viewpoint import is_well_framed, on_screen
from studio.body.catalogue import load_body
from studio.body.editing import edited
from studio.body.forward_kinematics import limb_ends, limb_frames, marker_points
from studio.body.model import BodyModel, extremities
from studio.foundations.errors import SettingsError, StudioError
from studio.operations.jobs import commands
from studio.operations.jobs.events import FrameFinished, LayerFinished, RunState, SettingsApplied
from studio.runs.setup.start_pose_file import keep_start_pose
from studio.sessions.results_codec import VERIFIED
from studio.sessions.results_reader import FILE_NAME
from studio.sessions.results_store import ResultsWriter
from studio.sessions.workspace import Workspace


def views(stage: SceneServer) -> SceneViews:
    found = stage._controller.views
    assert found is not None
    return found


def panel(stage: SceneServer) -> Panel:
    return stage._controller.panel


def open_run(stage: SceneServer) -> None:
    stage.show_run("swaying", "run-1")
    until(lambda: stage.shown.run == "run-1" and views(stage).body.handles[0].visible)


def body_stands_at(stage: SceneServer, body: BodyModel, pose: np.ndarray) -> bool:
    if stage._controller.views is None:
        return False  # being opened
    places = limb_frames(body, pose)[0, :, :, 3] / 1000.0
    return np.allclose([handle.position for handle in views(stage).body.handles], places, atol=1e-9)


def test_the_stored_run_is_drawn_clouds_and_all(
    stage: SceneServer, human: BodyModel, workspace: Workspace
) -> None:
    open_run(stage)
    assert stage.shown.frame == FRAMES - 2, "the newest stored frame"
    stage.show_frame(1)
    until(lambda: body_stands_at(stage, human, swaying_pose(human, 1)))
    with workspace.session("swaying").run("run-1").results() as results:
        records = results.layers(1)
    until(lambda: len(views(stage).particles.handles) == LAYERS)
    for record, handle in zip(records, views(stage).particles.handles, strict=True):
        ends = limb_ends(human, record.poses)[:, list(extremities(human)), 1].reshape(-1, 3) / 1000.0
        until(lambda handle=handle, ends=ends: np.allclose(handle.points, ends, atol=1e-6))
        assert handle.visible
    assert views(stage).truth.handle.visible
    assert not views(stage).beside.handles[0].visible


def test_the_pictures_are_hung_with_outlines(stage: SceneServer) -> None:
    open_run(stage)
    hung = views(stage).cameras.views
    until(lambda: all(view.picture.visible for view in hung.values()))
    plain = hung["cam1"].picture.image
    colourful = np.abs(plain.astype(int) - plain.mean(axis=2, keepdims=True)).max(axis=2) > 60
    assert colourful.sum() > 100, "the limbs' outlines are the only saturated colours"
    stage.set_options(overlays=())
    until(lambda: np.abs(np.diff(hung["cam1"].picture.image.astype(int), axis=2)).max() < 60)


def test_through_a_camera_the_body_is_the_outline_in_the_picture(stage: SceneServer) -> None:
    open_run(stage)
    hung = views(stage).cameras.views
    until(lambda: all(view.picture.visible for view in hung.values()))
    stage.set_options(overlays=())
    until(lambda: np.abs(np.diff(hung["cam1"].picture.image.astype(int), axis=2)).max() < 60)
    assert views(stage).body.handles[0].visible
    stage.look_through("cam1")
    until(lambda: not any(limb.visible for limb in views(stage).body.handles))
    until(lambda: np.abs(np.diff(hung["cam1"].picture.image.astype(int), axis=2)).max() > 60)
    assert np.abs(np.diff(hung["cam2"].picture.image.astype(int), axis=2)).max() < 60, (
        "the others stay as chosen"
    )
    stage.look_through(None)
    until(lambda: views(stage).body.handles[0].visible)


def test_layers_in_the_making_are_drawn_at_once(
    stage: SceneServer, control: FakeControl, human: BodyModel
) -> None:
    open_run(stage)
    control.emit(dataclasses.replace(control.state, state=RunState.TRACKING))
    new = FRAMES - 1
    for layer in range(2):
        control.emit(LayerFinished("swaying", "run-1", cloud_record(human, new, layer)))
    until(lambda: stage.shown.frame == new)
    until(
        lambda: (
            [handle.visible for handle in views(stage).particles.handles][:LAYERS]
            == [True, True, False, False]
        )
    )
    until(lambda: body_stands_at(stage, human, swaying_pose(human, new)))


def test_a_reannealed_frame_stands_beside_the_stored_answer(
    stage: SceneServer, control: FakeControl, human: BodyModel
) -> None:
    open_run(stage)
    stage.show_frame(2)
    until(lambda: stage.shown.frame == 2)
    control.emit(LayerFinished("swaying", "run-1", cloud_record(human, 2, 0), True))
    control.emit(FrameFinished("swaying", "run-1", frame_result(human, 2, shift=120.0), True))
    moved = swaying_pose(human, 2)
    moved[4] += 120.0
    until(lambda: body_stands_at(stage, human, moved))
    stored = limb_frames(human, swaying_pose(human, 2))[0, :, :, 3] / 1000.0
    ghosts = views(stage).beside.handles
    until(lambda: all(ghost.visible for ghost in ghosts))
    np.testing.assert_allclose([ghost.position for ghost in ghosts], stored, atol=1e-9)
    stage.show_frame(3)
    until(lambda: body_stands_at(stage, human, swaying_pose(human, 3)))
    until(lambda: not ghosts[0].visible)


def test_a_setting_selects_the_shown_frame_and_is_requested(stage: SceneServer, control: FakeControl) -> None:
    open_run(stage)
    stage.show_frame(2)
    until(lambda: stage.shown.frame == 2)
    survival = panel(stage).settings.inputs["survival"]
    default = survival.knob.default
    by_hand(survival.handle, 0.7)
    until(lambda: control.commands)
    (change,) = control.commands
    assert isinstance(change, commands.ChangeSettings)
    assert (Path(change.run).name, change.frame) == ("run-1", 2)
    assert change.changes == {"survival": 0.7}
    control.answer(change, "Setting 'survival' cannot be 0.7.", "Try 0.6.")
    until(lambda: survival.handle.value == default)
    control.emit(SettingsApplied("swaying", "run-1", 2, 2, 0, {"survival": 0.6}, ("survival",)))
    until(lambda: survival.handle.value == 0.6)
    assert len(control.commands) == 1, "showing what is in use asks for nothing"


def test_knobs_are_about_the_run_that_is_shown(stage: SceneServer, control: FakeControl) -> None:
    refusals: list[StudioError] = []
    stage._controller.refused = refusals.append
    stage._controller.post(stage._controller.request_knobs, {"survival": 0.7})
    control.state = dataclasses.replace(control.state, session="other", run="run-9")
    open_run(stage)
    assert control.commands == [], "no run was shown"
    survival = panel(stage).settings.inputs["survival"]
    by_hand(survival.handle, 0.7)
    until(lambda: control.commands)
    by_hand(survival.handle, 0.6)
    until(lambda: len(control.commands) == 2)
    assert [Path(command.run).name for command in control.commands] == ["run-1", "run-1"]
    control.answer(control.commands[1], "Run 'run-9' of session 'other' is being tracked.")
    until(lambda: refusals)
    assert "run-9" in refusals[0].message
    until(lambda: survival.handle.value == 0.7)
    by_hand(survival.handle, 99.0)
    until(lambda: len(refusals) == 2)
    assert "99" in refusals[1].message
    until(lambda: survival.handle.value == 0.7)


def test_playback_shows_one_frame_after_another_and_notifies_the_page(
    workspace: Workspace, control: FakeControl
) -> None:
    selections: list[Selection] = []
    stage = SceneServer(workspace, control, lambda shown, _: selections.append(shown))
    open_run(stage)
    stage.show_frame(0)
    until(lambda: stage.shown.frame == 0)
    assert selections == [], "the caller is not notified"
    stage.play(True, speed=4.0)
    until(lambda: {shown.frame for shown in selections} >= set(range(1, FRAMES - 1)) and len(selections) > 6)
    stage.stop()


def test_layers_play_and_each_move_is_told_until_one_is_chosen_by_hand(
    workspace: Workspace, control: FakeControl
) -> None:
    told: list[tuple[int | None, tuple[bool, float, str]]] = []
    stage = SceneServer(workspace, control, lambda shown, layers: told.append((shown.layer, layers.state)))
    open_run(stage)
    stage.play_layers(True, rate=10.0)
    until(lambda: [layer for layer, _ in told].count(LAYERS - 1) >= 2)
    assert {state for _, state in told} == {(True, 10.0, "loop")}
    told_of = [layer for layer, _ in told if layer is not None]
    assert told_of[: LAYERS + 1] == [*range(LAYERS), 0]
    # What the page says beside the layer leaves them playing; another frame's are played on.
    stage.show_run("swaying", "run-1", 1, is_scrubbed=False)
    until(lambda: stage.shown.frame == 1)
    assert stage.layers.playing
    stage.show_run("swaying", "run-1", 1, 2)
    until(lambda: told[-1] == (2, (False, 10.0, "loop")))
    assert stage.shown.layer == 2
    stage.stop()


@dataclasses.dataclass
class FakeCamera:
    """A viewer's camera, as far as the scene moves and reads it."""

    position: np.ndarray
    look_at: np.ndarray
    up_direction: np.ndarray = dataclasses.field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    fov: float = 0.85
    aspect: float = 2.0
    image_height: int = 400
    update_timestamp: float = 1.0

    @property
    def eye(self) -> tuple[float, ...]:
        return (*map(float, self.position), *map(float, self.look_at))


@pytest.fixture
def viewer(stage: SceneServer, monkeypatch: pytest.MonkeyPatch) -> FakeCamera:
    """A viewer's camera, at the scene's first view once a run is open."""
    camera = FakeCamera(np.zeros(3), np.ones(3))
    client = SimpleNamespace(client_id=1, camera=camera, atomic=nullcontext)
    monkeypatch.setattr(stage._server, "get_clients", lambda: {1: client})
    open_run(stage)
    stage.move_camera("first")
    until(lambda: np.allclose(camera.eye, stage._controller.viewers.first_eye, atol=1e-6))
    return camera


def body_points(stage: SceneServer) -> np.ndarray:
    found = stage._controller._shown_body()
    return found.reshape(-1, 3)


def test_as_layers_begin_to_be_looked_at_the_body_is_of_glass_and_framed(
    stage: SceneServer, viewer: FakeCamera
) -> None:
    limbs = views(stage).body.handles
    assert limbs[0].opacity > 0.5
    assert not is_well_framed(body_points(stage), viewer.eye, viewer.fov, viewer.aspect)
    stage.show_layer(1)
    until(lambda: is_well_framed(body_points(stage), viewer.eye, viewer.fov, viewer.aspect))
    until(lambda: limbs[0].opacity < 0.2)
    assert stage.shown.eye is None, "it is the usual place now, and not one of the address"
    # Whoever chose a place is left there as long as the body is seen from it.
    stage.show_layer(None)
    stage.look_from((*(viewer.look_at + 0.5), *viewer.look_at))
    until(lambda: stage.shown.eye is not None and limbs[0].opacity > 0.5)
    near = viewer.eye
    stage.play_layers(True)
    until(lambda: stage.shown.layer == 1)
    assert viewer.eye == near
    stage.move_camera("first")
    until(lambda: np.allclose(viewer.eye, stage._controller.viewers.first_eye, atol=1e-6))


def test_the_body_of_another_session_is_framed_where_layers_are_looked_at_already(
    stage: SceneServer, viewer: FakeCamera, workspace: Workspace
) -> None:
    shutil.copytree(workspace.root / "swaying", workspace.root / "other")
    stage.show_layer(1)
    until(lambda: is_well_framed(body_points(stage), viewer.eye, viewer.fov, viewer.aspect))
    until(lambda: not stage._controller.viewers.is_moving)
    stage.show_run("other", "run-1", None, 1)
    until(lambda: stage.shown.session == "other" and (views(stage).body.handles[0].opacity or 1.0) < 0.2)
    until(lambda: is_well_framed(body_points(stage), viewer.eye, viewer.fov, viewer.aspect))
    assert stage.shown.eye is None


def test_a_body_is_framed_once_a_viewer_has_come_and_again_in_another_shape(
    stage: SceneServer, viewer: FakeCamera
) -> None:
    """Before, a browser tells its own place and lens, by which head and feet would be cut off."""

    def say() -> None:
        stage._controller.viewers.looking = viewer  # pyright: ignore[reportAttributeAccessIssue]
        stage._controller.post(lambda model: model)
        until(lambda: stage._controller.viewers.looking is None)

    say()
    until(lambda: not stage._controller.viewers.is_moving)
    first = viewer.eye
    viewer.position, viewer.look_at, viewer.fov = np.full(3, 3.0), np.zeros(3), 1.309
    stage.show_layer(1)
    until(lambda: views(stage).body.handles[0].opacity < 0.2)
    say()
    assert viewer.eye == (3.0, 3.0, 3.0, 0.0, 0.0, 0.0)
    assert stage.shown.eye is None, "it is no place of the address"
    viewer.position, viewer.look_at, viewer.fov = np.array(first[:3]), np.array(first[3:]), 0.85
    say()
    until(lambda: is_well_framed(body_points(stage), viewer.eye, viewer.fov, viewer.aspect))
    until(lambda: not stage._controller.viewers.is_moving)
    viewer.aspect = 0.15
    assert not is_in_view(body_points(stage), viewer)
    say()
    until(lambda: is_in_view(body_points(stage), viewer))
    assert stage.shown.eye is None


def is_in_view(points: np.ndarray, viewer: FakeCamera) -> bool:
    seen = on_screen(points, viewer.eye, viewer.fov, viewer.aspect)[:, :2]
    return bool((seen > 0.0).all() and (seen < 1.0).all())


def test_a_view_that_follows_the_body_goes_along_and_a_zoom_is_noted(
    stage: SceneServer, viewer: FakeCamera
) -> None:
    stage.show_frame(0)
    until(lambda: stage.shown.frame == 0)
    stage.set_options(follows_body=True)
    until(lambda: stage._controller._centre is not None)
    before, centre = np.array(viewer.eye), body_points(stage).mean(axis=0)
    stage.show_frame(4)
    until(lambda: not np.allclose(before, viewer.eye))
    shift = body_points(stage).mean(axis=0) - centre
    np.testing.assert_allclose(np.array(viewer.eye) - before, np.tile(shift, 2), atol=1e-6)
    away = np.linalg.norm(viewer.position - viewer.look_at)
    stage.zoom(0.5, (0.5, 0.5))
    until(lambda: np.linalg.norm(viewer.position - viewer.look_at) == pytest.approx(0.5 * away, rel=1e-3))
    assert stage.shown.eye is not None


def test_a_drag_while_looking_through_a_camera_leaves_it_cleanly(
    stage: SceneServer, viewer: FakeCamera
) -> None:
    told: list[str | None] = []
    stage._controller._moved = lambda shown, _: told.append(shown.look_through)
    stage.look_through("cam2")
    plane = views(stage).cameras.views["cam2"].plane
    until(lambda: np.allclose(viewer.position, plane.position))
    until(lambda: not views(stage).body.handles[0].visible)

    def report() -> None:
        stage._controller.viewers.looking = viewer  # pyright: ignore[reportAttributeAccessIssue]
        stage._controller.post(lambda model: model)
        until(lambda: stage._controller.viewers.looking is None)

    report()
    assert stage.shown.look_through == "cam2", "who stands there has not been dragged"
    viewer.position = viewer.position + 0.3
    report()
    until(lambda: stage.shown.look_through is None)
    until(lambda: views(stage).body.handles[0].visible)
    until(lambda: views(stage).cameras.views["cam2"].picture.scale == 1.0)
    until(lambda: viewer.fov == pytest.approx(0.85))
    np.testing.assert_allclose(viewer.up_direction, [0.0, 0.0, 1.0])
    assert told[-1] is None, "the page hears of it, so that the address is right"


def _alike(found: np.ndarray, wanted: np.ndarray) -> bool:
    return found.shape == wanted.shape and np.allclose(found, wanted, atol=1e-6)


def test_trails_follow_the_shown_frame(stage: SceneServer, human: BodyModel) -> None:
    open_run(stage)
    stage.set_options(trail_markers=("LWrist",), trail_frames=1)
    wrist = [marker.name for marker in human.markers].index("LWrist")
    poses = np.stack([swaying_pose(human, frame) for frame in range(FRAMES - 1)])
    path = (marker_points(human, poses)[:, wrist] / 1000.0).astype(np.float32)
    trail = views(stage).trails.handle
    for frame, frames in ((0, [0, 1]), (3, [2, 3, 4]), (0, [0, 1])):
        stage.show_frame(frame)
        wanted = np.stack([path[frames[:-1]], path[frames[1:]]], axis=1)
        until(lambda wanted=wanted: _alike(trail.points, wanted))
    stage.set_options(trail_frames=0)
    until(lambda: trail.points.shape == (FRAMES - 2, 2, 3))


def test_looking_through_a_camera_by_its_name(stage: SceneServer) -> None:
    open_run(stage)
    stage.look_through("cam2")
    until(lambda: stage.shown.look_through == "cam2")
    stage.look_through("no such camera")
    stage.look_through("")
    until(lambda: stage.shown.look_through is None)


def test_the_theme_changes_every_colour(stage: SceneServer) -> None:
    open_run(stage)
    before = views(stage).body.handles[0].color
    stage.set_options(dark=False)
    stage.set_options(colour_by="weight")
    until(lambda: views(stage).body.handles[0].color != before)
    until(lambda: stage._controller.model.options.colour_by == "weight")
    assert not stage._controller.model.options.dark, "one change does not take back another"
    with pytest.raises(SettingsError, match="no option 'colour'"):
        stage.set_options(colour="red")


def test_without_shadows_the_sky_lights_the_body_and_no_lamp_casts_any(stage: SceneServer) -> None:
    open_run(stage)

    def lit() -> tuple[bool, ...]:
        shown = stage._controller.views
        if shown is None:
            return ()
        sent = {
            type(one).__name__: one
            for one in stage._server._websock_server._broadcast_buffer.message_from_id.values()
        }
        lamps, around = sent.get("EnableLightsMessage"), sent.get("EnvironmentMapMessage")
        return (
            lamps is None or lamps.cast_shadow,
            around is None or around.hdri_data is not None,
            shown.floor.plane.shadow_opacity > 0.0,
            not shown.floor.sky.visible,
        )

    until(lambda: lit() == (True, True, True, True))
    stage.set_options(shadows=False)
    until(lambda: lit() == (False, False, False, False))
    stage.show_run("swaying")
    until(lambda: stage.shown.run == "" and lit() == (False, False, False, False))
    stage.set_options(shadows=True)
    until(lambda: lit() == (True, True, True, True))


def test_a_session_without_a_run_and_none_at_all(stage: SceneServer, human: BodyModel) -> None:
    stage.show_run("swaying")
    until(lambda: stage.shown.session == "swaying" and stage.shown.run == "")
    until(lambda: body_stands_at(stage, human, human.neutral))
    stage.show_run("")
    until(lambda: stage.shown.session == "" and stage._controller.views is None)


def test_what_cannot_be_opened_leaves_the_scene_alive(stage: SceneServer) -> None:
    open_run(stage)
    stage.show_run("no-such-session", "run-1")
    until(lambda: stage.shown.session == "" and stage._controller.views is None)
    open_run(stage)


def test_strangers_are_refused_and_nothing_is_ever_shared(stage: SceneServer) -> None:
    open_run(stage)

    async def knock(headers: dict[str, str]) -> tuple[int | None, int]:
        heard = 0
        address = f"ws://127.0.0.1:{stage.port}"
        async with connect(
            address,
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            additional_headers=headers,
            proxy=None,
        ) as socket:
            try:
                await asyncio.wait_for(socket.recv(), 5.0)
                heard = 1
            except ConnectionClosed:
                pass
            return socket.close_code, heard

    assert asyncio.run(knock({})) == (1008, 0)
    assert asyncio.run(knock({"X-Studio-Relay": "guess"})) == (1008, 0)
    assert asyncio.run(knock(stage.relay_headers())) == (None, 1)
    server = stage._server
    assert server.get_host() == "127.0.0.1"
    assert server.request_share_url() is None


def test_a_kept_answer_takes_the_place_of_the_stored_one_and_of_what_followed(
    stage: SceneServer, control: FakeControl, human: BodyModel, workspace: Workspace
) -> None:
    open_run(stage)
    stage.show_frame(2)
    until(lambda: body_stands_at(stage, human, swaying_pose(human, 2)))
    kept = frame_result(human, 2, shift=90.0)
    with ResultsWriter(workspace.session("swaying").run("run-1").folder) as writer:
        writer.forget_from(2)
        writer.write_frame(kept, [cloud_record(human, 2, 0)])
    control.emit(FrameFinished("swaying", "run-1", kept))
    until(lambda: stage._controller.model.frames == (0, 1, 2))
    until(lambda: body_stands_at(stage, human, kept.estimate.pose))


@pytest.mark.parametrize(("tracking", "faint"), [("lost", True), ("no evidence", True), ("recovered", False)])
def test_a_frame_that_did_not_simply_go_on_says_so(
    stage: SceneServer, workspace: Workspace, human: BodyModel, tracking: str, faint: bool
) -> None:
    with ResultsWriter(workspace.session("swaying").run("run-1").folder) as writer:
        layers = [cloud_record(human, FRAMES - 1, layer) for layer in range(LAYERS)]
        result = dataclasses.replace(frame_result(human, FRAMES - 1), tracking=tracking)
        writer.write_frame(result, layers)
    # The run that the tracking process has open was opened before there was that frame.
    stage.show_run("")
    until(lambda: stage.shown.session == "")
    open_run(stage)
    mark = panel(stage).mark
    until(lambda: mark.visible and f"<b>{tracking}</b>" in mark.content)
    until(lambda: (views(stage).body.handles[0].opacity < 0.5) == faint)
    stage.show_frame(1)
    until(lambda: not mark.visible and views(stage).body.handles[0].opacity > 0.5)


def test_a_start_pose_that_was_found_is_shown_with_its_confidence_until_it_is_left(
    stage: SceneServer, human: BodyModel
) -> None:
    found = swaying_pose(human, 5)
    stage.show_run("")
    until(lambda: stage.shown.session == "")
    stage.poses.propose("swaying", found.tolist(), "found in frame 2, confidence 92 %", 2)
    until(lambda: stage.shown.session == "swaying" and body_stands_at(stage, human, found))
    assert stage.shown.run == ""
    assert stage.shown.frame == 2
    until(lambda: "confidence 92 %" in panel(stage).mark.content)
    stage.show_run("swaying")
    stage.poses.leave()
    until(lambda: body_stands_at(stage, human, human.neutral))
    until(lambda: not panel(stage).mark.visible)
    # A run that is opened shows itself, not what was found.
    stage.poses.propose("swaying", found.tolist(), "found in frame 2, confidence 92 %", 2)
    until(lambda: stage.shown.editing and body_stands_at(stage, human, found))
    stage.show_run("swaying", "run-1")
    until(lambda: stage.shown.run == "run-1" and body_stands_at(stage, human, swaying_pose(human, 4)))
    until(lambda: not panel(stage).mark.visible)
    assert not stage.shown.editing
    assert stage.poses.editing is None
    stage.poses.propose("swaying", found.tolist(), "found in frame 2, confidence 92 %", 2)
    until(lambda: stage.shown.run == "" and body_stands_at(stage, human, found))
    stage.show_run("swaying", "run-1")
    until(lambda: stage.shown.run == "run-1")
    stage.poses.propose("swaying", [0.0] * 4, "found in frame 1, confidence 50 %", 1)
    until(lambda: stage.shown.run == "" and body_stands_at(stage, human, human.neutral))
    assert not stage.shown.editing, "a pose of another body is not edited"


@pytest.mark.parametrize(
    "shown",
    [b"X-Studio-Relay: \xe9\xff\xed\xa0\x80", b"X-Studio-Relay: a\r\nX-Studio-Relay: b", b"X-Studio-Relay:"],
)
def test_a_strange_relay_header_is_no_way_in(stage: SceneServer, shown: bytes) -> None:
    """Not ASCII, or given twice: what compares it must not fail and leave the stranger inside."""
    protocol = f"viser-v{viser.__version__}".encode()
    with socket.create_connection(("127.0.0.1", stage.port), 10.0) as knocking:
        knocking.sendall(
            b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
            b"Sec-WebSocket-Protocol: " + protocol + b"\r\n" + shown + b"\r\n\r\n"
        )
        got = b""
        while b"relay only" not in got and (piece := knocking.recv(65536)):
            got += piece
    assert b"relay only" in got


def test_posts_keep_their_order_and_what_goes_wrong_ends_nothing(stage: SceneServer) -> None:
    refusals: list[StudioError] = []
    order: list[int] = []
    controller = stage._controller
    controller.refused = refusals.append

    def note(model: Model, number: int) -> Model:
        order.append(number)
        if number % 10 == 3:
            raise StudioError("The file cannot be read.", "Put it back.")
        if number % 10 == 7:
            raise ZeroDivisionError
        return model

    for number in range(100):
        controller.post(note, number)
    until(lambda: len(order) == 100)
    assert order == list(range(100))
    until(lambda: len(refusals) == 10)
    open_run(stage)


def test_a_drawing_waits_until_its_pause_is_over_and_longer_while_a_live_run_is_tracked() -> None:
    drawing = Due(0.5)
    assert not drawing.is_due(10.0)
    drawing.want(10.0)
    assert drawing.is_due(10.0)
    drawing.done(10.0)
    drawing.want(10.1)
    assert not drawing.is_due(10.4)
    assert drawing.waits(10.4) == pytest.approx(0.1)
    assert drawing.is_due(10.5)


def test_a_drawing_takes_no_more_than_its_share_of_the_time() -> None:
    drawing = Due(0.1)
    drawing.share = 0.05
    drawing.done(10.0)
    drawing.took = 0.02
    drawing.want(10.1)
    assert not drawing.is_due(10.3)
    assert drawing.is_due(10.4)


def test_pictures_wait_for_the_end_of_a_burst_of_changes_but_no_longer_than_their_pause() -> None:
    pictures = Due(0.5, calm=0.1)
    for at in (10.0, 10.08, 10.16):
        pictures.want(at)
        assert not pictures.is_due(at)
    assert not pictures.is_due(10.25)
    assert pictures.waits(10.2) == pytest.approx(0.06)
    assert pictures.is_due(10.27)
    pictures.done(10.27)
    for number in range(9):
        pictures.want(11.0 + 0.06 * number)
    assert not pictures.is_due(11.49)
    assert pictures.is_due(11.5), "changes that do not end"


def test_frames_that_were_not_heard_of_are_known_with_the_next(
    stage: SceneServer, control: FakeControl, human: BodyModel, workspace: Workspace
) -> None:
    open_run(stage)
    stage._controller.post(lambda model: dataclasses.replace(model, frames=model.frames[:2]))
    until(lambda: len(stage._controller.model.frames) == 2)
    with ResultsWriter(workspace.session("swaying").run("run-1").folder) as writer:
        layers = [cloud_record(human, FRAMES - 1, layer) for layer in range(LAYERS)]
        writer.write_frame(frame_result(human, FRAMES - 1), layers)
    control.emit(FrameFinished("swaying", "run-1", frame_result(human, FRAMES - 1)))
    until(lambda: stage._controller.model.frames == tuple(range(FRAMES)))


def test_frames_that_are_found_damaged_after_a_run_was_opened_leave_the_scene(
    stage: SceneServer, workspace: Workspace
) -> None:
    folder = workspace.session("swaying").run("run-1").folder
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        connection.execute("UPDATE layers SET blob = X'00' WHERE frame = 1 AND layer = 0")
        connection.commit()
    VERIFIED.forget(folder)
    with VERIFIED.reading(folder):
        open_run(stage)
        stage.show_frame(1)
        until(lambda: stage.shown.frame == 1)
    until(lambda: stage._controller.model.frames == (0, *range(2, FRAMES - 1)))
    until(lambda: stage.shown.frame in (0, 2))


def test_a_frame_that_is_annealed_again_has_its_pictures_after_its_clouds(
    stage: SceneServer, control: FakeControl, human: BodyModel
) -> None:
    open_run(stage)
    pictures = stage._controller._drawings[1]
    assert pictures.calm == PICTURES_WAIT
    stage.show_frame(2)
    control.emit(LayerFinished("swaying", "run-1", cloud_record(human, 2, 0), True))
    until(lambda: pictures.calm == ANNEALED_PICTURES_WAIT)
    control.emit(FrameFinished("swaying", "run-1", frame_result(human, 2, shift=120.0), True))
    assert pictures.calm == ANNEALED_PICTURES_WAIT <= pictures.pause
    stage.show_frame(3)
    until(lambda: pictures.calm == PICTURES_WAIT)


def trial_stands_at(stage: SceneServer, body: BodyModel, pose: np.ndarray) -> bool:
    drawn = stage._controller._trial
    if drawn is None:
        return False
    places = limb_frames(body, pose)[0, :, :, 3] / 1000.0
    handles = drawn._view.handles
    return len(handles) == len(places) and np.allclose(
        [handle.position for handle in handles], places, atol=1e-9
    )


def test_a_body_that_is_being_made_stands_alone_and_in_place_of_a_sessions_own(
    stage: SceneServer, human: BodyModel, workspace: Workspace
) -> None:
    mouse = load_body("mouse")
    stage.try_body("", mouse)
    until(lambda: trial_stands_at(stage, mouse, mouse.neutral))
    until(lambda: "Mouse" in panel(stage).status.content)
    until(lambda: not panel(stage).tabs.visible)  # knobs and poses are not of this body

    # With a session it stands in the session's start pose, with the session's pictures behind it.
    thick = edited(human, sizes={"left thigh.radius_start": 200.0}).body
    start = swaying_pose(human, 1)
    keep_start_pose(workspace.session("swaying"), human, start)
    stage.try_body("swaying", thick)
    until(lambda: trial_stands_at(stage, thick, start))
    until(lambda: not any(limb.visible for limb in views(stage).body.handles))
    hung = views(stage).cameras.views["cam1"].picture
    until(lambda: hung.visible)
    before = np.array(hung.image)
    stage.try_body("swaying", human)
    until(lambda: not np.array_equal(hung.image, before))
    stage.look_through("cam1")
    until(lambda: not any(limb.visible for limb in stage._controller._trial._view.handles))  # pyright: ignore[reportOptionalMemberAccess]

    stage.show_run("swaying", "run-1")
    stage.look_through(None)
    until(lambda: stage._controller.views is not None and views(stage).body.handles[0].visible)
    until(lambda: stage._controller._trial is None and panel(stage).tabs.visible)


def test_who_may_only_look_has_no_panel_that_takes_room(stage: SceneServer) -> None:
    stage._controller.bare = True
    open_run(stage)
    parts = panel(stage).status, panel(stage).mark, panel(stage).tabs
    until(lambda: not any(part.visible for part in parts))
