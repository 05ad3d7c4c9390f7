"""The commit that numbers were measured at, so that a reader can check out what made them."""

import subprocess
from functools import cache
from pathlib import Path

from studio.foundations.package import package_folder

DIGITS = 12
CHANGED = " with changes"


@cache
def commit() -> str:
    """The commit of the checkout that the studio runs from; "" where it does not run from one. Read once in a process.

    CHANGED follows where a file of the package differs from it.
    """
    package = package_folder()
    digits = _git(package, "rev-parse", f"--short={DIGITS}", "HEAD")
    if not digits or _git(package, "ls-files", "--error-unmatch", "__init__.py") is None:
        return ""
    return digits + (CHANGED if _git(package, "status", "--porcelain", "--", ".") else "")


def _git(folder: Path, *words: str) -> str | None:
    """What git answers, None where it fails or is not there."""
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, timeout=30, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
