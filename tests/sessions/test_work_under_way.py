"""What goes on in a session keeps it where it is, and what others changed meanwhile is not written over."""

import shutil
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec
import numpy as np
import pytest
from toy_footage import write_video
from toy_session import make_session, true_poses

import studio
from studio.foundations.errors import FootageError, NotFoundError, RunError, SessionError
from studio.operations import footage, own_bodies, subjects
from studio.operations.comparison_folders import new_comparison, place_of
from studio.results.comparison.sweep import plan_sweep
from studio.results.verifying import verify
from studio.runs.new_run import prepare_run
from studio.runs.notes import notes_of, write_note
from studio.runs.setup import background_setup
from studio.runs.setup.initialising import InitialPose, keep_pose
from studio.sessions import atomic_files, background_files, calibration_changes, work_under_way
from studio.sessions import workspace as workspace_module
from studio.sessions.atomic_files import NameTakenError
from studio.sessions.background_files import use_masks
from studio.sessions.calibration_changes import (
    EARLIER,
    NewCalibration,
    replace_calibration,
    restore_calibration,
)
from studio.sessions.footage_changes import change_footage
from studio.sessions.importers import importing
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session, redescribe
from studio.sessions.stored_run import StoredRun
from studio.sessions.work_under_way import one_at_a_time, under_way, working_on
from studio.sessions.workspace import VARIABLE, Workspace

START = true_poses()[0]


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return make_session(tmp_path / "toy", 3)


@pytest.fixture
def run(session: Session) -> StoredRun:
    return prepare_run(session, name="one", start_pose=START)


