"""Frames in which nothing is to be seen: a defined answer, and the frame says so."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from toy_session import HEIGHT, WIDTH, make_session, true_poses
from tracked_runs import finish

from studio.runs.new_run import prepare_run
from studio.sessions.session import Session
from studio.tracking.tracker import FrameResult

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
