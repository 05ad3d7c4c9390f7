"""All commands and addresses over the hostile sessions, each session in a child process that is watched.

Wrong is a traceback, an answer of 500 or more, ten seconds without an answer, 300 MB more than at the start, a word of
what lies outside the session, and anything changed there.
"""

import contextlib
import gc
import hashlib
import importlib
import os
import re
import resource
import select
import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import psutil
from click.testing import CliRunner
from fastapi.testclient import TestClient
from fsspec.config import conf as fsspec_config
from fuzz.api import LONG, left_to_ask

# Not under its own name here: the doubles are the server's tests'.
from web_doubles import TOKEN, RecordingControl, RecordingScenes

from hostile.commands import SESSION_COMMANDS
from hostile.makers import MAKERS, NAME, RUN, SECRET, make_nothing, make_outside, make_plain
from studio.app.server.access import Tokens
from studio.app.server.api_document import api_document
from studio.app.server.app import build_app
from studio.cli.main import load, main
from studio.operations.experiments import experiments
from studio.sessions.workspace import Workspace

AS_IT_IS = "as it is"
LARGEST_FILE = 128 << 20
"""Bytes that may be written into one: what a session holds in place of a small file has more."""
LONGEST_SECONDS, MOST_BYTES = 10.0, 300 << 20
FILLED = {
    "session": NAME,
    "run": RUN,
    "camera": "front",
    "frame": "1",
    "layer": "0",
    "track": "raw",
    "view": "variance",
}
DOCUMENT = api_document()


@dataclass
class Tally:
    """Of one session. wrong : what went wrong, sentences."""

    requests: int = 0
    commands: int = 0
    seconds: float = 0.0
    most_bytes: int = 0
    wrong: list[str] = field(default_factory=list)


def campaign(
    names: Sequence[str],
    seconds: float | None = None,
    *,
    few: bool = False,
    told: Callable[[str, "Tally"], None] = lambda name, tally: None,
) -> dict[str, Tally]:
    """Try the sessions of these names, each once. seconds : begin none after so long. few : of requests and commands a
    part, another one for each session. told : called after each session.
    """
    found: dict[str, Tally] = {}
    # Loaded here, and not by each child again.
    importlib.import_module("anyio._backends._asyncio")
    for command in SESSION_COMMANDS:
        load(command)
    importlib.import_module("fpdf")
    experiments().lines()
    # What is here already is no growth: a child's collector leaves its pages shared.
    gc.freeze()
    with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
        plain = make_plain(Path(folder) / "plain")
        found[AS_IT_IS] = tried(AS_IT_IS, plain, Path(folder), 0 if few else None)
        told(AS_IT_IS, found[AS_IT_IS])
        began = time.monotonic()
        for number, name in enumerate(names):
            if seconds is not None and time.monotonic() - began > seconds:
                break
            found[name] = tried(name, plain, Path(folder), number if few else None)
            told(name, found[name])
    return found


def tried(name: str, plain: Path, folder: Path, part: int | None = None) -> Tally:
    """One session, in a child process."""
    stage = folder / "stage"
    shutil.rmtree(stage, ignore_errors=True)
    workspace, outside, out = stage / "workspace", stage / "outside", stage / "out"
    shutil.copytree(plain, workspace / NAME)
    shutil.copytree(plain, workspace / "other")
    out.mkdir()
    make_outside(outside)
    MAKERS.get(name, make_nothing)(workspace / NAME, outside)
    before = _digest(outside), _digest(workspace / "other")
    tally, began = Tally(), time.monotonic()
    for work in (_command, _ask) if name == AS_IT_IS else (_ask, _command):
        _watched(lambda say, work=work: work(workspace, out, say, part), tally, bounded=name != AS_IT_IS)
    tally.seconds = time.monotonic() - began
    if before[0] != _digest(outside):
        tally.wrong.append("something outside was changed")
    if before[1] != _digest(workspace / "other"):
        tally.wrong.append("another session was changed")
    for path in out.rglob("*"):
        if path.is_file() and SECRET.encode() in path.read_bytes():
            tally.wrong.append(f"'{path.name}' holds what lies outside")
    return tally


Say = Callable[[str], None]


