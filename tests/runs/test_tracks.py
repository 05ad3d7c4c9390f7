"""Tracks of a run are kept beside what the search found, and come back as they were written."""

import dataclasses
import errno
import os
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from store_records import layer_of, record_of, result_of
from toy_session import make_session

from studio.foundations.arrays import consecutive
from studio.foundations.errors import NotFoundError, SessionError
from studio.runs.tracks import (
    BEST,
    BestTrack,
    Track,
    best_track,
    read_track,
    track_digest,
    track_names,
    write_track,
)
from studio.search.trackers.tracker import LOST, TRACKED
from studio.sessions.results_store import ResultsWriter
from studio.sessions.stored_run import StoredRun


@pytest.fixture
def run(tmp_path: Path) -> StoredRun:
    session = make_session(tmp_path / "toy", frames=2)
    stored = session.new_run(record_of(session, "run-1"))
    writer = ResultsWriter(stored.folder)
    for frame in (0, 1, 2):
        state = LOST if frame == 1 else TRACKED
        result = dataclasses.replace(result_of(frame), tracking=state, overlap=0.25 * frame)
        writer.write_frame(result, [layer_of(frame, 0)], True)
    writer.close()
    return stored


def track_of(name: str, frames: tuple[int, ...] = (0, 1, 5)) -> Track:
    rng = np.random.default_rng(len(frames))
    return Track(
        name,
        np.array(frames, dtype=np.int64),
        rng.normal(size=(len(frames), 4)),
        np.array([0.5, np.nan, 1.0][: len(frames)]),
        ("tracked", "", "lost")[: len(frames)],
        {"verb": "smooth", "from": "raw", "strength_mm_s2": 12.5, "filled": [3, 4]},
    )


def test_raw_is_what_the_store_holds(run: StoredRun) -> None:
    track = read_track(run)
    with run.results() as results:
        frames, poses = results.poses()
    assert track.name == "raw"
    assert track.made_by == {}
    assert np.array_equal(track.frames, frames)
    assert np.array_equal(track.poses, poses)
    assert track.confidence.tolist() == [0.0, 0.25, 0.5]
    assert track.states == (TRACKED, LOST, TRACKED)


def test_a_run_without_frames_has_an_empty_raw_track(tmp_path: Path) -> None:
    session = make_session(tmp_path / "toy", frames=1)
    track = read_track(session.new_run(record_of(session, "run-1")))
    assert track.poses.shape == (0, 4)
    assert track.states == ()


def test_a_written_track_comes_back_as_it_was(run: StoredRun) -> None:
    before = (run.folder / "results.sqlite").read_bytes()
    track = track_of("smoothed")
    assert write_track(run, track) == run.folder / "tracks" / "smoothed.npz"
    back = read_track(run, "smoothed")
    assert np.array_equal(back.frames, track.frames)
    assert np.array_equal(back.poses, track.poses)
    assert np.array_equal(back.confidence, track.confidence, equal_nan=True)
    assert back.states == track.states
    assert dict(back.made_by) == dict(track.made_by)
    assert track_names(run) == ("raw", "smoothed")
    assert (run.folder / "results.sqlite").read_bytes() == before


def test_names_come_raw_first_and_foreign_files_are_left_out(run: StoredRun) -> None:
    for name in ("smoothed", "abc"):
        write_track(run, track_of(name))
    (run.folder / "tracks" / "no name.npz").write_bytes(b"")
    assert track_names(run) == ("raw", "abc", "smoothed")


def test_raw_and_taken_names_are_refused(run: StoredRun) -> None:
    for name in ("raw", "RAW", "../raw", "con"):
        with pytest.raises(SessionError):
            write_track(run, track_of(name))
    write_track(run, track_of("refined"))
    with pytest.raises(SessionError, match="already"):
        write_track(run, track_of("refined", (0, 1)))
    write_track(run, track_of("refined", (0, 1)), replace=True)
    assert len(read_track(run, "refined").frames) == 2


