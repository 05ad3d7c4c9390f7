"""Listing, renaming, copying, throwing away."""

from pathlib import Path

import av
import numpy as np
import pytest
from store_records import layer_of, record_of, result_of
from toy_session import make_session

from studio.foundations.errors import NotFoundError, SessionError
from studio.sessions import workspace as workspace_module
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session, free_run_name, jpeg
from studio.sessions.workspace import Workspace, workspace_root


def test_the_workspace_is_where_the_variable_says(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path / "w"))
    assert workspace_root() == tmp_path / "w"
    monkeypatch.setenv("STUDIO_WORKSPACE", " ")
    assert workspace_root().name == "workspace"
    assert Workspace(tmp_path / "none").sessions() == ()


def test_sessions_are_found_by_name_and_by_path(session_on_disk: Session, tmp_path: Path) -> None:
    workspace = Workspace()
    assert workspace.session("toy").path == session_on_disk.path
    assert workspace.resolve("toy").path == session_on_disk.path
    elsewhere = make_session(tmp_path / "else where", frames=3)
    assert workspace.resolve(tmp_path / "else where").path == elsewhere.path
    for wrong in ("none", "../toy", str(tmp_path / "no"), "a\0b"):
        with pytest.raises(SessionError):
            workspace.resolve(wrong)
    with pytest.raises(NotFoundError):
        workspace.session("none")


def test_places_for_new_sessions(session_on_disk: Session, tmp_path: Path) -> None:
    workspace = Workspace()
    assert workspace.place_for("fresh") == workspace.root / "fresh"
    assert workspace.place_for(tmp_path / "fresh") == tmp_path / "fresh"
    for wrong in ("toy", "no spaces", "con", str(tmp_path / "bad name")):
        with pytest.raises(SessionError):
            workspace.place_for(wrong)


def test_rename(session_on_disk: Session) -> None:
    workspace = Workspace()
    renamed = workspace.rename("toy", "arm")
    assert renamed.name == renamed.manifest.name == "arm"
    assert [entry.name for entry in workspace.sessions()] == ["arm"]
    make_session(workspace.place_for("other"), frames=3)
    with pytest.raises(SessionError, match="already"):
        workspace.rename("other", "ARM")
    with pytest.raises(SessionError):
        workspace.rename("other", "../other")
    assert workspace.retitle("arm", "  A  new title ").manifest.title == "A new title"


def test_a_duplicate_has_everything_and_shares_nothing(session_on_disk: Session) -> None:
    workspace = Workspace()
    run = session_on_disk.new_run(record_of(session_on_disk, "first"))
    with ResultsWriter(run.folder) as writer:
        writer.write_frame(result_of(0), [layer_of(0, 0)])
        copy = workspace.duplicate("toy")
    assert copy.name == "toy-2"
    assert copy.manifest.title == "Toy arm (copy)"
    with copy.run("first").results() as results:
        assert results.frames() == [0]
    assert np.array_equal(copy.footage().picture("front", 3), session_on_disk.footage().picture("front", 3))
    copied_run = copy.run("first")
    with ResultsWriter(copied_run.folder) as writer:
        writer.write_frame(result_of(1), [])
    with run.results() as results:
        assert results.frames() == [0]


