"""A disk that fills, at whichever statement, leaves a run that goes on bit for bit once there is room."""

import contextlib
import sqlite3
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from full_disk import BEFORE, ROLLED_BACK, STUCK, WAYS, break_at, refusals
from live_driving import driving, live_run
from toy_session import FPS, true_poses
from tracked_runs import finish, opened, poses_of

from studio.foundations.errors import SessionError
from studio.runs.live.live_replay import compare, prepare_replay, replay
from studio.runs.new_run import prepare_run
from studio.runs.problem_source import ProblemSource
from studio.runs.reannealing import Reannealing
from studio.runs.run_footage import footage_of
from studio.runs.storing_behind import StoringBehind
from studio.runs.tracking_run import TrackingRun
from studio.search.settings import changed_settings
from studio.sessions.results_codec import particle_arrays
from studio.sessions.results_store import FILE_NAME
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

QUICK = {"particles": 20, "layers": 2, "start_repeats": 2}
LAST = 3
FRAME = 1.0 / FPS


def new_run(session: Session, name: str) -> StoredRun:
    start = true_poses()[0] + 0.02
    return prepare_run(session, name=name, seed=7, start_pose=start, last=LAST, knobs=QUICK)


def content(run: StoredRun) -> list[bytes]:
    """All numbers of a run's results but the times that it took."""
    with run.results() as results:
        found = [results.poses()[1].tobytes()]
        for frame in results.frames():
            carried = results.result(frame).carried
            assert carried.particles is not None
            found += [values.tobytes() for values in particle_arrays(carried.particles).values()]
            for record in results.layers(frame):
                found += [record.poses.tobytes(), record.log_weights.tobytes(), record.best.tobytes()]
                found.append(repr((record.layer, record.settings_version, record.beta)).encode())
        found.append(repr([(e.version, e.frame, e.layer) for e in results.settings_history()]).encode())
    return found


def track(tracking: TrackingRun) -> None:
    """To the end; in frame 1 the settings change before its second layer."""
    first_version, first = tracking.latest_settings()
    changed = (first_version + 1, changed_settings(first, {"survival": 0.2})) if first_version == 1 else None
    if changed is None:
        tracking.settings_source = tracking.latest_settings
    while not tracking.finished:
        if changed is not None and (tracking.next_frame, tracking.layers_done) == (1, 1):
            tracking.settings_source = lambda: changed
        tracking.step_layer()


def whole_run(session: Session) -> tuple[list[bytes], int]:
    """What an uninterrupted run stores, and by how many statements."""
    run = new_run(session, "whole")
    with opened(session, run) as tracking:
        counting = break_at(tracking._writer, -1)
        track(tracking)
        statements = counting.statements
    return content(run), statements


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_a_run_whose_disk_fills_at_any_statement_is_taken_up_again(
    session_on_disk: Session, way: str
) -> None:
    wanted, statements = whole_run(session_on_disk)
    assert statements > 30
    for number in range(statements):
        run = new_run(session_on_disk, f"{way.replace(' ', '-')}-{number}")
        tracking_on = opened(session_on_disk, run)
        tracking = tracking_on.__enter__()
        fault = break_at(tracking._writer, number, way)
        with pytest.raises(SessionError, match=r"disk full \(database or disk is full\)"):
            track(tracking)
        assert fault.failed
        # There is room for what is smaller than a frame: what is saved now must be of use.
        fault.mend()
        tracking_on.__exit__(None, None, None)
        assert not run.being_tracked()
        with opened(session_on_disk, run) as again:
            track(again)
        assert content(run) == wanted, f"statement {number}"


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_a_run_that_stays_open_goes_on_when_there_is_room(session_on_disk: Session, way: str) -> None:
    wanted, statements = whole_run(session_on_disk)
    for number in range(0, statements, 3):
        run = new_run(session_on_disk, f"{way.replace(' ', '-')}-{number}")
        with opened(session_on_disk, run) as tracking:
            fault = break_at(tracking._writer, number, way)
            # Where the connection is opened anew, or the last frame arrived after all, the second time may go well.
            for _ in range(2 if way in (BEFORE, ROLLED_BACK) else 1):
                with pytest.raises(SessionError, match="disk full"):
                    track(tracking)
                assert not tracking.finished
            fault.mend()
            tracking.mark_going_on()
            track(tracking)
        assert content(run) == wanted, f"statement {number}"


