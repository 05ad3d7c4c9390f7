"""The clips of others are sessions that begin in their true pose."""

from pathlib import Path

import numpy as np
import pytest

from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import read_trc
from studio.garden.reproduction.open_questions.other_people import imported
from studio.results.comparison.footage_cache import FootageCache
from studio.sessions.session import Session

pytestmark = pytest.mark.real_data


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wood", "tiles"])
def test_a_clip_of_others_begins_in_its_true_pose(
    name: str, real_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STUDIO_REAL_DATA", str(real_data))
    cache = FootageCache(tmp_path)
    place = imported(f"data:drawn-elsewhere/{name}", cache)
    assert imported(f"data:drawn-elsewhere/{name}", cache) == place
    session = Session(place)
    body, pose = session.body(), session.start_pose()
    assert pose is not None
    assert session.truth_path is not None
    truth = read_trc(session.truth_path)
    at = [truth.names.index(marker.name) for marker in body.markers]
    apart = np.linalg.norm(marker_points(body, pose)[0] - truth.positions[0, at], axis=1)
    # The top of the head is the body's, not the person's.
    assert np.median(apart) < 20.0
    assert session.manifest.frame_count == 75
