"""Poses of live runs as other programs receive them: python-osc's server, and a WebSocket client."""

import json
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from live_driving import live_run
from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import BlockingOSCUDPServer
from scipy.spatial.transform import Rotation
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import joint_frames
from studio.body.motion_files.recorded_motion import followed
from studio.foundations.errors import RunError
from studio.operations.jobs.live_tracking import track_live
from studio.operations.jobs.pose_sending import PoseSender
from studio.operations.jobs.send_addresses import SendAddress, addresses_from_environment, send_address
from studio.results.export.skeleton import skeleton_of
from studio.sessions.session import Session

PATIENCE = 10.0
BODY = load_body("human31")
RECORD = SimpleNamespace(fps=60.0, session="toy", name="run")


def bent_pose() -> np.ndarray:
    """Every angle bent, the body a few steps away."""
    rng = np.random.default_rng(5)
    return BODY.neutral + np.where(BODY.angles, rng.uniform(-0.8, 0.8, len(BODY.neutral)), 700.0)


class Receiver:
    """A VMC receiver: bones by name of the newest bundle, and how many bundles came."""

    def __init__(self) -> None:
        self.bones: dict[str, list[float]] = {}
        self.times: list[float] = []
        self.came = threading.Semaphore(0)
        dispatcher = Dispatcher()
        dispatcher.map("/VMC/Ext/Bone/Pos", lambda _, name, *values: self.bones.update({name: list(values)}))
        dispatcher.map("/VMC/Ext/T", lambda _, seconds: self.times.append(seconds))
        self._server = BlockingOSCUDPServer(("127.0.0.1", 0), dispatcher)
        self.address = SendAddress("osc", "127.0.0.1", self._server.server_address[1])

    def __enter__(self) -> "Receiver":
        threading.Thread(target=self._take, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended = True
        self._server.server_close()

    _ended = False

    def _take(self) -> None:
        self._server.timeout = 0.2
        while not self._ended:
            before = len(self.times)
            try:
                self._server.handle_request()
            except (OSError, ValueError):
                return
            if len(self.times) > before:
                self.came.release()


def found(frame: int, pose: np.ndarray) -> SimpleNamespace:
    """What is sent of a frame's result."""
    estimate = SimpleNamespace(pose=pose)
    return SimpleNamespace(
        frame=frame, estimate=estimate, tracking="tracked", overlap=0.9, limbs_lost=("head",)
    )


def free_socket() -> SendAddress:
    return SendAddress("ws", "127.0.0.1", 0)


def test_vmc_bones_stand_where_the_body_s_joints_do() -> None:
    body, pose = BODY, bent_pose()
    with Receiver() as receiver:
        sender = PoseSender([receiver.address], RECORD, body)
        sender.send(found(37, pose))
        assert receiver.came.acquire(timeout=PATIENCE)
        sender.close()
    assert receiver.times == [pytest.approx(37 / 60.0)]
    assert {"Hips", "Spine", "Head", "LeftUpperArm", "RightLowerLeg", "LeftFoot"} <= set(receiver.bones)
    skeleton = skeleton_of(body)
    wanted, _ = followed(skeleton.tree.parents, *skeleton.animated(pose[None]))
    # As Unity chains local places and turns; x there is the world's minus y, y its z, z its x.
    names = dict(zip(skeleton.names, receiver.bones, strict=True))
    places: list[np.ndarray] = []
    turns: list[Rotation] = []
    for joint, name in enumerate(skeleton.names):
        values = receiver.bones[names[name]]
        place, turn = np.array(values[:3]), Rotation.from_quat(values[3:])
        parent = skeleton.tree.parents[joint]
        places.append(place if parent < 0 else places[parent] + turns[parent].apply(place))
        turns.append(turn if parent < 0 else turns[parent] * turn)
        x, y, z = 1000.0 * places[joint]
        assert np.linalg.norm([z, -x, y] - wanted[0, joint]) < 0.1


def test_the_rest_pose_turns_no_bone() -> None:
    body = BODY
    with Receiver() as receiver:
        sender = PoseSender([receiver.address], RECORD, body)
        sender.send(found(0, body.neutral))
        assert receiver.came.acquire(timeout=PATIENCE)
        sender.close()
    # The thighs hang straight down in the neutral pose as in the T-pose.
    assert receiver.bones["LeftUpperLeg"][3:] == pytest.approx([0, 0, 0, 1], abs=0.1)
    height = joint_frames(body, body.neutral[None])[0, 0, 2, 3]
    assert receiver.bones["Hips"][1] == pytest.approx(height / 1000.0, abs=1e-5)


def test_who_connects_gets_the_body_and_then_poses() -> None:
    body, pose = BODY, bent_pose()
    sender = PoseSender([free_socket()], RECORD, body)
    port = sender._receivers[0]._server.socket.getsockname()[1]
    try:
        with connect(f"ws://127.0.0.1:{port}") as connection:
            head = json.loads(connection.recv(PATIENCE))
            assert (head["type"], head["body"], head["unit"], head["up"]) == ("body", "human31", "mm", "z")
            sender.send(found(3, pose))
            told = json.loads(connection.recv(PATIENCE))
        assert (told["frame"], told["state"], told["limbs_lost"]) == (3, "tracked", ["head"])
        frames = joint_frames(body, pose[None])[0]
        joints = np.array(told["joints"])
        np.testing.assert_allclose(joints[:, :3], frames[..., 3], atol=0.01)
        np.testing.assert_allclose(Rotation.from_quat(joints[:, 3:]).as_matrix(), frames[..., :3], atol=1e-5)
        np.testing.assert_allclose(told["parameters"], pose, atol=1e-5)
        with (
            pytest.raises(InvalidStatus),
            connect(f"ws://127.0.0.1:{port}", origin="https://elsewhere.example"),
        ):
            pass
    finally:
        sender.close()


def test_every_tracked_frame_of_a_live_run_is_sent(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    with Receiver() as receiver:
        summary = track_live(session_on_disk, run, lambda *_: None, send_to=[receiver.address])
        for _ in summary.tracked:
            assert receiver.came.acquire(timeout=PATIENCE)
    assert receiver.times == pytest.approx([frame / run.record.fps for frame in summary.tracked])


def test_a_receiver_that_is_not_there_stops_nothing(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    away = [SendAddress("osc", "127.0.0.1", 9), free_socket()]
    assert track_live(session_on_disk, run, lambda *_: None, send_to=away).tracked


def test_a_run_whose_poses_cannot_be_sent_is_free_again(session_on_disk: Session) -> None:
    run = live_run(session_on_disk)
    first = PoseSender([free_socket()], RECORD, BODY)
    try:
        taken = SendAddress("ws", "127.0.0.1", first._receivers[0]._server.socket.getsockname()[1])
        with pytest.raises(RunError, match="cannot be offered"):
            track_live(session_on_disk, run, lambda *_: None, send_to=[taken])
    finally:
        first.close()
    assert track_live(session_on_disk, run, lambda *_: None).tracked


def test_a_taken_port_and_a_wrong_address_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    first = PoseSender([free_socket()], RECORD, BODY)
    port = first._receivers[0]._server.socket.getsockname()[1]
    try:
        with pytest.raises(RunError, match=f"127.0.0.1:{port}"):
            PoseSender([SendAddress("ws", "127.0.0.1", port)], RECORD, BODY)
    finally:
        first.close()
    assert send_address("osc") == SendAddress("osc", "127.0.0.1", 39539)
    assert send_address("ws://:9000") == SendAddress("ws", "127.0.0.1", 9000)
    assert send_address("osc://[::1]:39540/") == SendAddress("osc", "::1", 39540)
    for wrong in ("http://here", "osc://a/b", "ws://user@host", "ws://host:port", "osc://host:70000", ""):
        with pytest.raises(RunError):
            send_address(wrong)
    monkeypatch.setenv("STUDIO_SEND_POSES", "osc://:1, ws")
    assert addresses_from_environment() == (
        SendAddress("osc", "127.0.0.1", 1),
        SendAddress("ws", "127.0.0.1", 8766),
    )
