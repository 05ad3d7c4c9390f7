"""The archive for a helper says enough to help with, and nothing of a person's own."""

import json
import logging
import socket
import zipfile
from pathlib import Path

import pytest
from command_line import answer_of
from toy_session import make_session, true_poses
from tracked_runs import finish

from studio.app.server.access import new_token
from studio.cli import diagnostics_archive
from studio.cli.launch import _log_to_file, address
from studio.cli.self_check import Examined
from studio.foundations.errors import SessionError
from studio.runs.new_run import prepare_run
from studio.sessions.run_log import append_to_log

SESSION, RUN, CAMERA = "krankengeschichte", "erste_sitzung", "front"
SECRETS = ("Zwetschge", "10.11.12.13", "geheim", "p4ssw0rt", "kamera.example", "brombeere")
QUICK = {"particles": 20, "layers": 2, "start_repeats": 2}


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A home of somebody whose every name is a word of their own."""
    found = tmp_path / "Zwetschge Mustermann"
    monkeypatch.setenv("HOME", str(found))
    monkeypatch.setenv("LOGNAME", "zwetschge")
    monkeypatch.setenv("STUDIO_WORKSPACE", str(found / "brombeere"))
    monkeypatch.setattr(
        diagnostics_archive,
        "doctor",
        lambda place: (Examined("workspace", True, f"'{place.root}' can be written"),),
    )
    return found


def planted(home: Path) -> str:
    """A workspace with a tracked run and logs full of what must not get out; the server's token."""
    session = make_session(home / "brombeere" / SESSION, 4)
    run = prepare_run(session, name=RUN, seed=7, start_pose=true_poses()[0], last=3, knobs=QUICK)
    finish(session, run)
    append_to_log(
        run.folder,
        "warning",
        f"Camera 'rtsp://admin:p4ssw0rt@10.11.12.13/geheim' of {SESSION} sends nothing.",
    )
    token = new_token()
    log = _log_to_file(home / "brombeere" / ".studio")
    try:
        raise OSError(28, "No space left on device", str(home / "Bilder von Zwetschge" / "geheim.mp4"))
    except OSError:
        logging.getLogger("studio").exception(
            "Frame 3 of %s cannot be stored for %s", RUN, address("http://kamera.example:8642", token)
        )
    # What a formatter that knows tokens does not recognise as one.
    logging.getLogger("studio").error("cookie %s from 10.11.12.13, header Bearer %s", token, token)
    for handler in [*logging.getLogger().handlers]:
        if getattr(handler, "baseFilename", "") == str(log):
            handler.close()
            logging.getLogger().removeHandler(handler)
    assert log.is_file()
    return token


def test_it_holds_no_footage_no_names_and_no_secrets(home: Path, tmp_path: Path) -> None:
    token = planted(home)
    done = answer_of("diagnostics --out", tmp_path / "out.zip")
    with zipfile.ZipFile(tmp_path / "out.zip") as archive:
        texts = {name: archive.read(name).decode() for name in archive.namelist()}
    assert [*texts] == done["parts"]
    assert [*texts] == ["README.txt", "doctor.json", "environment.json", "sessions.json", "server.log"]
    stored = {
        path.name
        for path in (home / "brombeere").rglob("*")
        if path.suffix in (".png", ".mp4", ".csv", ".sqlite")
    }
    assert len(stored) > 4
    forbidden = {SESSION, RUN, CAMERA, token, *SECRETS, *home.parts[-2:], socket.gethostname(), *stored}
    forbidden |= {token[at : at + 8] for at in range(len(token) - 8)}
    for name, text in texts.items():
        assert not [word for word in forbidden if word.lower() in text.lower()], name


def test_it_says_enough_to_help(home: Path, tmp_path: Path) -> None:
    planted(home)
    diagnostics_archive.diagnostics(tmp_path / "out.zip")
    with zipfile.ZipFile(tmp_path / "out.zip") as archive:
        log = archive.read("server.log").decode()
        (session,) = json.loads(archive.read("sessions.json"))
        environment = json.loads(archive.read("environment.json"))
    assert "Frame 3 of run-1 cannot be stored for" in log
    assert "No space left on device" in log
    assert "ERROR studio" in log
    assert session["session"] == "session-1"
    assert session["sources"] == [{"kind": "pictures", "width": 160, "height": 120, "frames": 4}]
    (run,) = session["runs"]
    assert (run["run"], run["status"], run["frames"], run["tracker"]) == (
        "run-1",
        "finished",
        [0, 3, 3],
        "annealed",
    )
    assert (run["settings"]["particles"], run["states"]) == (20, {"tracked": 3})
    assert run["log"][-1].startswith("warning: Camera …")
    assert run["log"][-1].endswith("of session-1 sends nothing.")
    assert environment["versions"]["numpy"][0] >= 2
    assert environment["variables"]["STUDIO_WORKSPACE"] == "set"


def test_nothing_is_overwritten(home: Path, tmp_path: Path) -> None:
    (tmp_path / "out.zip").write_text("mine")
    with pytest.raises(SessionError, match="There is something at"):
        diagnostics_archive.diagnostics(tmp_path / "out.zip")
    assert (tmp_path / "out.zip").read_text() == "mine"
