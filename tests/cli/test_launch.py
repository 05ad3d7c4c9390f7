"""Opening and closing the whole: what is printed, what is refused, and that nothing is left running."""

import logging
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import psutil
import pytest

from studio.body.motion_files.trc import read_trc
from studio.cli import launch
from studio.cli.launch import Listening, RedactedFormatter, address, serve
from studio.foundations.errors import AccessError, StudioError
from studio.operations.gallery import prepare_demo
from studio.operations.jobs.commands import Open
from studio.results.evaluation.errors import evaluate
from studio.runs.tracks import RAW, read_track
from studio.sessions.samples import sample_folder
from studio.sessions.workspace import Workspace

SERVE = """
import sys
from pathlib import Path
from studio.cli.launch import Listening, serve
if __name__ == "__main__":
    serve(Path(sys.argv[1]), Listening(port=0), announce=lambda text: print(text, flush=True))
    print("closed", flush=True)
"""


def started(folder: Path, text: str) -> subprocess.Popen[str]:
    """A process that runs a script, as a command would."""
    script = folder / "serving.py"
    script.write_text(text)
    return subprocess.Popen(
        [sys.executable, str(script), str(folder / "workspace")],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"PYTHONPATH": str(Path(launch.__file__).parents[2])},
    )


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The studio in a process of its own, as a command would start it, and its printed address."""
    process = started(tmp_path, SERVE)
    line = process.stdout.readline()
    try:
        yield process, line.removeprefix("Open ").strip()
    finally:
        process.kill()
        process.wait(20)
        process.stdout.close()


def test_the_printed_address_opens_the_studio_and_ctrl_c_closes_everything(
    served: tuple[subprocess.Popen[str], str],
) -> None:
    process, printed = served
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{43}", printed)
    with httpx.Client(timeout=30.0, follow_redirects=True) as browser:
        page = browser.get(printed)
        assert page.status_code == 200
        assert "token" not in str(page.url)
        base = printed.partition("/?")[0]
        assert browser.get(f"{base}/api/sessions").json() == {"sessions": []}
        assert browser.get(f"{base}/scene/").status_code == 200
    family = psutil.Process(process.pid).children(recursive=True)
    assert family
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 0
    rest = process.stdout.read()
    assert re.fullmatch(
        rf"For viewers, who change nothing: {re.escape(base)}/\?token=[\w-]{{43}}\nclosed\n", rest
    )
    _, alive = psutil.wait_procs(family, timeout=20)
    assert alive == []


@pytest.mark.slow
def test_it_ends_whatever_a_thread_waits_for(tmp_path: Path) -> None:
    waiting = "import threading\nfrom studio.sessions.workspace import Workspace\n"
    waiting += "Workspace.sessions = lambda self: threading.Event().wait()\n"
    process = started(tmp_path, waiting + SERVE)
    try:
        printed = process.stdout.readline().removeprefix("Open ").strip()
        with httpx.Client(timeout=30.0, follow_redirects=True) as browser:
            browser.get(printed)
            with pytest.raises(httpx.ReadTimeout):
                browser.get(f"{printed.partition('/?')[0]}/api/sessions", timeout=0.5)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 128 + signal.SIGINT
    finally:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_the_token_is_printed_once_and_logged_nowhere(
    served: tuple[subprocess.Popen[str], str], tmp_path: Path
) -> None:
    process, printed = served
    token = re.search(r"token=([\w-]+)", printed)
    base = printed.partition("/?")[0]
    with httpx.Client(timeout=30.0) as browser:
        for path in (f"/?token={token[1]}", f"/api/none?token={token[1]}", f"/?token={token[1]}x", "/"):
            browser.get(base + path)
        browser.request("BREW", f"{base}/?token={token[1]}")
    process.send_signal(signal.SIGTERM)
    process.wait(20)
    assert token[1] not in process.stdout.read()
    for path in tmp_path.rglob("*"):
        if path.is_file():
            assert token[1].encode() not in path.read_bytes(), path


def test_lines_of_the_log_lose_their_token() -> None:
    record = logging.LogRecord("x", logging.ERROR, "", 1, 'GET "/?token=%s&a=1" failed', ("se-cr_et1",), None)
    assert RedactedFormatter("%(message)s").format(record) == 'GET "/?token=…&a=1" failed'


def test_another_host_needs_permission_before_anything_starts(tmp_path: Path) -> None:
    before = psutil.Process().children()
    with pytest.raises(AccessError, match=r"0\.0\.0\.0"):
        serve(tmp_path / "w", Listening("0.0.0.0", 0))
    assert not (tmp_path / "w").exists()
    assert psutil.Process().children() == before


def test_a_port_that_is_taken_is_named(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen(1)
        port = taken.getsockname()[1]
        with pytest.raises(StudioError, match=str(port)) as refused:
            serve(tmp_path / "w", Listening(port=port))
    assert "--port" in refused.value.hint


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_workspace_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    with pytest.raises(StudioError, match="closed"):
        serve(closed / "w", Listening(port=0))


def test_a_workspace_that_is_a_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "w").write_text("a file")
    with pytest.raises(StudioError, match="w") as refused:
        serve(tmp_path / "w", Listening(port=0))
    assert "--workspace" in refused.value.hint


@pytest.mark.parametrize(
    ("host", "shown"),
    [
        ("127.0.0.1", "127.0.0.1"),
        ("::1", "[::1]"),
        ("0.0.0.0", socket.gethostname()),
        ("a.example", "a.example"),
    ],
)
def test_addresses(host: str, shown: str) -> None:
    assert launch._host_of(host) == shown
    assert address(f"http://{shown}:80", "t") == f"http://{shown}:80/?token=t"
    shown = {"session": "walk", "run": "run-1"}
    assert address("https://a.example", "t", shown).endswith("/?token=t&session=walk&run=run-1")


def test_two_addresses_are_printed_and_a_word_about_tls_where_others_come_in() -> None:
    lines = launch.printed("http://a/?token=1", "http://a/?token=2", plainly=False).splitlines()
    assert lines == ["Open http://a/?token=1", "For viewers, who change nothing: http://a/?token=2"]
    assert "unencrypted" in launch.printed("x", "y", plainly=True)


def test_the_demo_s_session_is_copied_once_and_never_overwritten(tmp_path: Path) -> None:
    first = prepare_demo(tmp_path)
    assert first.name == "walk"
    assert first.manifest.frame_count >= 150
    original = sample_folder("walk")
    for path in original.rglob("*"):
        if path.is_file():
            assert (first.path / path.relative_to(original)).read_bytes() == path.read_bytes()
    mark = first.path / "note.txt"
    mark.write_text("mine")
    Workspace(tmp_path).retitle("walk", "My walk")
    assert prepare_demo(tmp_path).manifest.title == "My walk"
    assert mark.read_text() == "mine"


def test_something_in_the_sample_s_place_is_not_touched(tmp_path: Path) -> None:
    (tmp_path / "walk").mkdir()
    (tmp_path / "walk" / "precious.txt").write_text("mine")
    with pytest.raises(StudioError, match="in the way"):
        prepare_demo(tmp_path)
    assert (tmp_path / "walk" / "precious.txt").read_text() == "mine"


def test_the_demo_opens_on_a_frame_that_is_searched_already(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the runs that travel with the walk one has lost the walker where the other holds him, with as many
    evaluations; a run that is there already is left alone.
    """
    openings: list[launch.Opening] = []
    monkeypatch.setattr(launch, "serve", lambda root, listening, *, first, **_: openings.append(first()))
    launch.demo(tmp_path)
    session = Workspace(tmp_path).session("walk")
    (mark := session.run("ten-layers").folder / "mine.txt").write_text("mine")
    launch.demo(tmp_path)
    assert mark.read_text() == "mine"
    one, two = openings
    assert one.run.folder == two.run.folder == session.run("ten-layers").folder
    assert one.query["run"] == "ten-layers"
    assert [run.name for run in Workspace(tmp_path).session("planar_arm").runs()] == ["arm"]
    assert session.truth_path is not None
    truth, worst, effort = read_trc(session.truth_path), dict[str, float](), dict[str, int]()
    for run in session.runs():
        track = read_track(run, RAW)
        assert int(one.query["frame"]) in track.frames
        worst[run.name] = evaluate(track.poses, track.frames, run.body(), truth, 60.0).worst_mm
        with run.results() as results:
            assert not results.damaged()
            effort[run.name] = int(results.timeline().evaluations[9])
    assert worst["ten-layers"] < 35.0 < 100.0 < worst["one-layer"]
    assert effort["ten-layers"] == effort["one-layer"] == 500


