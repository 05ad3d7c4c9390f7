"""Poses of a live run sent on as they are found: OSC as VMC spells it, and JSON over a WebSocket.

    osc://127.0.0.1:39539   a bundle a frame to there: root, bones as VRM names them, the time (VMC protocol)
    ws://127.0.0.1:8766     who connects there gets the body once and then the newest pose of every frame

VMC is Unity's world: metres, y up, z forward, x to the right, left-handed; turns are quaternions xyzw in the parent's
turned frame, away from a T-pose in which nothing is turned. JSON is the studio's: mm, z up, joints in the world.
"""

import json
import math
import re
import socket
import threading
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from scipy.spatial.transform import Rotation
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import Server, ServerConnection, serve

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.errors import RunError
from studio.foundations.extras import load_extra
from studio.operations.jobs.send_addresses import REMEDY, SendAddress
from studio.results.export.naming import joint_names, points_of
from studio.results.export.options import OWN
from studio.results.export.skeleton import skeleton_of
from studio.search.trackers.tracker import FrameResult
from studio.sessions.run_record import RunRecord

EXTRA = "osc"
LOCAL_PAGES = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")
UNITY = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""From x forward, y left, z up to Unity's x right, y up, z forward: the handedness changes."""


class _Receiver(Protocol):
    def send(self, result: FrameResult, seconds: float) -> None: ...
    def close(self) -> None: ...


class PoseSender:
    """Sends the poses of one run. Nothing that a receiver does stops or slows the search.

    Raises RunError where an address cannot be opened, StudioError without the extra that OSC needs.
    """

    def __init__(self, addresses: Sequence[SendAddress], record: RunRecord, body: BodyModel) -> None:
        self._fps = record.fps
        self._receivers: list[_Receiver] = []
        try:
            for address in addresses:
                opened = _Osc(address, body) if address.kind == "osc" else _Socket(address, record, body)
                self._receivers.append(opened)
        except BaseException:
            self.close()
            raise

    def send(self, result: FrameResult) -> None:
        for receiver in self._receivers:
            receiver.send(result, result.frame / self._fps)

    def close(self) -> None:
        for receiver in self._receivers:
            receiver.close()
        self._receivers.clear()


class _Osc:
    """Datagrams: without a receiver they are lost, as they should be."""

    def __init__(self, address: SendAddress, body: BodyModel) -> None:
        self._messages = load_extra("pythonosc.osc_message_builder", EXTRA).OscMessageBuilder
        self._bundles = load_extra("pythonosc.osc_bundle_builder", EXTRA).OscBundleBuilder
        self._skeleton = skeleton_of(body)
        self._names, _ = joint_names(self._skeleton.names, "vrm")
        try:
            (family, kind, _, _, self._place), *_ = socket.getaddrinfo(
                address.host, address.port, type=socket.SOCK_DGRAM
            )
        except OSError as problem:
            raise RunError(f"No machine '{address.host}' is known ({problem.strerror}).", REMEDY) from None
        self._socket = socket.socket(family, kind)
        self._socket.setblocking(False)

    def send(self, result: FrameResult, seconds: float) -> None:
        moves, turns = self._skeleton.animated(np.asarray(result.estimate.pose)[None])
        places = moves[0] @ UNITY.T / 1000.0
        quaternions = Rotation.from_matrix(UNITY @ turns[0] @ UNITY.T).as_quat()
        bundle = self._bundles(0)
        self._add(bundle, "/VMC/Ext/OK", 1)
        self._add(bundle, "/VMC/Ext/T", seconds)
        self._add(bundle, "/VMC/Ext/Root/Pos", "root", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        for name, place, quaternion in zip(self._names, places, quaternions, strict=True):
            self._add(bundle, "/VMC/Ext/Bone/Pos", name, *map(float, (*place, *quaternion)))
        try:
            self._socket.sendto(bundle.build().dgram, self._place)
        except OSError:
            return

    def close(self) -> None:
        self._socket.close()

    def _add(self, bundle: Any, address: str, *values: float | str) -> None:  # noqa: ANN401
        message = self._messages(address=address)
        for value in values:
            message.add_arg(value)
        bundle.add_content(message.build())


class _Socket:
    """A WebSocket server: each connection gets the body, then the newest pose whenever there is a newer one."""

    def __init__(self, address: SendAddress, record: RunRecord, body: BodyModel) -> None:
        self._body, self._points = body, points_of(body, OWN)
        self._newest, self._number, self._closed = "", 0, False
        self._changed = threading.Condition()
        self._head = json.dumps(
            {
                "type": "body",
                "session": record.session,
                "run": record.name,
                "body": body.name,
                "fps": record.fps,
                "unit": "mm",
                "up": "z",
                "points": self._points.names,
                "edges": self._points.edges(body),
                "joints": [joint.name for joint in body.joints],
                "parents": [joint.parent for joint in body.joints],
                "parameters": [entry.name for entry in body.parameters],
            }
        )
        origins: list[Any] = [None, LOCAL_PAGES]
        try:
            self._server: Server = serve(self._serve, address.host, address.port, origins=origins)
        except OSError as problem:
            raise RunError(
                f"Poses cannot be offered at {address.host}:{address.port} ({problem.strerror}).",
                "Choose another port, or end what listens there.",
            ) from None
        threading.Thread(target=self._server.serve_forever, name="poses-out", daemon=True).start()

    def send(self, result: FrameResult, seconds: float) -> None:
        pose = np.asarray(result.estimate.pose)
        frames = joint_frames(self._body, pose[None])[0]
        joints = np.concatenate([frames[..., 3], Rotation.from_matrix(frames[..., :3]).as_quat()], axis=1)
        text = json.dumps(
            {
                "type": "pose",
                "frame": result.frame,
                "time": seconds,
                "state": result.tracking,
                "overlap": None if math.isnan(result.overlap) else round(result.overlap, 4),
                "limbs_lost": result.limbs_lost,
                "points": _rounded(self._points.positions(self._body, pose[None])[0], 2),
                "joints": _rounded(joints, 6),
                "parameters": _rounded(pose, 6),
            }
        )
        with self._changed:
            self._newest, self._number = text, self._number + 1
            self._changed.notify_all()

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._server.shutdown()

    def _serve(self, connection: ServerConnection) -> None:
        sent = 0
        try:
            connection.send(self._head)
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: self._closed or self._number > sent)  # noqa: B023
                    if self._closed:
                        return
                    text, sent = self._newest, self._number
                connection.send(text)
        except ConnectionClosed:
            return


def _rounded(values: Array, digits: int) -> Any:  # noqa: ANN401 - nested lists
    return np.round(values, digits).tolist()