def _watched(work: Callable[[Say], None], tally: Tally, *, bounded: bool = True) -> None:
    """Do work in a child; what it says and how it ends goes to the tally. A line before each piece names it. bounded :
    it may not take long, nor may a command be refused otherwise.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.close(reading)
        _live(work, writing)
    os.close(writing)
    process, doing, rest = psutil.Process(child), "the start", b""
    since, spent, most_bytes = time.monotonic(), 0.0, 0
    while True:
        ready, _, _ = select.select([reading], [], [], 0.1)
        if ready:
            content = os.read(reading, 65536)
            if not content:
                break
            since, spent = time.monotonic(), _seconds_of(process)
            *lines, rest = (rest + content).split(b"\n")
            for line in map(bytes.decode, lines):
                kind, _, words = line.partition(" ")
                if kind == "wrong" or (kind == "refused" and not bounded):
                    tally.wrong.append(words)
                elif kind != "refused":
                    doing = words
                    tally.requests += kind == "request"
                    tally.commands += kind == "command"
        with contextlib.suppress(psutil.Error):
            most_bytes = max(most_bytes, process.memory_full_info().uss)
            tally.most_bytes = max(tally.most_bytes, most_bytes)
        waited, worked = time.monotonic() - since, _seconds_of(process) - spent
        # Its own time counts, for the machine may be busy; without any it waits for something.
        idle = waited > LONGEST_SECONDS and worked < waited / 100
        if bounded and (most_bytes > 2 * MOST_BYTES or idle or worked > LONGEST_SECONDS):
            tally.wrong.append(f"{doing}: {most_bytes >> 20} MB, {time.monotonic() - since:.0f} s")
            os.kill(child, signal.SIGKILL)
            break
    os.close(reading)
    _, status = os.waitpid(child, 0)
    if status and os.WIFSIGNALED(status) and os.WTERMSIG(status) != signal.SIGKILL:
        tally.wrong.append(f"{doing}: the process died of signal {os.WTERMSIG(status)}")
    if bounded and most_bytes > MOST_BYTES:
        tally.wrong.append(f"{most_bytes >> 20} MB more than at the start")


def _seconds_of(process: psutil.Process) -> float:
    """Of the processor, that it has had."""
    spent = 0.0
    with contextlib.suppress(psutil.Error):
        for one in (process, *process.children(recursive=True)):
            times = one.cpu_times()
            spent += times.user + times.system + times.children_user + times.children_system
    return spent


def _live(work: Callable[[Say], None], writing: int) -> None:
    """In the child."""

    def say(line: str) -> None:
        os.write(writing, line.replace("\n", " ").encode()[:2000] + b"\n")

    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE, LARGEST_FILE))
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        work(say)
    except BaseException as problem:  # said to the parent
        say(f"wrong the child failed: {type(problem).__name__}: {problem}")
    os._exit(0)


def requests_of(document: dict, part: int | None = None) -> Iterator[tuple[str, str]]:
    """Method and path of the requests, what changes a session last. part : of the reading ones every fourth, from this
    one on; of the others every sixteenth.
    """
    known = [
        (method.upper(), re.sub(r"{(\w+)}", lambda found: FILLED.get(found[1], "x"), path))
        for path, operations in left_to_ask(document)["paths"].items()
        for method in operations
        if not path.endswith(LONG) and "/learning" not in path
    ]
    reading = [entry for entry in known if entry[0] == "GET"]
    changing = sorted((entry for entry in known if entry[0] != "GET"), key=lambda entry: entry[0] == "DELETE")
    if part is not None:
        reading, changing = reading[part % 4 :: 4], changing[part % 16 :: 16]
    yield ("GET", "/api/sessions")
    yield from reading
    yield from changing


def _ask(workspace: Path, _: Path, say: Say, part: int | None) -> None:
    scenes = RecordingScenes()
    app = build_app(Workspace(workspace), RecordingControl(), scenes, Tokens(TOKEN))
    with TestClient(app, base_url="http://127.0.0.1", raise_server_exceptions=False) as client:
        headers = {"authorization": f"Bearer {TOKEN}"}
        for method, path in requests_of(DOCUMENT, part):
            say(f"request {method} {path}")
            body = None if method in ("GET", "DELETE") else {}
            answer = client.request(method, path, json=body, headers=headers, follow_redirects=False)
            if answer.status_code >= 500:
                say(f"wrong {method} {path}: {answer.status_code} {answer.text[:300]}")
            if SECRET in answer.text:
                say(f"wrong {method} {path} shows what lies outside")
            if (method, path) == ("GET", "/api/sessions") and b'"other"' not in answer.content:
                say(f"wrong the list lacks the other session: {answer.status_code} {answer.text[:300]}")
        say("request GET (closing)")


def _command(workspace: Path, out: Path, say: Say, part: int | None) -> None:
    os.environ["STUDIO_WORKSPACE"] = str(workspace)
    # A folder stands for a store: what is put there is looked through afterwards.
    fsspec_config["file"] = {"auto_mkdir": True}
    commands = [command for lines in SESSION_COMMANDS.values() for command in lines]
    if part is not None:
        commands = commands[part % 5 :: 5]
    for command in commands:
        line = [word.format(out=out, session=workspace / NAME) for word in command]
        say(f"command studio {' '.join(line)}")
        ended = CliRunner().invoke(main, line)
        text = ended.output
        if ended.exit_code not in (0, 1, 2) or not isinstance(ended.exception, SystemExit | None):
            say(f"wrong studio {' '.join(line)}: {ended.exit_code} {ended.exception!r} {text[-300:]}")
        if ended.exit_code:
            say(f"refused studio {' '.join(line)}: {text[-300:]}")
        if "Traceback" in text or "fault of the studio" in text:
            say(f"wrong studio {' '.join(line)}: {text[-300:]}")
        if SECRET in text:
            say(f"wrong studio {' '.join(line)} shows what lies outside")
        if re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", text):
            say(f"wrong studio {' '.join(line)} writes control characters")


def _digest(folder: Path) -> str:
    made = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        made.update(str(path.relative_to(folder)).encode())
        # Locks are taken where there was none, and small pictures made.
        if path.is_file() and not path.name.startswith("results.") and not path.is_symlink():
            made.update(path.read_bytes())
    return made.hexdigest()


HEAD = "| session | requests | commands | s | MB | wrong |\n|---|---|---|---|---|---|"


def line(name: str, tally: Tally) -> str:
    """A line of the table, and what went wrong below it."""
    numbers = (
        tally.requests,
        tally.commands,
        f"{tally.seconds:.1f}",
        tally.most_bytes >> 20,
        len(tally.wrong),
    )
    return "\n".join(
        [f"| {name} | {' | '.join(map(str, numbers))} |", *(f"  {words}" for words in tally.wrong)]
    )
