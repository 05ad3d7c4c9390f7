"""What trials learn or fit once and share: folders of files beside the footage, each made by one process.

A folder is known by what it is made from and by the code that makes it, so another version of the studio makes its
own. It is whole or not there; who wants one that another process is making waits for it, and makes it where that
process died.
"""

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.kept_trials import code_digest, plain
from studio.comparison.trials import Plain
from studio.sessions.atomic_files import discard, move_into_place, new_folder_beside
from studio.sessions.process_lock import ProcessLock

LEARNT = "learnt"
# Code that decides on what is learnt or fitted.
ROOMS = ("geometry", "motion_files", "body", "behaviour", "synthesis", "training")
WAIT_SECONDS = 0.2


def made_once(
    shelf: FootageShelf, kind: str, making: Mapping[str, Plain], make: Callable[[Path], None]
) -> Path:
    """The folder of a thing of some kind, made by `make(folder)` if it is not there. making : all it depends on."""
    known = json.dumps({"making": plain(making), "code": code_digest(ROOMS)}, sort_keys=True)
    name = f"{kind}-{hashlib.sha256(known.encode()).hexdigest()[:16]}"
    place = shelf.folder / LEARNT / name
    if place.is_dir():
        return place
    place.parent.mkdir(parents=True, exist_ok=True)
    lock = _waited_for(place)
    if lock is None:
        return place
    partial = new_folder_beside(place)
    try:
        if not place.is_dir():
            make(partial)
            move_into_place(partial, place)
    finally:
        discard(partial)
        lock.free()
    return place


def _waited_for(place: Path) -> ProcessLock | None:
    """The lock on a place; None once somebody else has made what belongs there."""
    while True:
        lock = ProcessLock.take(place.with_name(f"{place.name}.lock"))
        if lock is not None:
            return lock
        time.sleep(WAIT_SECONDS)
        if place.is_dir():
            return None
