"""The scene that the weighting's tests share."""

import numba
import pytest
from weighting_scene import four_cameras, smooth_evidence

from studio.body.catalogue import load_body
from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.geometry.camera import Camera


@pytest.fixture(scope="session")
def human() -> BodyModel:
    """The default body."""
    return load_body("human31")


@pytest.fixture(scope="session")
def ring() -> tuple[Camera, ...]:
    """Four cameras around it."""
    return four_cameras()


@pytest.fixture(scope="session")
def smooth(ring: tuple[Camera, ...]) -> FrameEvidence:
    """Slowly varying maps."""
    return smooth_evidence(ring)


@pytest.fixture(autouse=True)
def _threads_as_before():
    threads = numba.get_num_threads()
    yield
    numba.set_num_threads(threads)