def test_the_run_is_opened_before_the_server_is_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[object] = []

    class Control:
        def __init__(self, workspace: Workspace) -> None:
            self.start, self.close = (lambda: done.append("start")), (lambda: done.append("close"))

        def send(self, command: Open) -> None:
            assert command.warm
            done.append(Path(command.run).name)

    def loaded(*_: object) -> object:
        done.append("server")
        raise StudioError("Enough.", "")

    monkeypatch.setattr(launch, "StudioControl", Control)
    monkeypatch.setattr(launch, "_app", loaded)
    with pytest.raises(StudioError, match="Enough"):
        launch.demo(tmp_path)
    assert done == ["start", "ten-layers", "server", "close"]


def test_a_second_server_on_a_workspace_is_refused_with_the_first_ones_address(
    served: tuple[subprocess.Popen[str], str], tmp_path: Path
) -> None:
    process, printed = served
    base = printed.partition("/?")[0]
    with pytest.raises(StudioError, match=re.escape(f"is served already, at {base}.")) as refused:
        serve(tmp_path / "workspace", Listening(port=0))
    assert "--workspace" in refused.value.hint
    assert "token" not in str(refused.value)
    assert launch.served_at(tmp_path / "workspace") == base
    process.kill()
    process.wait(20)
    assert launch.served_at(tmp_path / "workspace") == ""
    with launch._alone_on(tmp_path / "workspace"):
        assert launch.served_at(tmp_path / "workspace")
