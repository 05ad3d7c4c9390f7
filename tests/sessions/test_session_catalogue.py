"""The catalogue holds nothing of its own."""

import msgspec
import pytest
from store_records import record_of
from toy_session import make_session

from studio.sessions.catalogue import FILE_NAME
from studio.sessions.session import Session, described_anew
from studio.sessions.workspace import Workspace


@pytest.fixture
def workspace(session_on_disk: Session) -> Workspace:
    session_on_disk.new_run(record_of(session_on_disk, "first"))
    session_on_disk.new_run(record_of(session_on_disk, "second"))
    made = Workspace()
    make_session(made.place_for("other"), frames=3)
    return made


def test_deleting_it_loses_nothing(workspace: Workspace) -> None:
    before = workspace.sessions()
    assert [entry.name for entry in before] == ["other", "toy"]
    assert [run.name for run in before[1].runs] == ["first", "second"]
    assert (workspace.root / FILE_NAME).exists()
    workspace.catalogue.forget()
    assert not (workspace.root / FILE_NAME).exists()
    assert workspace.sessions() == before


@pytest.mark.parametrize("damage", [b"", b"rubbish" * 1000])
def test_damage_is_mended(workspace: Workspace, damage: bytes) -> None:
    before = workspace.sessions()
    workspace.catalogue.forget()
    (workspace.root / FILE_NAME).write_bytes(damage)
    assert workspace.sessions() == before


def test_it_follows_what_happens_to_the_folders(workspace: Workspace) -> None:
    workspace.sessions()
    session = workspace.session("toy")
    described_anew(session, msgspec.structs.replace(session.manifest, title="Another title"))
    workspace.trash_run("toy", "first")
    workspace.trash("other")
    (found,) = workspace.sessions()
    assert found.title == "Another title"
    assert [run.name for run in found.runs] == ["second"]


def test_a_broken_manifest_is_listed_with_its_reason(workspace: Workspace) -> None:
    (workspace.root / "other" / "session.json").write_text("{")
    entries = {entry.name: entry for entry in workspace.sessions()}
    assert "cannot be read" in entries["other"].problem
    assert entries["toy"].problem == ""


def test_links_out_of_the_workspace_are_not_listed(
    workspace: Workspace, tmp_path_factory: pytest.TempPathFactory
) -> None:
    outside = tmp_path_factory.mktemp("outside") / "secret"
    make_session(outside, frames=3)
    (workspace.root / "leak").symlink_to(outside)
    assert [entry.name for entry in workspace.sessions()] == ["other", "toy"]
