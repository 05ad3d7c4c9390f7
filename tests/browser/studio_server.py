"""A studio of its own: the command in a process, its printed address, and its API as a script talks to it.

The process is forked from one that has imported what a server imports, once for all files that one worker tests.
"""

import faulthandler
import json
import multiprocessing
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import httpx
import psutil
from api_driver import ApiDriver

PATIENCE = 90.0
ROOT = Path(__file__).resolve().parents[2]
PREPARED, NEW = multiprocessing.get_context("forkserver"), multiprocessing.get_context("spawn")
PREPARED.set_forkserver_preload(["studio.cli.serving_commands"])
ADDRESS = re.compile(r"Open (http://127\.0\.0\.1:\d+)/\?token=([A-Za-z0-9_-]+)\S*")


def _run(command: str, environment: Mapping[str, str], output: Path) -> None:
    """In the process: what the script `studio` does."""
    sys.path[:0] = environment.get("PYTHONPATH", "").split(os.pathsep)
    from studio.cli.main import main  # noqa: PLC0415

    written = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(written, 1)
    os.dup2(written, 2)
    faulthandler.enable()
    os.environ.clear()
    os.environ.update(environment)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    main([command, "--port", "0"])


class StudioServer(ApiDriver):
    """`studio demo` or `studio serve` on a workspace; stopped with SIGINT as a person would.

    footage : the folder that it may read. beside : a folder of packages beside it, which only a new process can find.
    """

    def __init__(
        self, command: str, workspace: Path, footage: Path | None = None, beside: Path | None = None
    ) -> None:
        self.workspace = workspace
        self._output = workspace.parent / f"{workspace.name}-output.txt"
        environment = os.environ | {"STUDIO_WORKSPACE": str(workspace), "PYTHONFAULTHANDLER": "1"}
        if footage is not None:
            environment["STUDIO_FOOTAGE_ROOTS"] = str(footage)
        if beside is not None:
            environment["PYTHONPATH"] = os.pathsep.join((str(beside), str(ROOT)))
        self._output.write_text("")  # of a server that was here before
        context = PREPARED if beside is None else NEW
        self.process = context.Process(target=_run, args=(command, environment, self._output))
        self.process.start()
        found = self._printed()
        self.address, self.origin, self.token = found[0].removeprefix("Open "), found[1], found[2]
        # A connection each: one that is kept may be closed by the server just when it is used again.
        super().__init__(
            httpx.Client(
                base_url=self.origin,
                headers={"authorization": f"Bearer {self.token}"},
                timeout=PATIENCE,
                limits=httpx.Limits(max_keepalive_connections=0),
            )
        )

    def __enter__(self) -> "StudioServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _printed(self) -> re.Match[str]:
        deadline = time.monotonic() + PATIENCE
        while True:
            text = self._output.read_text()
            if found := ADDRESS.search(text):
                return found
            if self.process.exitcode is not None or time.monotonic() > deadline:
                self.process.kill()
                self.process.join()
                raise AssertionError(f"no address was printed: {text}")
            time.sleep(0.1)

    def until(self, wanted: Callable[[dict], bool]) -> dict:
        """The worker's state once it is as wanted."""
        deadline = time.monotonic() + PATIENCE
        while not wanted(state := self.get("/api/worker")):
            assert time.monotonic() < deadline, f"it stayed at {state}"
            time.sleep(0.1)
        return state

    def track(self, session: str, name: str, **wanted: object) -> None:
        """Make a run and wait until it is tracked to its end."""
        runs = f"/api/sessions/{session}/runs"
        self.post(runs, {"name": name, **wanted})
        self.post(f"{runs}/{name}/start")
        self.until(
            lambda state: (state["session"], state["run"], state["state"]) == (session, name, "finished")
        )

    def pace(self, seconds_a_layer: float) -> None:
        """Let each layer that is tracked take at least so many seconds from now on; 0: as fast as it can."""
        self.post("/api/worker/pace", {"seconds_a_layer": seconds_a_layer})
        self.until(lambda state: state["seconds_a_layer"] == seconds_a_layer)

    def faults(self) -> list[str]:
        """What the runs' logs hold of errors, for the message of a test that fails."""
        logs = self.workspace.rglob("log.jsonl")
        entries = [json.loads(line) for path in logs for line in path.read_text().splitlines()]
        return [entry["text"] for entry in entries if entry["level"] == "error"]

    def worker(self) -> psutil.Process:
        """The tracking process."""
        children = psutil.Process(self.process.pid).children()
        found = [child for child in children if "studio-tracking" in child.cmdline()]
        assert len(found) == 1, [child.cmdline() for child in children]
        return found[0]

    def stop(self) -> None:
        """Ctrl-C, and wait until all is closed; it must not have ended before by itself."""
        self.client.close()
        log = self.workspace / ".studio" / "server.log"
        if log.exists() and "Traceback" in (text := log.read_text()):
            print(text[text.rindex("Traceback") :])  # for the report of a test that failed
        assert self.process.exitcode is None, (
            f"the studio ended ({self.process.exitcode}): {self._output.read_text()}"
        )
        assert self.process.pid is not None
        os.kill(self.process.pid, signal.SIGINT)
        self.process.join(PATIENCE)
        if self.process.exitcode is None:
            self.process.kill()
            self.process.join()
            raise AssertionError(f"the studio did not end: {self._output.read_text()}")
