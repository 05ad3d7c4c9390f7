"""The walk that comes with the studio: four cameras, clips of the empty room, a start pose, the truth."""

import shutil
from pathlib import Path

from mjpeg_streams import jpeg

from studio.sessions.session import Session

SAMPLES = Path(__file__).resolve().parent.parent / "sample_sessions"
WALK = SAMPLES / "walk"
STREAMED = ("cam1", "cam2")
STREAM_FPS = 30.0


def copy_of_walk(place: Path, *left_out: str) -> Session:
    """The walk where it can be written to, without what a person made of it. left_out : parts that nobody needs."""
    shutil.copytree(WALK, place, ignore=shutil.ignore_patterns("runs", "comparisons", *left_out))
    return Session(place)


def streamed_pictures(walk: Session, count: int) -> dict[str, list[bytes]]:
    """JPEGs of two cameras: every second frame, so `STREAM_FPS` a second."""
    footage = walk.footage()
    found = {name: [jpeg(footage.picture(name, 2 * frame)) for frame in range(count)] for name in STREAMED}
    footage.close()
    return found