def test_arrays_that_do_not_fit_are_refused(run: StoredRun) -> None:
    good = track_of("made")
    spoilt = (
        dataclasses.replace(good, poses=good.poses[:, :3]),
        dataclasses.replace(good, poses=good.poses[:2]),
        dataclasses.replace(good, frames=np.array([0, 5, 1])),
        dataclasses.replace(good, states=("tracked", "", "gone")),
        dataclasses.replace(good, poses=np.full((3, 4), np.nan)),
        dataclasses.replace(good, confidence=np.ones(2)),
    )
    for track in spoilt:
        with pytest.raises(SessionError, match="does not fit"):
            write_track(run, track)
    assert track_names(run) == ("raw",)


def test_a_track_that_the_disk_refuses_is_named(run: StoredRun) -> None:
    with (
        mock.patch.object(os, "mkdir", side_effect=PermissionError(errno.EACCES, "Permission denied")),
        pytest.raises(SessionError, match=r"The track .* cannot be written"),
    ):
        write_track(run, track_of("smoothed"))


def test_missing_and_damaged_tracks_are_named(run: StoredRun) -> None:
    with pytest.raises(NotFoundError, match="no track 'refined'"):
        read_track(run, "refined")
    path = write_track(run, track_of("refined"))
    whole = path.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"", b"not an archive"):
        path.write_bytes(damaged)
        with pytest.raises(SessionError, match="is not the track 'refined' of run"):
            read_track(run, "refined")


def test_stretches_are_rows_without_a_gap() -> None:
    assert consecutive(np.array([2, 3, 4, 7, 9, 10])) == (slice(0, 3), slice(3, 4), slice(4, 6))
    assert consecutive(np.zeros(0, dtype=np.int64)) == ()


def made_of(run: StoredRun, source: str, name: str, shift: float = 0.0) -> Track:
    """A track made of another, as refining and smoothing make theirs."""
    track = read_track(run, source)
    made_by = {"verb": "made", "from": source, "from_digest": track_digest(track)}
    made = dataclasses.replace(track, name=name, poses=track.poses + shift, made_by=made_by)
    write_track(run, made, replace=True)
    return made


def test_the_best_track_is_the_smoothed_else_the_refined_else_the_raw(run: StoredRun) -> None:
    assert best_track(run) == BestTrack("raw")
    made_of(run, "raw", "mine")
    assert best_track(run).name == "raw"
    made_of(run, "raw", "refined")
    assert best_track(run) == BestTrack("refined")
    made_of(run, "refined", "smoothed", 0.1)
    assert best_track(run) == BestTrack("smoothed")
    assert best_track(run).note == ""
    assert np.array_equal(read_track(run, BEST).poses, read_track(run, "smoothed").poses)


def test_a_track_of_what_has_changed_since_is_passed_over_and_named(run: StoredRun) -> None:
    made_of(run, "raw", "refined")
    made_of(run, "refined", "smoothed")
    made_of(run, "raw", "refined", 0.2)
    assert best_track(run) == BestTrack("refined", ("smoothed",))
    assert "'smoothed' was made before" in best_track(run).note

    writer = ResultsWriter(run.folder)
    writer.write_frame(result_of(3), [layer_of(3, 0)], True)
    writer.close()
    assert best_track(run) == BestTrack("raw", ("smoothed", "refined"))
    assert "'smoothed' and 'refined' were made before" in best_track(run).note


def test_a_track_that_kept_no_digest_counts_to_the_end_of_the_run(run: StoredRun) -> None:
    write_track(run, track_of("smoothed", frames=(0, 1, 2)))
    assert best_track(run).name == "smoothed"
    write_track(run, track_of("smoothed", frames=(0, 1)), replace=True)
    assert best_track(run) == BestTrack("raw", ("smoothed",))


def test_no_track_is_called_best(run: StoredRun) -> None:
    with pytest.raises(SessionError, match="best"):
        write_track(run, track_of("best"))
