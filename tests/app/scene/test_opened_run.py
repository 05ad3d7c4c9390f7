"""What there is to draw of a stored run, a search in progress, a what-if and a track."""

import dataclasses

import numpy as np
from swaying_session import LAYERS, cloud_record, frame_result, swaying_pose

from studio.app.scene.model import LiveSearch
from studio.app.scene.opened_run import OpenedRun
from studio.body.model import BodyModel
from studio.runs.tracks import Track, read_track, write_track
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

NOTHING = LiveSearch()


def test_moments(stored: tuple[Session, StoredRun], human: BodyModel) -> None:
    opened = OpenedRun(*stored)
    plain = opened.moment(2, NOTHING)
    np.testing.assert_array_equal(plain.pose, swaying_pose(human, 2))
    assert (plain.beside, plain.layer_count, len(plain.records)) == (None, LAYERS, LAYERS)
    assert plain.truth is not None
    assert opened.truth_at(99) is None
    what_if = LiveSearch(2, True, (cloud_record(human, 2, 0),), frame_result(human, 2, 80.0))
    beside = opened.moment(2, what_if)
    np.testing.assert_array_equal(beside.beside, swaying_pose(human, 2))
    assert opened.moment(1, what_if).beside is None
    making = opened.moment(5, LiveSearch(5, False, (cloud_record(human, 5, 1),)), layers=7)
    assert (len(making.records), making.layer_count) == (1, 7)
    edited = opened.moment(2, what_if, edited=human.neutral)
    np.testing.assert_array_equal(edited.pose, human.neutral)
    assert (len(edited.records), edited.edited) == (0, True)
    alone = opened.moment(None, NOTHING, layers=3)
    np.testing.assert_array_equal(alone.pose, swaying_pose(human, 0))
    assert (alone.records, alone.truth, alone.layer_count) == ((), None, 3)
    opened.close()


def test_another_track_is_drawn_with_the_search_beside_it(stored: tuple[Session, StoredRun]) -> None:
    session, run = stored
    opened = OpenedRun(session, run)
    raw = read_track(run)
    assert opened.tracks() == ("raw",)
    assert opened.moment(1, NOTHING, track="smoothed").beside is None
    made = Track(
        "smoothed", raw.frames[:2], raw.poses[:2] + 0.5, raw.confidence[:2], raw.states[:2], {"verb": "test"}
    )
    write_track(run, made)
    assert opened.tracks() == ("raw", "smoothed")
    moment = opened.moment(1, NOTHING, track="smoothed")
    np.testing.assert_array_equal(moment.pose, raw.poses[1] + 0.5)
    np.testing.assert_array_equal(moment.beside, raw.poses[1])
    np.testing.assert_array_equal(opened.moment(2, NOTHING, track="smoothed").pose, raw.poses[2])
    write_track(run, dataclasses.replace(made, poses=raw.poses[:2] + 0.7), replace=True)
    np.testing.assert_array_equal(opened.moment(1, NOTHING, track="smoothed").pose, raw.poses[1] + 0.7)
    # Of a track as of the search's own poses, those between two frames.
    for track, poses in (("raw", raw.poses), ("smoothed", raw.poses[:2] + 0.7)):
        frames, found = opened.poses(track, (1, 3))
        assert frames.tolist() == list(range(1, min(len(poses), 4)))
        np.testing.assert_array_equal(found, poses[1:4])
        assert not len(opened.poses(track, (40, 50))[0])
    opened.close()
