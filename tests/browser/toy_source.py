"""A folder to import: the toy session's pictures, masks and calibration as a person would bring them."""

import shutil
from pathlib import Path

from toy_session import BODY, FPS, make_session, true_poses

from studio.body.catalogue import load_body
from studio.sessions.named_rows import write_pose

FRAMES_PER_SECOND = int(FPS)


def make_source(folder: Path, frames: int) -> Path:
    """A source of `frames` pictures of the planar arm, with masks, subject and start pose."""
    session = make_session(folder.with_name(f"{folder.name}-made"), frames)
    folder.mkdir()
    for part in ("pictures", "masks", "calibration"):
        shutil.move(session.path / part, folder / part)
    shutil.rmtree(session.path)
    (folder / "subject.toml").write_text(f'body = "{BODY}"\n')
    names = tuple(entry.name for entry in load_body(BODY).parameters)
    write_pose(folder / "start_pose.csv", names, true_poses(1)[0])
    return folder
