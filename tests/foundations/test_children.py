"""Processes of this one end with it, say how they died, and can have processes of their own."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from crashing_readers import chatter
from held_children import ask_another, hold, hold_another, say_end
from waiting import PATIENCE

from studio.foundations.children import Child, EndedError

PLACE = Path("odd.mp4")
BEGIN = f"import sys; sys.path[:] = {sys.path!r}\n"
HAS_FAMILY = """
import time
from studio.foundations.children import Child
from held_children import hold_another

child = Child(hold_another, name="holder")
print(child.identifier, child.outbox.recv(), flush=True)
time.sleep(600)
"""
UNGUARDED = """
from pathlib import Path
from crashing_readers import chatter
from studio.foundations.isolated import isolated

print(isolated(ValueError, chatter, Path("odd.mp4")))
"""


def test_whose_parent_was_killed_ends_in_the_midst_of_its_work_and_so_do_its_own() -> None:
    parent = subprocess.Popen([sys.executable, "-c", BEGIN + HAS_FAMILY], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    with parent.stdout:
        family = [psutil.Process(int(one)) for one in parent.stdout.readline().split()]
        assert len(family) == 2
        parent.kill()
        parent.wait()
    _, alive = psutil.wait_procs(family, PATIENCE)
    assert not alive


def test_one_that_finishes_sees_the_end_of_its_inbox(tmp_path: Path) -> None:
    child = Child(say_end, tmp_path / "said", name="sayer", finishes=True)
    assert child.outbox.recv() == "here"
    child.inbox.close()
    child._presence.close()
    child.wait(PATIENCE)
    assert (child.exit_code, (tmp_path / "said").read_text()) == (0, "gone")
    child.end()


def test_a_death_is_said_and_heard() -> None:
    child = Child(hold, name="held")
    child.kill()
    with pytest.raises(EndedError):
        child.answer(b"")
    assert child.death() == "ended by signal 9, SIGKILL"
    child.end()
    ended = Child(os.getpid, 1, name="wrong", quiet=True)  # pyright: ignore[reportArgumentType]
    assert ended.death() == "ended with exit code 1"
    ended.end()


def test_ctrl_c_reaches_who_started_it_alone() -> None:
    child = Child(hold_another, name="holder")
    held = psutil.Process(child.outbox.recv())
    os.kill(child.identifier, signal.SIGINT)
    child.wait(0.5)
    assert child.exit_code is None
    child.end()
    held.wait(PATIENCE)


def test_a_file_is_read_in_a_process_of_a_process() -> None:
    child = Child(ask_another, chatter, PLACE, name="asker")
    assert child.outbox.recv() == (child.identifier, PLACE.name)
    child.end(PATIENCE)
    assert child.exit_code == 0


def test_a_script_that_reads_files_is_not_run_again(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(BEGIN + UNGUARDED)
    ended = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=PATIENCE)
    assert (ended.stdout, ended.returncode) == ("odd.mp4\n", 0), ended.stderr
