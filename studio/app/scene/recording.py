"""A run's scene as a file: body, floor and cameras, moving as tracked, for viser's own player.

A `.viser` file is played by viser's browser client (`?playbackPath=`); an `.html` file carries that client with it and
needs nothing else. In gaps the body is hidden.
"""

import base64
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import zstandard

from studio.app.scene import METRES_PER_MM
from studio.app.scene.body_view import BodyView, limb_frames
from studio.app.scene.camera_views import CameraView
from studio.app.scene.floor_view import FloorView
from studio.app.scene.guarded_server import GuardedServer
from studio.body.forward_kinematics import limb_ends
from studio.foundations.arrays import Array
from studio.foundations.errors import ExportError
from studio.foundations.foreign_files import read_file
from studio.results.export.task import ExportTask, Written, agreed
from studio.runs.drawing.colour_tokens import colour_tokens

BODY = "/body"
PAGE = ".html"
EMBEDDED = 'window.__VISER_EMBED_DATA__="'
LENGTH = 8
AWAY, HIGHER = 4.5, 1.2
STEP_ROWS = 10


class Recording(NamedTuple):
    """The content of a recording. seconds : its length. messages : (time, message) in order, as viser decodes them."""

    seconds: float
    messages: list[tuple[float, dict[str, Any]]]


LARGEST_RECORDING = 2 << 30


def record_scene(task: ExportTask) -> Written:
    """Write the scene's recording, as a page if the file ends so, and read it back.

    Raises ExportError if the limbs in the file are not where they were.
    """
    server = GuardedServer()
    try:
        _build(server, task)
        body, tokens = BodyView(server, task.motion.body, name=BODY), colour_tokens(dark=True)
        serializer = server.get_scene_serializer()
        for row in range(len(task.motion.poses)):
            if row % STEP_ROWS == 0:
                task.step("recording", row, len(task.motion.poses))
            body.show(task.motion.poses[row] if task.motion.known[row] else None, tokens)
            serializer.insert_sleep(1.0 / task.motion.fps)
        task.step("packing", len(task.motion.poses), len(task.motion.poses))
        if task.place.suffix == PAGE:
            task.place.write_text(serializer.as_html(dark_mode=True), encoding="utf-8")
        else:
            task.place.write_bytes(serializer.serialize())
    finally:
        server.stop()
    checked = _check(task, read_recording(task.place))
    hidden = int((~task.motion.known).sum())
    return Written((task.place,), checked, (f"The body is hidden in {hidden} frames.",) if hidden else ())


def read_recording(path: Path) -> Recording:
    """A recording's messages. Raises ExportError for what is none."""
    try:
        content = read_file(path, LARGEST_RECORDING)
        if path.suffix == PAGE:
            content = base64.b64decode(content.decode("utf-8").split(EMBEDDED, 1)[1].split('"', 1)[0])
        size = int.from_bytes(content[:LENGTH], "little")
        inner = zstandard.ZstdDecompressor().decompress(content[LENGTH:], max_output_size=size)
        end = LENGTH + int.from_bytes(inner[:LENGTH], "little")
        recorded = msgspec.msgpack.decode(inner[LENGTH:end])
        messages = [(float(at), message) for at, message in recorded["messages"]]
        return Recording(float(recorded["durationSeconds"]), messages)
    except (
        OSError,
        IndexError,
        ValueError,
        KeyError,
        TypeError,
        zstandard.ZstdError,
        msgspec.DecodeError,
    ) as error:
        raise ExportError(
            f"'{path.name}' is no recording of a scene ({error}).", "Export it again."
        ) from None


def _build(server: GuardedServer, task: ExportTask) -> None:
    """Floor and cameras, and where a viewer begins: in front of the body and a little above it."""
    tokens, cameras = colour_tokens(dark=True), task.run.cameras()
    ends = limb_ends(task.motion.body, task.motion.poses[:1])[0].reshape(-1, 3)
    middle = ends.mean(axis=0)
    FloorView(server, [*(camera.centre for camera in cameras), middle]).show(tokens)
    for camera in cameras:
        CameraView(server, camera).show(tokens)
    server.scene.set_up_direction("+z")
    target = middle * METRES_PER_MM
    server.initial_camera.position = tuple(target + np.array([AWAY, 0.0, HIGHER]))
    server.initial_camera.look_at = tuple(target)


def _check(task: ExportTask, recording: Recording) -> str:
    """Compare where the limbs are in each frame of the file with where they were."""
    motion = task.motion
    places = {f"{BODY}/{limb.name}": index for index, limb in enumerate(motion.body.drawn)}
    # A limb stands at the origin until it is moved; unchanged values are not repeated.
    moved: dict[int, list[tuple[float, Array]]] = {index: [(-1.0, np.zeros(3))] for index in places.values()}
    for at, message in recording.messages:
        if message.get("type") == "SetPositionMessage" and message.get("name") in places:
            moved[places[message["name"]]].append((at, np.array(message["position"])))
    wanted = np.stack([limb_frames(motion.body, pose)[1] for pose in motion.poses])
    worst = 0.0
    for index, steps in moved.items():
        times = np.array([at for at, _ in steps])
        # A frame shows the last value up to its time; half a frame absorbs rounding.
        rows = np.searchsorted(times, motion.times + 0.5 / motion.fps) - 1
        shown = np.array([place for _, place in steps])[rows]
        worst = max(worst, float(np.linalg.norm(shown - wanted[:, index], axis=1)[motion.known].max()))
    return agreed(task.place, worst / METRES_PER_MM)
