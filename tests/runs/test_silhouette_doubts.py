"""The footage's silhouettes name the fault of a calibration that does not belong to it."""

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest
from drawn_people import drawn_mask, ring_of_cameras

from studio.body.catalogue import load_body
from studio.footage.capture.calibration_files import write_calibration
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.runs.new_run import prepare_run
from studio.runs.setup.mask_quality import mask_quality, measure_masks
from studio.runs.setup.session_settings import session_settings
from studio.runs.setup.silhouette_faults import silhouette_faults
from studio.runs.setup.workflow import workflow_of
from studio.sessions.samples import sample_folder
from studio.sessions.session import CAMERAS_PATH, Session

FRAMES = (5, 20, 35, 50)
HEIGHT = 1750.0


def exchanged(cameras: tuple[Camera, ...], one: int, two: int) -> tuple[Camera, ...]:
    """Two cameras that carry each other's names."""
    changed = list(cameras)
    changed[one] = dataclasses.replace(cameras[two], name=cameras[one].name)
    changed[two] = dataclasses.replace(cameras[one], name=cameras[two].name)
    return tuple(changed)


@pytest.fixture(scope="module")
def rig() -> tuple[Camera, ...]:
    return ring_of_cameras(4)


@pytest.fixture(scope="module")
def masks(rig: tuple[Camera, ...]) -> dict[int, dict[str, np.ndarray]]:
    """A person in four places and headings, arms lifted sideways as they never are in the next."""
    body, rng = load_body("human31"), np.random.default_rng(3)
    at = {entry.name: number for number, entry in enumerate(body.parameters)}
    found = {}
    for frame in range(4):
        pose = np.array(body.neutral, dtype=np.float64)
        pose[[at["pelvis_x"], at["pelvis_y"]]] = rng.uniform(-400.0, 400.0, 2)
        pose[at["pelvis_rz"]] = rng.uniform(-np.pi, np.pi)
        pose[at["left_shoulder_rx"]] += rng.uniform(0.3, 1.2)
        found[frame] = {camera.name: drawn_mask(body, pose, camera) for camera in rig}
    return found


def test_a_sound_calibration_raises_nothing(rig: tuple[Camera, ...], masks: dict) -> None:
    assert silhouette_faults(rig, masks, None) == ()
    assert silhouette_faults(rig, masks, HEIGHT) == ()


def test_cameras_that_were_exchanged_are_named(rig: tuple[Camera, ...], masks: dict) -> None:
    (found,) = silhouette_faults(exchanged(rig, 0, 1), masks, HEIGHT)
    assert (found.code, found.severity, found.cameras) == ("swapped-cameras", "blocks", ("cam1", "cam2"))


def test_a_mirrored_video_is_named(rig: tuple[Camera, ...], masks: dict) -> None:
    mirrored = {
        frame: {name: mask[:, ::-1] if name == "cam3" else mask for name, mask in views.items()}
        for frame, views in masks.items()
    }
    (found,) = silhouette_faults(rig, mirrored, None)
    assert (found.code, found.cameras) == ("mirrored-video", ("cam3",))


def test_a_wrong_size_blocks_unless_only_the_given_height_differs(
    rig: tuple[Camera, ...], masks: dict
) -> None:
    larger = tuple(dataclasses.replace(camera, translation=1.3 * camera.translation) for camera in rig)
    (finding,) = silhouette_faults(larger, masks, HEIGHT)
    assert (finding.code, finding.severity) == ("square-size", "warns")
    giant = tuple(dataclasses.replace(camera, translation=2.0 * camera.translation) for camera in rig)
    (unseen,) = silhouette_faults(giant, masks, None)
    assert unseen.severity == "blocks"


def test_faults_shown_by_the_file_alone_are_not_repeated(rig: tuple[Camera, ...], masks: dict) -> None:
    in_metres = tuple(dataclasses.replace(camera, translation=camera.translation / 1000.0) for camera in rig)
    assert silhouette_faults(in_metres, masks, HEIGHT) == ()


@pytest.fixture
def walk(tmp_path: Path) -> Session:
    """The bundled walk, its calibration not yet spoilt."""
    return Session(Path(shutil.copytree(sample_folder("walk"), tmp_path / "walk")))


def test_measuring_the_masks_finds_exchanged_cameras(walk: Session) -> None:
    """From a session's videos: the walk's own masks, and two of its cameras under each other's names."""
    cameras = walk.cameras()
    write_calibration(exchanged(cameras, 0, 2), walk.path / CAMERAS_PATH)
    spoilt = Session(walk.path)
    found = mask_quality(spoilt, session_settings(spoilt).evidence, FRAMES)
    assert [doubt.code for doubt in found.doubts] == ["swapped-cameras"]
    assert found.doubts[0].cameras == (cameras[0].name, cameras[2].name)
    assert not found.usable
    assert "in doubt" in found.in_words()


def test_a_session_whose_footage_contradicts_its_cameras_is_not_tracked(walk: Session) -> None:
    """Nothing is refused before the masks are measured, nor once the calibration is set right."""
    sound = walk.cameras()
    assert prepare_run(walk, last=2, fit_shape=False).record.notes == ()
    write_calibration(exchanged(sound, 0, 2), walk.path / CAMERAS_PATH)
    spoilt = Session(walk.path)
    prepare_run(spoilt, last=2, fit_shape=False)
    measure_masks(spoilt)

    with pytest.raises(CalibrationError) as refused:
        prepare_run(spoilt, last=2, fit_shape=False)
    assert sound[0].name in refused.value.message
    assert sound[2].name in refused.value.message
    assert len(spoilt.runs()) == 2
    (note,) = prepare_run(spoilt, last=2, fit_shape=False, allow_inconsistent=True).record.notes
    assert note.startswith("Tracked despite: ")
    step = next(step for step in workflow_of(spoilt).steps if step.step == "calibration")
    assert (step.state, "contradicts" in step.why) == ("stale", True)

    write_calibration(sound, walk.path / CAMERAS_PATH)
    assert prepare_run(Session(walk.path), last=2, fit_shape=False).record.notes == ()
