"""A session for each of several subjects in view: the same footage, each with masks, measures, start pose of its own.

Footage is not copied: its files are linked where the disk can. What a session knows of a person (measures, start pose,
truth) goes to whom it is of, by where the start pose stands; `beside/<n>/` has the same of the others, where it is
known (footage of `synthesize` has it).
"""

import contextlib
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.subject import read_subject
from studio.foundations.arrays import Array
from studio.foundations.errors import SessionError, StudioError
from studio.foundations.progress import Progress, no_progress
from studio.runs.search_space import parameter_names
from studio.runs.setup.subject_masks import MM, Place, cut_frames, subject_masks_of
from studio.sessions import atomic_files
from studio.sessions.background_files import SUBJECT_MASKS, change_evidence
from studio.sessions.manifest import write_manifest
from studio.sessions.named_rows import pose_frame, read_pose
from studio.sessions.session import (
    BESIDE,
    RUNS_NAME,
    START_POSE_NAME,
    SUBJECT_NAME,
    THUMBNAIL_NAME,
    Session,
    start_pose_files,
)

TRUTH, TRUTH_NAME = "truth", "truth.trc"
LEFT_OUT = (RUNS_NAME, THUMBNAIL_NAME, BESIDE, SUBJECT_MASKS, "shapes", "made_from.json", ".checksums.json")
SAME = 600.0
"""mm between a place on the floor and the start pose of who stands there."""


def make_subject_sessions(
    session: Session, places: Sequence[Place], into: Sequence[Path], progress: Progress = no_progress
) -> tuple[tuple[Session, ...], tuple[str, ...]]:
    """A session for the subject at each place of the first frame, and notes. into : their new folders.

    Their masks are the session's, cut by the visual hull. Raises FootageError where no subject stands at a place,
    SessionError for a folder that is taken; then nothing is made.
    """
    known = [session.path, *sorted((session.path / BESIDE).glob("*"))]
    stands = [_stands(session, folder) for folder in known]
    made: list[Session] = []
    notes: list[str] = []
    try:
        for number, (place, folder) in enumerate(zip(places, into, strict=True), 1):
            owner = _nearest(stands, place)
            made.append(_linked(session, folder, number, None if owner is None else known[owner]))
            if owner is None and any(one is not None for one in stands):
                notes.append(f"{folder.name}: measures, start pose and truth are not known; set them.")
        lost: list[list[int]] = [[] for _ in places]
        with contextlib.ExitStack() as stack:
            puts = [stack.enter_context(subject_masks_of(one)) for one in made]
            for cut in cut_frames(session, places, progress):
                for put, part, hidden in zip(puts, cut.parts, cut.hidden, strict=True):
                    put(cut.frame, (part, cut.whole, hidden))
                for label in cut.lost:
                    lost[label].append(cut.frame)
        for one in made:
            change_evidence(one, knobs={"background_model": "auto"})
        notes += [
            f"{one.name}: not seen in {len(frames)} frames, first in frame {frames[0]}."
            for one, frames in zip(made, lost, strict=True)
            if frames
        ]
    except BaseException:
        for one in made:
            shutil.rmtree(one.path, ignore_errors=True)
        raise
    return tuple(Session(one.path) for one in made), tuple(notes)


def _linked(session: Session, place: Path, number: int, owner: Path | None) -> Session:
    """A copy of a session without runs, its footage linked. owner : folder of what is known of the subject."""
    if place.exists():
        raise SessionError(f"'{place}' exists already.", "Name the new sessions with --into.")
    with atomic_files.made_whole(place) as folder:
        shutil.copytree(
            session.path,
            folder,
            symlinks=True,
            dirs_exist_ok=True,
            copy_function=_link,
            ignore=lambda _, names: {
                name for name in names if name in LEFT_OUT or name.startswith(atomic_files.PARTIAL_PREFIX)
            },
        )
        if owner != session.path:
            if owner is not None or _knows(session):
                for path in (folder / SUBJECT_NAME, *start_pose_files(folder)):
                    path.unlink(missing_ok=True)
            shutil.rmtree(folder / TRUTH, ignore_errors=True)
        if owner is not None and owner != session.path:
            for name in (SUBJECT_NAME, START_POSE_NAME):
                if (owner / name).is_file():
                    atomic_files.copy_file(owner / name, folder / name)
            if (owner / TRUTH_NAME).is_file():
                (folder / TRUTH).mkdir()
                atomic_files.copy_file(owner / TRUTH_NAME, folder / TRUTH / TRUTH_NAME)
        title = f"{session.manifest.title}: subject {number}"
        write_manifest(folder, msgspec.structs.replace(session.manifest, name=place.name, title=title))
    return Session(place)


def _knows(session: Session) -> bool:
    """Whether a session's measures are of a person whose place is known."""
    return (session.path / START_POSE_NAME).exists()


def _link(source: str, target: str) -> None:
    """Link a file, or copy it where that cannot be done. (Files of a session are replaced, never written into.)"""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def _nearest(stands: Sequence[Array | None], place: Place) -> int | None:
    """Which of the known people stands at a place."""
    apart = [np.inf if at is None else float(np.linalg.norm(at - MM * np.array(place))) for at in stands]
    best = int(np.argmin(apart))
    return best if apart[best] <= SAME else None


def _stands(session: Session, folder: Path) -> Array | None:
    """(2,) mm where the person of a folder's start pose stands in the first frame; None if that is not known."""
    path, measures = folder / START_POSE_NAME, folder / SUBJECT_NAME
    if not path.is_file() or (pose_frame(path) or 0) != 0:
        return None
    try:
        body = session.body(
            subject=read_subject(measures, session.manifest.body) if measures.is_file() else None
        )
        pose = read_pose(path, parameter_names(body))
    except StudioError:
        return None
    return limb_ends(body, pose[None])[0].reshape(-1, 3)[:, :2].mean(axis=0)
