"""The hostile sessions in a process of their own, which forks: some of them; all with all requests as `slow`."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hostile.commands import OTHERS, SESSION_COMMANDS
from hostile.makers import MAKERS
from studio.cli.main import COMMANDS


def test_every_command_is_tried_or_has_a_reason_not_to_be() -> None:
    assert set(SESSION_COMMANDS) | set(OTHERS) == set(COMMANDS)


def tried(*options: str) -> subprocess.CompletedProcess[str]:
    tests = Path(__file__).parents[1]
    return subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "hostile", *options],
        env=os.environ
        | {"PYTHONPATH": os.pathsep.join([str(tests.parent), str(tests), str(tests / "app" / "server")])},
        capture_output=True,
        text=True,
        check=False,
    )


def test_some_sessions_do_no_harm() -> None:
    chosen = list(MAKERS)[:: len(MAKERS) // 12]
    ended = tried("--few", "--seconds", "20", *(f"--only={name}" for name in chosen))
    assert ended.returncode == 0, ended.stdout + ended.stderr


@pytest.mark.slow
def test_no_session_does_harm() -> None:
    ended = tried()
    assert ended.returncode == 0, ended.stdout + ended.stderr


@pytest.mark.slow
def test_a_repair_that_mends_nothing_ends() -> None:
    ended = tried("--only=poses of one byte")
    assert ended.returncode == 0, ended.stdout + ended.stderr
