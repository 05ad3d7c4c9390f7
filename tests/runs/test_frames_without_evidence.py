"""Frames in which nothing is to be seen: a defined answer, and the frame says so."""

import dataclasses
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from toy_session import HEIGHT, WIDTH, facing_camera, make_session, true_poses
from tracked_runs import finish

from studio.footage.capture.calibration_files import write_calibration
from studio.foundations.errors import RunError
from studio.foundations.geometry.camera import Camera
from studio.runs.new_run import prepare_run
from studio.search.likelihood.edge_region import EdgeRegionFrameLikelihood
from studio.search.trackers.tracker import FrameResult
from studio.sessions.manifest import write_manifest
from studio.sessions.session import Session

EMPTY = 4
"""The first frame of three without evidence."""
QUICK = {"particles": 60, "layers": 3, "start_repeats": 2}


def tracked(session: Session, start: np.ndarray, weighting: str) -> list[FrameResult]:
    run = prepare_run(session, name="a", weighting=weighting, start_pose=start, seed=2, knobs=QUICK)
    finish(session, run)
    with run.results() as results:
        return [results.result(frame) for frame in results.frames()]


@pytest.mark.parametrize("weighting", ["edge-region", "edge-silhouette", "edge-region-silhouette"])
def test_frames_with_empty_masks_are_said_to_be_lost(tmp_path: Path, weighting: str) -> None:
    session = make_session(tmp_path / "toy", 8)
    for frame in range(EMPTY, EMPTY + 3):
        nothing = np.zeros((HEIGHT, WIDTH), np.uint8)
        cv2.imwrite(str(session.path / "masks" / "front" / f"{frame:04d}.png"), nothing)
        cv2.imwrite(str(session.path / "pictures" / "front" / f"{frame:04d}.png"), np.dstack([nothing] * 3))
    results = tracked(session, true_poses()[0], weighting)
    assert len(results) == 8
    assert all(np.isfinite(result.estimate.pose).all() for result in results)
    assert [result.tracking for result in results[:EMPTY]] == ["tracked"] * EMPTY
    assert all(result.tracking != "tracked" for result in results[EMPTY : EMPTY + 3])
    notes = [result.notes for result in results]
    said = (
        "All weights were equal in layers 1, 2, 3: the pictures prefer no pose.",
        "The picture of camera 'front' is blank.",
    )
    assert notes[:EMPTY] == [()] * EMPTY
    assert notes[EMPTY : EMPTY + 3] == [said] * 3
    assert not any("front" in note for note in notes[-1])


def with_second(session: Session, camera: Camera) -> Session:
    """The session with another camera, whose footage is the first one's."""
    (first,) = session.manifest.footage.cameras
    for part in ("pictures", "masks"):
        shutil.copytree(session.path / part / "front", session.path / part / camera.name)
    path, masks = f"pictures/{camera.name}", f"masks/{camera.name}"
    second = dataclasses.replace(first, name=camera.name, path=path, masks=masks)
    footage = dataclasses.replace(session.manifest.footage, cameras=(first, second))
    write_calibration((facing_camera(), camera), session.path / "calibration" / "cameras.toml")
    manifest = session.manifest
    entries = {name: getattr(manifest, name) for name in manifest.__struct_fields__}
    write_manifest(session.path, type(manifest)(**entries | {"footage": footage}))
    return Session(session.path)


@pytest.mark.parametrize("weighting", ["edge-region", "edge-silhouette", "edge-region-silhouette"])
def test_one_empty_camera_leaves_the_pose_to_the_others_and_is_named(tmp_path: Path, weighting: str) -> None:
    session = with_second(make_session(tmp_path / "toy", 8), facing_camera("beside"))
    for frame in range(EMPTY, EMPTY + 3):
        nothing = np.zeros((HEIGHT, WIDTH), np.uint8)
        cv2.imwrite(str(session.path / "masks" / "beside" / f"{frame:04d}.png"), nothing)
    results = tracked(session, true_poses()[0], weighting)
    assert [result.notes for result in results] == [
        ("Nothing stands out in camera 'beside'.",) if EMPTY <= result.frame < EMPTY + 3 else ()
        for result in results
    ]
    assert all(result.tracking != "no evidence" for result in results)
    poses = np.array([result.estimate.pose for result in results])
    assert np.abs(poses - true_poses(8)).max() < 0.2


def turned_away(name: str) -> Camera:
    """At the front camera's place, looking the other way: all of the body is behind it."""
    front = facing_camera(name)
    about = np.diag([-1.0, 1.0, -1.0]) @ front.rotation
    return dataclasses.replace(front, rotation=about, translation=-about @ front.centre)


@pytest.mark.parametrize("weighting", ["edge-region", "edge-silhouette", "edge-region-silhouette"])
def test_a_body_behind_a_camera_is_seen_by_the_others_and_it_is_said(tmp_path: Path, weighting: str) -> None:
    session = with_second(make_session(tmp_path / "toy", 6), turned_away("away"))
    results = tracked(session, true_poses()[0], weighting)
    assert all(np.isfinite(result.estimate.pose).all() for result in results)
    assert all(np.isfinite(result.estimate.log_weight) for result in results)
    assert all("The pose is out of sight of camera 'away'." in result.notes for result in results)


def test_a_frame_without_a_finite_weight_ends_the_run_with_its_number(
    session_on_disk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was tracked before stays, and the run goes on once its frames can be weighed."""
    run = prepare_run(session_on_disk, name="a", start_pose=true_poses()[0], seed=2, last=4, knobs=QUICK)
    finish(session_on_disk, run, layers=2 * QUICK["layers"] + 1 * QUICK["layers"] + 1)
    whole = EdgeRegionFrameLikelihood.log_likelihood
    with monkeypatch.context() as patched:
        patched.setattr(
            EdgeRegionFrameLikelihood,
            "log_likelihood",
            lambda self, poses, stage=0: whole(self, poses, stage) * np.nan,
        )
        with pytest.raises(RunError, match=r"^Frame 2, layer 2: The likelihood gave nan for a pose\."):
            finish(session_on_disk, run)
    with run.results() as results:
        assert results.frames() == [0, 1]
    assert len(finish(session_on_disk, run)) == 4