def test_a_duplicate_of_what_other_work_changes_meanwhile_says_so(
    session_on_disk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    alignment = session_on_disk.path / "calibration" / "zz.alignment.json"
    alignment.write_text("{}")

    def goes_once_listed(folder: str, _names: list[str]) -> set[str]:
        if Path(folder) == alignment.parent:
            alignment.unlink()
        return set()

    monkeypatch.setattr(workspace_module, "_transient", goes_once_listed)
    with pytest.raises(SessionError, match=r"'toy' was changed by other work .*zz\.alignment\.json") as no:
        Workspace().duplicate("toy")
    assert no.value.hint.startswith("Do this again")
    assert [session.name for session in Workspace().sessions()] == ["toy"]


def test_thrown_away_and_brought_back(session_on_disk: Session) -> None:
    workspace = Workspace()
    place = workspace.trash("toy")
    assert workspace.sessions() == ()
    assert workspace.trashed() == (place.name,)
    make_session(workspace.place_for("toy"), frames=3)
    assert workspace.restore(place.name).name == "toy-2"
    with pytest.raises(NotFoundError):
        workspace.restore(place.name)


def test_what_is_being_tracked_stays(session_on_disk: Session) -> None:
    workspace = Workspace()
    run = session_on_disk.new_run(record_of(session_on_disk, "first"))
    assert run.summary().status == "new"
    with ResultsWriter(run.folder):
        assert run.summary().status == "tracking"
        for forbidden in (
            lambda: workspace.trash("toy"),
            lambda: workspace.rename("toy", "arm"),
            lambda: workspace.trash_run("toy", "first"),
        ):
            with pytest.raises(SessionError, match="being tracked"):
                forbidden()
    workspace.trash_run("toy", "first")
    assert session_on_disk.runs() == ()


def test_a_runs_status_follows_from_its_store(session_on_disk: Session) -> None:
    run = session_on_disk.new_run(record_of(session_on_disk, "first"))
    with ResultsWriter(run.folder) as writer:
        for frame in range(3):
            writer.write_frame(result_of(frame), [])
    assert (run.summary().status, run.summary().done, run.summary().tracked_to) == ("interrupted", 3, 3)
    with ResultsWriter(run.folder) as writer:
        writer.mark_ended("cancelled")
    assert run.summary().status == "cancelled"
    with ResultsWriter(run.folder) as writer:
        for frame in range(3, 8):
            writer.write_frame(result_of(frame), [])
    assert run.summary().status == "finished"


def test_a_damaged_run_does_not_hide_the_others(session_on_disk: Session) -> None:
    for name in ("first", "second"):
        session_on_disk.new_run(record_of(session_on_disk, name))
    (session_on_disk.path / "runs" / "first" / "results.sqlite").write_bytes(b"broken" * 1000)
    (entry,) = Workspace().sessions()
    assert {run.name: run.status for run in entry.runs} == {"first": "damaged", "second": "new"}


def test_a_session_gives_what_lies_in_it(session_on_disk: Session) -> None:
    session = session_on_disk
    assert [camera.name for camera in session.cameras()] == ["front"]
    assert session.body().name == "planar_arm4"
    assert session.start_pose() is None
    assert session.sigma(60.0) is None
    assert session.truth_path is None
    assert session.subject() is None
    run = session.new_run(record_of(session, free_run_name(session)))
    assert run.name == "run-1"
    assert free_run_name(session) == "run-2"
    with pytest.raises(SessionError, match="has a run"):
        session.new_run(record_of(session, "run-1"))
    assert run.body().dimensions == session.body().dimensions
    assert run.cameras()[0].name == "front"
    with pytest.raises(NotFoundError):
        session.run("none")
    with pytest.raises(SessionError):
        session.run("../..")


def test_thumbnail_is_the_middle_frame(session_on_disk: Session) -> None:
    path = session_on_disk.thumbnail()
    assert path is not None
    with av.open(str(path)) as opened:
        shown = next(opened.decode(video=0)).to_ndarray(format="bgr24").astype(int)
    picture = session_on_disk.footage().picture("front", 4).astype(int)
    assert shown.shape == picture.shape
    assert np.abs(shown - picture).mean() < 6.0


@pytest.mark.parametrize(
    ("size", "shown"), [((480, 640), (240, 320)), ((1080, 720), (320, 214)), ((7, 9), (8, 8))]
)
def test_pictures_are_shrunk_to_even_sides(
    size: tuple[int, int], shown: tuple[int, int], tmp_path: Path
) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(jpeg(np.full((*size, 3), 128, np.uint8)))
    with av.open(str(path)) as opened:
        frame = next(opened.decode(video=0))
    assert (frame.height, frame.width) == shown


@pytest.fixture
def two_sessions(session_on_disk: Session) -> Workspace:
    session_on_disk.new_run(record_of(session_on_disk, "first"))
    session_on_disk.new_run(record_of(session_on_disk, "second"))
    made = Workspace()
    make_session(made.place_for("other"), frames=3)
    return made


def test_lists_follow_what_happens_to_the_folders(two_sessions: Workspace) -> None:
    two_sessions.sessions()
    two_sessions.retitle("toy", "Another title")
    two_sessions.trash_run("toy", "first")
    two_sessions.trash("other")
    (found,) = two_sessions.sessions()
    assert found.title == "Another title"
    assert [run.name for run in found.runs] == ["second"]


def test_a_broken_manifest_is_listed_with_its_reason(two_sessions: Workspace) -> None:
    (two_sessions.root / "other" / "session.json").write_text("{")
    entries = {entry.name: entry for entry in two_sessions.sessions()}
    assert "cannot be read" in entries["other"].problem
    assert entries["toy"].problem == ""


def test_links_out_of_the_workspace_are_not_listed(
    two_sessions: Workspace, tmp_path_factory: pytest.TempPathFactory
) -> None:
    outside = tmp_path_factory.mktemp("outside") / "secret"
    make_session(outside, frames=3)
    (two_sessions.root / "leak").symlink_to(outside)
    assert [entry.name for entry in two_sessions.sessions()] == ["other", "toy"]


def test_a_run_that_is_made_while_its_session_is_copied_is_in_the_copy_or_not(
    session_on_disk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    left_out = workspace_module._transient
    session_on_disk.new_run(record_of(session_on_disk, "first"))

    def listed(folder: str, names: list[str]) -> set[str]:
        if Path(folder).name == "runs":
            session_on_disk.new_run(record_of(session_on_disk, "late"))
        return left_out(folder, names)

    monkeypatch.setattr(workspace_module, "_transient", listed)
    copy = Workspace().duplicate("toy")
    assert [run.name for run in copy.runs()] == ["first"]