@pytest.mark.parametrize("way", WAYS)
def test_a_frame_that_fails_to_be_stored_behind_the_search_is_tracked_again(
    session_on_disk: Session, way: str
) -> None:
    wanted, statements = whole_run(session_on_disk)
    for number in range(0, statements, 7):
        run = new_run(session_on_disk, f"{way.replace(' ', '-')}-{number}")
        with ThreadPoolExecutor(1) as storing, opened(session_on_disk, run, storing) as tracking:
            fault = break_at(tracking._writer, number, way)
            with pytest.raises(SessionError, match="disk full"):
                track(tracking)
            assert not tracking.finished
            fault.mend()
            # The failure may come after the next frame's new settings, which would hold for this one, too.
            tracking.settings_source = tracking.latest_settings
            tracking.mark_going_on()
            track(tracking)
            assert content(run) == wanted, f"statement {number}: all is stored once it is finished"
        assert content(run) == wanted, f"statement {number}"


def test_the_store_is_behind_the_search_and_readers_of_the_run_wait_for_it(session_on_disk: Session) -> None:
    run, held = new_run(session_on_disk, "behind"), threading.Event()
    with ThreadPoolExecutor(1) as storing, opened(session_on_disk, run, storing) as tracking:
        storing.submit(held.wait)
        while tracking.next_frame == 0:
            tracking.step_layer()
        tracking.step_layer()
        with run.results() as results:
            assert results.frames() == [], "the next frame is searched before this one is stored"
        threading.Timer(0.05, held.set).start()
        assert tracking._reader.frames() == [0]


@pytest.mark.slow
@pytest.mark.parametrize("way", [BEFORE, ROLLED_BACK, STUCK])
def test_a_frame_that_cannot_be_saved_halfway_leaves_what_was_saved_before(
    session_on_disk: Session, way: str
) -> None:
    wanted, _ = whole_run(session_on_disk)
    number, failed = 0, True
    while failed:
        run = new_run(session_on_disk, f"{way.replace(' ', '-')}-{number}")
        finish(session_on_disk, run, layers=5)
        tracking_on = opened(session_on_disk, run)
        tracking = tracking_on.__enter__()
        assert (tracking.next_frame, tracking.layers_done) == (1, 1)
        version, first = tracking.latest_settings()
        following = (version + 1, changed_settings(first, {"survival": 0.2}))
        tracking.settings_source = lambda following=following: following
        # The change of the settings comes first; then the frame is stored, and half of the next one saved.
        fault = break_at(tracking._writer, number, way)
        with refusals():
            for _ in range(2):
                tracking.step_layer()
        with refusals():
            tracking_on.__exit__(None, None, None)
        failed = fault.failed
        assert not run.being_tracked(), "closing frees the run, also where saving fails"
        with opened(session_on_disk, run) as again:
            track(again)
        assert content(run) == wanted, f"statement {number}"
        number += 1
    assert number > 15


@pytest.mark.parametrize("way", [BEFORE, ROLLED_BACK, STUCK])
def test_an_answer_that_cannot_be_kept_changes_nothing(session_on_disk: Session, way: str) -> None:
    run = new_run(session_on_disk, "a")
    finish(session_on_disk, run)
    before = content(run)
    with opened(session_on_disk, run) as tracking:
        settings = changed_settings(tracking.latest_settings()[1], {"survival": 0.2})
        again = Reannealing(tracking, 1, 2, settings)
        while not again.finished:
            again.step_layer()
        number, kept = 0, False
        while not kept:
            fault = break_at(tracking._writer, number, way)
            with refusals() as refused:
                again.keep()
            kept = not refused
            if refused:
                assert content(run) == before, f"statement {number}"
                assert tracking.finished
            fault.mend()
            with tracking._writer.together():
                pass
            if tracking._writer._connection is fault:
                tracking._writer._connection = fault.inner
            number += 1
        assert number > 10
        assert tracking.next_frame == 2
    assert poses_of(run)[-1].tobytes() == again.result().estimate.pose.tobytes()


