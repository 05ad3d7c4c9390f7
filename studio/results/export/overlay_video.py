"""Videos of the cameras' footage with the body drawn over it: H.264 in mp4, upright, one a camera."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from studio.foundations.arrays import Bytes
from studio.foundations.errors import ExportError, NotFoundError
from studio.foundations.words import counted
from studio.results.export.task import ExportTask, Written
from studio.results.overlay_pictures import compose_view
from studio.sessions.names import free_name, name_from

QUALITY = "21"
PRESET = "veryfast"
LAYERS = ("outline",)


def write_videos(task: ExportTask) -> Written:
    """One mp4 for `options.camera`, else one a camera, with the camera's name before the ending.

    Frames in which the body was lost, or that were not tracked, show the picture alone. Raises NotFoundError for a
    camera that there is not, ExportError where a video does not read back with all its frames.
    """
    names = [camera.name for camera in task.session.cameras()]
    chosen = [task.options.camera] if task.options.camera else names
    if not set(chosen) <= set(names):
        raise NotFoundError(
            f"There is no camera '{task.options.camera[:64]}' in this session.", f"It has {', '.join(names)}."
        )
    count = len(task.motion.frames)
    files, sizes = list[Path](), list[tuple[int, int]]()
    for index, camera in enumerate(chosen):
        place = task.place
        if not task.options.camera and len(names) > 1:
            own = free_name(
                f"{place.stem}-{name_from(camera, f'camera-{index + 1}')}", {path.stem for path in files}
            )
            place = place.with_name(f"{own}{place.suffix}")
        sizes.append(_write_video(task, place, camera, index * count, len(chosen) * count))
        files.append(place)
    for place, size in zip(files, sizes, strict=True):
        _read_back(place, size, count)
    plain = int((~task.motion.known).sum())
    notes = (
        [f"The picture stands alone in {counted(plain, 'frame')}: no pose, or the body was lost."]
        if plain
        else []
    )
    noun = "video reads" if len(files) == 1 else "videos read"
    return Written(tuple(files), f"{len(files)} {noun} back with {count} frames each", tuple(notes))


def _write_video(task: ExportTask, place: Path, camera: str, done: int, total: int) -> tuple[int, int]:
    motion, size = task.motion, (0, 0)
    with av.open(str(place), "w", format="mp4", options={"movflags": "faststart"}) as container:
        rate = Fraction(motion.fps).limit_denominator(1001)
        stream = container.add_stream("libx264", rate=rate, options={"crf": QUALITY, "preset": PRESET})
        stream.pix_fmt = "yuv420p"
        for row, number in enumerate(motion.frames):
            if row % 5 == 0:
                task.step(f"video of {camera}", done + row, total)
            layers = LAYERS if motion.known[row] else ()
            picture = compose_view(
                task.session,
                task.run,
                int(number),
                camera,
                layers,
                motion.poses[row],
                height=task.options.height or None,
            )
            picture = even_sized(picture)
            if row == 0:
                size = (picture.shape[1], picture.shape[0])
                stream.width, stream.height = size
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return size


def even_sized(picture: Bytes) -> Bytes:
    """(H, W, 3) with even sides, as H.264 wants them: the last row or column is doubled where one is odd."""
    rows, columns = picture.shape[0] % 2, picture.shape[1] % 2
    return np.pad(picture, ((0, rows), (0, columns), (0, 0)), mode="edge") if rows or columns else picture


def _read_back(place: Path, size: tuple[int, int], count: int) -> None:
    """Decode the whole video and count. Raises ExportError."""
    with av.open(str(place)) as container:
        sizes = [(frame.width, frame.height) for frame in container.decode(video=0)]
    if len(sizes) != count or set(sizes) != {size}:
        raise ExportError(
            f"'{place.name}' reads back with {len(sizes)} frames instead of {count}.", "Export it again."
        )
