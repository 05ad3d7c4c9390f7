"""Small videos and picture folders whose every frame says its own number, and a rig of cameras around a point."""

from pathlib import Path

import av
import cv2
import numpy as np
from looking_cameras import turned_to

from studio.foundations.geometry.camera import Camera

BITS, BLOCK = 8, 16
WIDTH, HEIGHT = BITS * BLOCK, 96


def numbered_frame(number: int, seed: int = 0) -> np.ndarray:
    """(96, 128, 3) noise with a band of eight blocks, black or white: the bits of `number`."""
    rng = np.random.default_rng((seed, number))
    picture = rng.integers(60, 190, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    for bit in range(BITS):
        picture[:BLOCK, bit * BLOCK : (bit + 1) * BLOCK] = 235 if number >> bit & 1 else 20
    return picture


def number_of(picture: np.ndarray) -> int:
    """The number that a frame says, read from the middle of its blocks."""
    middles = picture[BLOCK // 2, BLOCK // 2 : BITS * BLOCK : BLOCK].mean(axis=1)
    return sum(1 << bit for bit, level in enumerate(middles) if level > 128)


def write_video(path: Path, frames: list[np.ndarray], fps: int = 30, **settings: object) -> Path:
    """Encode BGR frames. settings : codec, gop (frames between keyframes), pts (times in frames), options."""
    times = settings.get("pts")
    height, width = frames[0].shape[:2]
    with av.open(str(path), "w", options=settings.get("options") or {}) as container:
        stream = container.add_stream(str(settings.get("codec", "libx264")), rate=fps)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.codec_context.gop_size = int(settings.get("gop", 12))
        stream.codec_context.thread_count = 1  # the same bytes on any number of cores
        for number, picture in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
            frame.pts = number if times is None else times[number]
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def write_pictures(folder: Path, frames: list[np.ndarray], first: int = 0) -> Path:
    """Write frames as PNG, numbered from `first`."""
    folder.mkdir(parents=True)
    for number, picture in enumerate(frames, first):
        cv2.imwrite(str(folder / f"frame{number:04d}.png"), picture)
    return folder


def looking_at(
    name: str, centre: tuple[float, float, float], target: tuple[float, float, float], roll: float = 0.0
) -> Camera:
    """A 128x96 camera at `centre` (mm) whose optical axis meets `target`, upright at roll 0 (radians)."""
    place = np.array(centre)
    upright = turned_to(place, target)
    cos, sin = np.cos(roll), np.sin(roll)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ upright
    matrix = np.array([[120.0, 0.0, 63.0], [0.0, 121.0, 48.5], [0.0, 0.0, 1.0]])
    distortion = np.array([-0.05, 0.01, 1e-3, -2e-3, 0.0])
    return Camera(name, WIDTH, HEIGHT, matrix, distortion, rotation, -rotation @ place)


def rig(count: int = 3, prefix: str = "cam") -> tuple[Camera, ...]:
    """Cameras on a circle of 3 m at 1.5 m height, looking at a point 1 m above the origin."""
    angles = 2.0 * np.pi * np.arange(count) / count + 0.3
    return tuple(
        looking_at(f"{prefix}{k + 1}", (3000.0 * np.cos(a), 3000.0 * np.sin(a), 1500.0), (0.0, 0.0, 1000.0))
        for k, a in enumerate(angles)
    )