@pytest.fixture
def workspace(session: Session, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    monkeypatch.setenv(VARIABLE, str(session.path.parent))
    return Workspace(session.path.parent)


def test_a_session_that_is_worked_on_is_not_moved_and_the_work_is_named(
    workspace: Workspace, run: StoredRun
) -> None:
    other = prepare_run(workspace.session("toy"), name="two", start_pose=START)
    moves = (
        lambda: workspace.rename("toy", "new"),
        lambda: workspace.trash("toy"),
        lambda: workspace.trash_run("toy", "one"),
        lambda: workspace.rename_run("toy", "one", "new"),
    )
    with working_on(workspace.root / "toy", "refine", "one"):
        for move in moves:
            with pytest.raises(
                RunError, match=r"Session 'toy' stays as it is while 'refine' works on run 'one'"
            ):
                move()
        workspace.trash_run("toy", other.name)
    assert not list(under_way(workspace.root / "toy"))
    moves[3]()
    moves[0]()
    assert [one.name for one in workspace.session("new").runs()] == ["new"]


def test_footage_is_not_replaced_under_work_that_reads_it(workspace: Workspace, tmp_path: Path) -> None:
    session = workspace.session("toy")
    source = tmp_path / "again"
    for part in ("pictures", "calibration"):
        shutil.copytree(session.path / part, source / part)
    before = session.manifest
    with (
        ThreadPoolExecutor(1) as other,
        working_on(session.path, "view"),
        pytest.raises(RunError, match="Session 'toy' keeps its footage while 'view' works on it"),
    ):
        other.submit(studio.add_footage, "toy", source, replace=True, fps=60.0).result()
    assert workspace.session("toy").manifest == before
    # Its own work is no other's.
    studio.add_footage("toy", source, replace=True, fps=60.0)
    assert workspace.session("toy").manifest != before


def test_work_on_a_session_that_was_moved_says_so(workspace: Workspace, run: StoredRun) -> None:
    opened = workspace.session("toy")
    workspace.rename("toy", "new")
    for work in (
        lambda: studio.note(run, 0, "a"),
        lambda: studio.background(opened, "masks"),
        lambda: redescribe(opened, opened.manifest),
    ):
        with pytest.raises(NotFoundError, match=r"toy|one"):
            work()
    with (
        pytest.raises(NotFoundError, match="'toy' was renamed or deleted meanwhile"),
        working_on(opened.path, "x"),
    ):
        pass
    assert sorted(path.name for path in workspace.root.iterdir()) == [work_under_way.STATE_NAME, "new"]


def test_what_died_without_saying_so_keeps_nothing(workspace: Workspace, session: Session) -> None:
    with working_on(session.path, "refine"):
        (at,) = workspace.root.glob(f"{work_under_way.STATE_NAME}/*/toy,*")
    at.touch()
    workspace.rename("toy", "new")
    assert not at.exists()


def test_a_move_waits_for_who_begins_and_who_begins_for_a_move(session: Session) -> None:
    moved, entered = threading.Event(), threading.Event()

    def begin() -> None:
        moved.wait()
        with working_on(session.path, "refine"):
            entered.set()

    with ThreadPoolExecutor(1) as threads:
        with one_at_a_time(session.path), one_at_a_time(session.path):
            began = threads.submit(begin)
            moved.set()
            assert not entered.wait(0.2)
        began.result()


def test_who_keeps_the_turn_for_good_is_waited_for_no_longer(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work_under_way, "PATIENCE", 0.05)

    def begin() -> None:
        with working_on(session.path, "refine"):
            pass

    with (
        one_at_a_time(session.path),
        ThreadPoolExecutor(1) as threads,
        pytest.raises(RunError, match="sessions beside 'toy'"),
    ):
        threads.submit(begin).result()


def test_a_store_is_not_opened_while_its_run_is_moved(workspace: Workspace, run: StoredRun) -> None:
    def write() -> None:
        ResultsWriter(run.folder).close()

    with ThreadPoolExecutor(1) as threads:
        with one_at_a_time(workspace.root / "toy"):
            writing = threads.submit(write)
            workspace.rename_run("toy", "one", "new")
        with pytest.raises(NotFoundError, match="Run 'one' of session 'toy' was renamed or deleted"):
            writing.result()


# ---------------------------------------------------------------------- two who change the same session


def test_what_others_changed_in_a_description_stays(workspace: Workspace) -> None:
    opened = workspace.session("toy")
    workspace.retitle("toy", "Another title")
    changed = redescribe(opened, msgspec.structs.replace(opened.manifest, notes=("a note",)))
    assert (changed.manifest.title, changed.manifest.notes) == ("Another title", ("a note",))


def test_who_changes_what_others_have_changed_is_refused_before_anything_is_written(
    workspace: Workspace,
) -> None:
    opened = workspace.session("toy")
    change_footage(opened, rotations={"front": 180})
    with pytest.raises(SessionError, match="footage of session 'toy' was changed by other work"):
        use_masks(opened, {"front": ""})
    cameras = opened.cameras()
    replace_calibration(workspace.session("toy"), NewCalibration(cameras, "one"))
    now = workspace.session("toy")
    replace_calibration(now, NewCalibration(cameras, "two"))
    kept = len(list((opened.path / "calibration" / EARLIER).iterdir()))
    with pytest.raises(SessionError, match="calibration of session 'toy' was changed"):
        replace_calibration(now, NewCalibration(cameras, "three"))
    assert len(list((opened.path / "calibration" / EARLIER).iterdir())) == kept
    assert workspace.session("toy").manifest.calibration_source == "two"


def test_what_is_replaced_or_renamed_on_purpose_is_no_damage(
    workspace: Workspace, run: StoredRun, tmp_path: Path
) -> None:
    session = workspace.session("toy")
    (session.path / "calibration" / "original.toml").write_text("of another program")
    assert not verify(session).faults
    source = tmp_path / "source"
    shutil.copytree(session.path / "calibration", source / "calibration")
    shutil.copytree(session.path / "pictures" / "front", source / "front")
    replace_calibration(session, NewCalibration(session.cameras(), "one"))
    studio.add_footage("toy", source, replace=True, fps=60.0)
    workspace.rename_run("toy", "one", "new")
    trashed = workspace.trash_run("toy", "new").name
    prepare_run(workspace.session("toy"), name="new", start_pose=START)
    assert workspace.restore_run(trashed).name == "new-2"
    assert not (session.path / "pictures" / "front").exists()
    assert not verify(workspace.session("toy")).faults


def test_notes_of_two_at_once_are_both_kept(run: StoredRun) -> None:
    with ThreadPoolExecutor(3) as threads:
        list(threads.map(lambda number: write_note(run, number % 3, f"note {number}"), range(30)))
    assert [note.frame for note in notes_of(run)] == [0, 1, 2]


def test_of_start_poses_at_once_every_one_is_kept(session: Session) -> None:
    names = tuple(entry.name for entry in session.body().parameters)
    found = [
        InitialPose(0, "planar_arm4", names, START + number / 100, 0.9, 1.0, None, 1.0, 0.9, 0.0, 100, "")
        for number in range(6)
    ]
    with ThreadPoolExecutor(6) as threads:
        list(threads.map(lambda pose: keep_pose(session, pose, replace=True), found))
    assert len({path.read_bytes() for path in session.path.glob("start_pose*.csv")}) == 6


def test_runs_without_a_name_that_are_made_at_once_are_all_made(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepare_run(session, start_pose=START)
    names = iter(["run-1", "run-2"])
    monkeypatch.setattr("studio.runs.new_run.free_run_name", lambda _: next(names))
    monkeypatch.setattr("studio.sessions.session.free_run_name", lambda _: next(names))
    assert prepare_run(session, start_pose=START).name == "run-2"
    with pytest.raises(NameTakenError, match="has a run 'run-1'"):
        prepare_run(session, start_pose=START, name="run-1")


def test_a_place_that_another_took_meanwhile_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "there" / "a file").mkdir(parents=True)
    monkeypatch.setattr(Path, "exists", lambda _: False)
    with pytest.raises(NameTakenError, match="something at"), atomic_files.made_whole(tmp_path / "there"):
        pass


def test_a_file_whose_folder_is_gone_is_no_matter_of_disk_space(tmp_path: Path) -> None:
    for write in (
        lambda: atomic_files.write_text(tmp_path / "gone" / "a.txt", "a"),
        lambda: ResultsWriter(tmp_path / "gone").close(),
    ):
        with pytest.raises(NotFoundError, match="no longer there") as refused:
            write()
        assert "disk" not in str(refused.value)


def test_a_file_is_kept_beside_before_it_changes(tmp_path: Path) -> None:
    own = tmp_path / "own.csv"
    atomic_files.keep_before(own)
    for text in ("a", "b", "c"):
        atomic_files.write_text(own, text)
        atomic_files.keep_before(own)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "own-before-2.csv",
        "own-before-3.csv",
        "own-before.csv",
        "own.csv",
    ]
    assert (tmp_path / "own-before-3.csv").read_text() == "c"


