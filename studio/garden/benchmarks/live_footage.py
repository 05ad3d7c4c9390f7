"""Footage and behaviour model for the live benchmark, made from what is installed with the studio.

Two seconds of a rendered walk are too short, and rendering more takes minutes. So every video is rewritten, playing its
frames forwards and backwards until it is long enough, and decoded frame by frame as any recording.
"""

import dataclasses
from pathlib import Path

import msgspec
import numpy as np

from studio.body.catalogue import load_body
from studio.footage.capture.footage import folded
from studio.footage.capture.footage_source import CameraSource
from studio.foundations.progress import Progress, no_progress
from studio.results.drawing_footage.clips import ClipWriter
from studio.results.drawing_footage.recipes import synthesize
from studio.results.motion_sources import recipe_recording
from studio.search.behaviour.model_file import write_model
from studio.search.behaviour.model_learning import learn_model
from studio.search.behaviour.settings import LearningSettings
from studio.sessions.manifest import write_manifest
from studio.sessions.session import Session

RECIPE = "walk-five-cameras"
QUALITY = 19.0


def make_footage(place: Path, seconds: float, progress: Progress = no_progress) -> Session:
    """The session, made in the new folder `place`. progress : called with (step, done, total)."""
    synthesize(RECIPE, place, progress)
    lengthen(Session(place), seconds, progress)
    return Session(place)


def lengthen(session: Session, seconds: float, progress: Progress = no_progress) -> None:
    """Extend a session's videos to `seconds` by playing them forwards and backwards, unless they are long enough."""
    manifest = session.manifest
    source, count = manifest.footage, round(seconds * manifest.fps)
    if count <= source.frame_count:
        return
    footage = session.footage()
    cameras: list[CameraSource] = []
    for number, camera in enumerate(source.cameras):
        clip = [footage.picture(camera.name, frame) for frame in range(source.frame_count)]
        path = session.path / camera.path
        longer = path.with_name(f"{path.stem}-long.mp4")
        with ClipWriter(longer, (camera.width, camera.height), source.fps, QUALITY) as writer:
            for frame in range(count):
                writer.add(clip[folded(frame, source.frame_count)])
        entry = longer.relative_to(session.path).as_posix()
        cameras.append(dataclasses.replace(camera, path=entry, frame_count=count))
        progress("writing long videos", number + 1, len(source.cameras))
    footage.close()
    changed = dataclasses.replace(source, frame_count=count, cameras=tuple(cameras))
    write_manifest(session.path, msgspec.structs.replace(manifest, footage=changed))


def learn_walk(place: Path, seed: int = 0) -> Path:
    """The behaviour model of the footage's motion, forwards and backwards, in the file `place`."""
    body = load_body("human25")
    recording = recipe_recording(RECIPE, body)
    sources = [recording.poses, np.ascontiguousarray(recording.poses[::-1])]
    rng = np.random.default_rng(seed)
    model = learn_model(sources, body, recording.fps, LearningSettings(), rng, sources=(RECIPE, RECIPE))
    write_model(model, place)
    return place
