"""The bundled walk with its legs exchanged for a while: corrected in a separate track, and reported."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
from planted_sides import EXCHANGED, LAST, planted, stored, true_poses
from sample_walk import copy_of_walk

from studio.body.forward_kinematics import marker_points
from studio.operations.jobs.batch import track_to_end
from studio.operations.jobs.open_live_run import opened
from studio.operations.jobs.open_run import OpenRun
from studio.operations.jobs.tracking_job import SideLooking
from studio.runs.problem_source import ProblemSource
from studio.runs.refining import smooth_run
from studio.runs.sides import correct_clip, notes_of
from studio.runs.tracks import best_track, read_track, track_names
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

WORDS = ("frames 12 to 27: left and right leg exchanged",)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return copy_of_walk(tmp_path_factory.mktemp("sides") / "walk")


@pytest.fixture(scope="module")
def truth(session: Session) -> np.ndarray:
    return true_poses(session)


@pytest.fixture(scope="module")
def run(session: Session, truth: np.ndarray) -> StoredRun:
    return planted(session, truth)


@pytest.fixture
def problems(session: Session, run: StoredRun) -> Iterator[ProblemSource]:
    with closing(ProblemSource(session, run.body(), run.cameras())) as source:
        yield source


@pytest.mark.slow
def test_legs_are_corrected_once_and_the_raw_track_stays(
    run: StoredRun, truth: np.ndarray, problems: ProblemSource
) -> None:
    raw, read = read_track(run), list[int]()
    assert notes_of(run) == run.record.notes
    steps: list[str] = []
    words = correct_clip(run, problems, read.append, lambda step, _done, _total: steps.append(step))
    assert words == WORDS
    assert "comparing left and right" in steps
    assert np.array_equal(read_track(run).poses, raw.poses)
    track, body = read_track(run, "best"), run.body()
    assert track.name == "sides"
    away = np.linalg.norm(marker_points(body, track.poses) - marker_points(body, truth), axis=2).mean(axis=1)
    planted = np.linalg.norm(marker_points(body, raw.poses) - marker_points(body, truth), axis=2).mean(axis=1)
    assert planted[EXCHANGED].mean() > 50.0
    assert away[EXCHANGED].mean() < 25.0
    kept = np.setdiff1d(np.arange(LAST), EXCHANGED)
    assert np.array_equal(track.poses[kept], raw.poses[kept])
    assert (track.confidence[list(EXCHANGED)] > 0.7).all()
    assert notes_of(run)[-1].startswith(
        "Corrected over the whole clip, in track 'sides': frames 12 to 27: left"
    )
    looked = len(read)
    assert correct_clip(run, problems, read.append) == words
    assert len(read) == looked
    assert smooth_run(run).track.made_by["from"] == "sides"


@pytest.mark.slow
def test_a_run_that_is_sound_has_no_such_track(
    session: Session, run: StoredRun, truth: np.ndarray, problems: ProblemSource
) -> None:
    other = stored(session, truth)
    assert correct_clip(other, problems) == ()
    assert track_names(other) == ("raw",)
    # The same run, tracked again and better: what was made of it before is dropped.
    correct_clip(run, problems)
    again = stored(session, truth, run)
    assert best_track(again, ("sides",)).outdated == ("sides",)
    assert notes_of(again) == again.record.notes
    assert correct_clip(again, problems) == ()
    assert "sides" not in track_names(again)


@pytest.mark.slow
def test_a_finished_runs_sides_are_checked(session: Session, truth: np.ndarray) -> None:
    batch, job = planted(session, truth), planted(session, truth)
    steps: list[str] = []
    track_to_end(session, batch, lambda step, _done, _total: steps.append(step))
    assert "comparing left and right" in steps
    assert read_track(batch, "sides").made_by["exchanged"] == list(WORDS)

    messages: list[tuple[str, str]] = []

    def log(_run: OpenRun, level: str, text: str) -> None:
        messages.append((level, text))

    looking, open_run = SideLooking(log), opened(str(session.path), str(job.folder))
    looking.add(open_run)
    looking._thread.submit(lambda: None).result()
    looking.close()
    open_run.close()
    assert [level for level, _ in messages] == ["info"]
    assert WORDS[0] in messages[0][1]
    assert notes_of(job)[-1] == messages[0][1]