@pytest.mark.parametrize("moment", ["write_run_record", "note_again"])
def test_a_rename_or_a_return_that_is_killed_leaves_no_damage(
    workspace: Workspace, run: StoredRun, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    session = workspace.session("toy")
    assert not verify(session).faults

    def die(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as killed:
        killed.setattr(workspace_module, moment, die)
        with pytest.raises(KeyboardInterrupt):
            workspace.rename_run("toy", "one", "new")
    assert not verify(session).faults
    trashed = workspace.trash_run("toy", "new")
    session.path.joinpath("runs", "new").mkdir()
    with monkeypatch.context() as killed:
        killed.setattr(workspace_module, moment, die)
        with pytest.raises(KeyboardInterrupt):
            workspace.restore_run(trashed.name)
    session.path.joinpath("runs", "new").rmdir()
    workspace.restore_run(trashed.name)
    assert not verify(session).faults


def test_nobody_comes_between_the_parts_of_a_calibration_that_is_put_back(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    cameras = tuple(session.cameras())
    change = replace_calibration(session, NewCalibration(cameras, "again"))
    monkeypatch.setattr(work_under_way, "PATIENCE", 0.05)
    words: list[str] = []
    parts = calibration_changes.stale_runs

    def between(opened: Session) -> tuple[str, ...]:
        with ThreadPoolExecutor(1) as threads:
            try:
                threads.submit(replace_calibration, opened, NewCalibration(cameras, "third")).result()
            except RunError as error:
                words.append(str(error))
        return parts(opened)

    monkeypatch.setattr(calibration_changes, "stale_runs", between)
    restore_calibration(change.session, change.kept.name, "first")
    # Once for the cameras, and once more after the other parts.
    assert len(words) == 2
    assert Session(session.path).manifest.calibration_source == "first"


def test_what_a_moved_session_no_longer_has_is_not_said_to_be_missing(
    workspace: Workspace, session: Session
) -> None:
    workspace.rename("toy", "new")
    with pytest.raises(NotFoundError, match="renamed meanwhile"):
        session.footage()


def test_no_comparison_begins_where_a_session_was(workspace: Workspace, session: Session) -> None:
    plan = plan_sweep(session, {"survival": [0.4]}, range(1), last=1, fit_shape=False)
    workspace.rename("toy", "new")
    with pytest.raises(NotFoundError, match="Session 'toy' was renamed or deleted meanwhile"):
        new_comparison(place_of(session, "one"), plan, session)
    assert not session.path.exists()


def test_sessions_that_are_tracked_together_all_stay_where_they_are(
    workspace: Workspace, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_session(workspace.root / "other", 3)
    monkeypatch.setattr(subjects, "track_together", lambda *_: workspace.rename("other", "new"))
    with pytest.raises(RunError, match="Session 'other' stays as it is while 'together' works on it"):
        studio.together("toy", ["other"])


def test_a_session_that_a_verb_takes_beside_its_own_stays_where_it_is(
    workspace: Workspace, session: Session, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    clip = write_video(tmp_path / "front.mp4", [np.zeros((120, 160, 3), np.uint8)] * 4, fps=30)
    for room, step, verb, work in (
        (
            own_bodies,
            "edited",
            "edit_body",
            lambda: studio.edit_body("planar_arm4", session="toy", save_as="arm"),
        ),
        (
            footage,
            "check_cameras",
            "record",
            lambda: studio.record({"front": str(clip)}, "take", "toy", fps=30.0),
        ),
    ):
        monkeypatch.setattr(room, step, lambda *_, **__: workspace.rename("toy", "new"))
        with pytest.raises(RunError, match=f"Session 'toy' stays as it is while '{verb}' works on it"):
            work()
    assert [one.name for one in workspace.sessions()] == ["toy"]


def test_masks_that_cannot_be_set_up_take_back_nothing_of_others(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    def turned_meanwhile(*_: object) -> None:
        change_footage(Session(session.path), rotations={"front": 180})
        raise FootageError("Nothing is to be seen.", "")

    monkeypatch.setattr(background_setup, "_set_up", turned_meanwhile)
    with pytest.raises(FootageError, match="Nothing is to be seen"):
        background_setup.set_up_background(session, "masks")
    assert Session(session.path).manifest.footage.cameras[0].turned == 180


def test_a_session_that_is_imported_from_stays_where_it_is(
    workspace: Workspace, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_session(workspace.root / "other", 3)
    monkeypatch.setattr(importing, "_plan", lambda *_, **__: workspace.rename("toy", "new"))
    for work in (
        lambda: studio.import_footage(session.path, "again"),
        lambda: studio.add_footage("other", session.path, replace=True),
    ):
        with pytest.raises(RunError, match="Session 'toy' stays as it is while 'import' works on it"):
            work()


def test_entries_of_a_masks_record_that_others_change_meanwhile_are_kept(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever reads the record to change it keeps all others out until it is written."""
    reading, go_on, known = threading.Event(), threading.Event(), background_files.read_evidence

    def read_slowly(one: Session) -> background_files.SessionEvidence:
        found = known(one)
        if threading.current_thread().name == "slow":
            reading.set()
            go_on.wait(10.0)
        return found

    monkeypatch.setattr(background_files, "read_evidence", read_slowly)
    slow = threading.Thread(
        name="slow",
        target=background_files.change_evidence,
        args=(session,),
        kwargs={"given": {"cam1": "a.png"}},
    )
    other = threading.Thread(
        target=background_files.change_evidence, args=(session,), kwargs={"knobs": {"n": 1}}
    )
    slow.start()
    assert reading.wait(10.0)
    other.start()
    other.join(0.3)
    go_on.set()
    slow.join()
    other.join()
    kept = known(session)
    assert (kept.given, kept.knobs) == ({"cam1": "a.png"}, {"n": 1})