def in_small_pages(run: StoredRun) -> None:
    """Put the run's store, in which nothing is tracked yet, into pages of 1 KiB: it grows at more places."""
    with contextlib.closing(sqlite3.connect(run.folder / FILE_NAME)) as connection:
        connection.execute("PRAGMA journal_mode = DELETE")
        connection.execute("PRAGMA page_size = 1024")
        connection.execute("VACUUM")
        assert connection.execute("PRAGMA page_size").fetchone() == (1024,)


def test_a_store_that_may_not_grow_is_a_full_disk(session_on_disk: Session) -> None:
    """SQLite's own error, wherever in a frame the pages run out."""
    wanted, _ = whole_run(session_on_disk)
    pages, refused = 0, ["not tried yet"]
    while refused:
        run = new_run(session_on_disk, f"pages-{pages}")
        in_small_pages(run)
        with refusals() as refused, opened(session_on_disk, run) as tracking:
            connection = tracking._writer._connection
            here = connection.execute("PRAGMA page_count").fetchone()[0]
            connection.execute(f"PRAGMA max_page_count = {here + pages}")
            track(tracking)
        with opened(session_on_disk, run) as again:
            assert again.finished != bool(refused)
            track(again)
        assert content(run) == wanted, f"{pages} pages"
        pages += 1
    assert pages > 12


def test_a_finished_search_that_an_older_studio_saved_is_searched_again(session_on_disk: Session) -> None:
    """Such a store said "Frame 1 has no layer left" for ever."""
    wanted = finish(session_on_disk, new_run(session_on_disk, "whole"))
    run = new_run(session_on_disk, "a")
    with opened(session_on_disk, run) as tracking:
        while (tracking.next_frame, tracking.layers_done) != (1, 1):
            tracking.step_layer()
        fault = break_at(tracking._writer, 5)
        with pytest.raises(SessionError, match="disk full"):
            tracking.step_layer()
        fault.mend()
        tracking._astray = False
        tracking.save()
    with run.results() as results:
        partial = results.partial()
        assert (partial.frame, partial.next_layer) == (1, 2)
    assert np.array_equal(finish(session_on_disk, run), wanted)


def test_a_run_whose_first_settings_cannot_be_stored_is_free_again(
    session_on_disk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = new_run(session_on_disk, "a")

    def refuse(*_: object) -> None:
        raise SessionError("disk full")

    with monkeypatch.context() as patched:
        patched.setattr("studio.sessions.results_store.ResultsWriter.write_settings", refuse)
        with pytest.raises(SessionError), opened(session_on_disk, run):
            pass
    assert not run.being_tracked()


# ---------------------------------------------------------------------- live


@pytest.fixture
def one_thread() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(1) as executor:
        yield executor


def test_what_follows_from_what_failed_is_not_done(one_thread: ThreadPoolExecutor) -> None:
    done: list[int] = []
    behind = StoringBehind(one_thread)

    def fail() -> None:
        raise SessionError("disk full")

    with refusals() as refused:
        for action in (lambda: done.append(0), fail, lambda: done.append(2), lambda: done.append(3)):
            behind.do(action)
        behind.wait()
    assert refused
    behind.wait()
    assert done == [0]
    behind.do(lambda: done.append(4))
    behind.wait()
    assert done == [0, 4]


@pytest.mark.slow
def test_a_live_run_drops_what_the_disk_refuses_and_replays(
    session_on_disk: Session, one_thread: ThreadPoolExecutor
) -> None:
    """Frames are stored behind the search: none may be kept that followed from one that was not."""
    for number in range(3, 40, 4):
        run = live_run(session_on_disk, f"live-{number}")
        with driving(session_on_disk, run) as drive:
            drive.run._behind = StoringBehind(one_thread)
            fault = break_at(drive.run._writer, number, ROLLED_BACK)
            with pytest.raises(SessionError, match="disk full"):
                drive.to_end(0.4 * FRAME)
            assert not drive.run.finished
            fault.mend()
            drive.run.mark_going_on()
            drive.to_end(0.4 * FRAME)
            assert drive.run.finished
            drive.run.save()
        assert run.summary().status == "finished"
        again = prepare_replay(session_on_disk, run, f"again-{number}")
        problems = ProblemSource(
            session_on_disk, again.body(), again.cameras(), footage=footage_of(session_on_disk, again)
        )
        list(replay(run, again, problems))
        problems.close()
        same = compare(run, again)
        assert same.different == ()
        with run.results() as results:
            assert same.frames == len(results.frames()) > 0
