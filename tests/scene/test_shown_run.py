"""One opened run in the scene: which frames it knows of."""

import dataclasses

import numpy as np
from swaying_session import FRAMES, LAYERS, cloud_record, frame_result

from studio.body.model import BodyModel
from studio.runs.tracks import Track, read_track, write_track
from studio.scene.guarded_server import GuardedServer
from studio.scene.live_search import LiveSearch
from studio.scene.moment import moment_of
from studio.scene.opened_run import OpenedRun
from studio.scene.scene_drawing import SceneDrawing
from studio.scene.shown_run import ShownRun
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


def test_a_frame_that_was_not_heard_of_is_known_with_the_next(
    server: GuardedServer, stored: tuple[Session, StoredRun], human: BodyModel
) -> None:
    opened = OpenedRun(*stored)
    shown = ShownRun(SceneDrawing(server, opened, True), opened)
    assert shown.frames == tuple(range(FRAMES - 1))
    shown.frames = shown.frames[:2]
    shown.frame_finished(2)
    assert shown.frames == (0, 1, 2)
    with ResultsWriter(stored[1].folder) as writer:
        writer.write_frame(
            frame_result(human, FRAMES - 1),
            [cloud_record(human, FRAMES - 1, layer) for layer in range(LAYERS)],
        )
    shown.frame_finished(FRAMES - 1)
    assert shown.frames == tuple(range(FRAMES)), "frames 3 and 4 are in the store"
    shown.close()


def test_another_track_is_drawn_with_the_search_beside_it(stored: tuple[Session, StoredRun]) -> None:
    session, run = stored
    opened, live = OpenedRun(session, run), LiveSearch()
    raw = read_track(run)
    assert opened.tracks() == ("raw",)
    assert moment_of(opened, 1, live, track="smoothed").beside is None
    made = Track(
        "smoothed", raw.frames[:2], raw.poses[:2] + 0.5, raw.confidence[:2], raw.states[:2], {"verb": "test"}
    )
    write_track(run, made)
    assert opened.tracks() == ("raw", "smoothed")
    moment = moment_of(opened, 1, live, track="smoothed")
    assert moment.pose is not None
    assert moment.beside is not None
    assert np.array_equal(moment.pose, raw.poses[1] + 0.5)
    assert np.array_equal(moment.beside, raw.poses[1])
    in_a_gap = moment_of(opened, 2, live, track="smoothed")
    assert in_a_gap.pose is not None
    assert np.array_equal(in_a_gap.pose, raw.poses[2])
    write_track(run, dataclasses.replace(made, poses=raw.poses[:2] + 0.7), replace=True)
    again = moment_of(opened, 1, live, track="smoothed").pose
    assert again is not None
    assert np.array_equal(again, raw.poses[1] + 0.7)
    opened.close()
