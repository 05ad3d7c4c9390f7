"""The Lee walk's own masks, hall and all: its calibration raises nothing, every planted fault is named."""

import dataclasses
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from studio.evidence.backgrounds import Backgrounds
from studio.evidence.pipeline import EvidenceMaker
from studio.foundations.geometry.camera import Camera
from studio.runs.setup.person_hull import spread_frames
from studio.runs.setup.session_settings import session_settings
from studio.runs.setup.silhouette_faults import person_alone, silhouette_faults
from studio.sessions.importers.importing import import_source
from studio.sessions.session import Session

pytestmark = pytest.mark.real_data

Masks = dict[int, dict[str, NDArray[np.uint8]]]
NAMES = ("Camera1", "Camera2", "Camera3", "Camera4")


@pytest.fixture(scope="module")
def walk(real_data: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[tuple[Camera, ...], Masks]:
    """Its cameras, and the largest pieces of its masks in five frames."""
    place = tmp_path_factory.mktemp("lee") / "walk"
    import_source(real_data / "lee-walk", place)
    session = Session(place)
    footage = session.footage()
    settings = session_settings(session).evidence
    maker = EvidenceMaker(session.cameras(), footage, Backgrounds(footage), settings, "none")
    masks = {
        frame: {view.camera: person_alone(view.mask) for view in maker.evidence(frame).views}
        for frame in spread_frames(footage.frame_count, 5)
    }
    footage.close()
    return session.cameras(), masks


def test_the_calibration_raises_nothing(walk: tuple[tuple[Camera, ...], Masks]) -> None:
    assert silhouette_faults(*walk, None) == ()


@pytest.mark.parametrize("names", list(combinations(NAMES, 2)))
def test_exchanged_cameras(walk: tuple[tuple[Camera, ...], Masks], names: tuple[str, str]) -> None:
    cameras, masks = walk
    other = dict(zip(names, reversed(names), strict=True))
    by_name = {camera.name: camera for camera in cameras}
    exchanged = tuple(dataclasses.replace(by_name[other.get(name, name)], name=name) for name in by_name)
    (found,) = silhouette_faults(exchanged, masks, None)
    assert (found.code, found.severity, found.cameras) == ("swapped-cameras", "blocks", names)


@pytest.mark.parametrize("name", NAMES)
def test_a_mirrored_video(walk: tuple[tuple[Camera, ...], Masks], name: str) -> None:
    cameras, masks = walk
    mirrored = {
        frame: {camera: mask[:, ::-1] if camera == name else mask for camera, mask in views.items()}
        for frame, views in masks.items()
    }
    (found,) = silhouette_faults(cameras, mirrored, None)
    assert (found.code, found.severity, found.cameras) == ("mirrored-video", "blocks", (name,))
