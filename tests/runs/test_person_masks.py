"""Masks of a person from the network as a session's masks: all frames, turned and offset cameras, what fails leaves all
as it was, who is followed.
"""

import errno
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from rendered_people import FPS, SIZE, Rendered, overlap, rendered_walk

from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError, SessionError, WorkCancelledError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import no_progress
from studio.runs.setup.background_setup import frames_in_words, set_up_background
from studio.runs.setup.person_masks import PersonMasks, person_masks
from studio.runs.setup.session_settings import session_settings
from studio.sessions.background_files import PERSON_MASKS, read_evidence
from studio.sessions.footage_changes import change_footage
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

FRAMES, TURN, OFFSET = 3, 90, 2


@pytest.fixture(scope="module")
def walk() -> Rendered:
    return rendered_walk(FRAMES)


@pytest.fixture
def session(walk: Rendered, tmp_path: Path) -> Session:
    """Three cameras: of cam2 the files lie on their side, cam3's begin two frames earlier; cam1 has masks already."""
    folder, sources = tmp_path / "take", []
    for name, turned, offset in (("cam1", 0, 0), ("cam2", TURN, 0), ("cam3", 0, OFFSET)):
        (folder / "pictures" / name).mkdir(parents=True)
        for number in range(FRAMES + offset):
            picture = walk.pictures[name, number - offset] if number >= offset else walk.empty[name]
            stored = np.rot90(picture, turned // 90)
            cv2.imwrite(str(folder / "pictures" / name / f"{number:03d}.png"), stored)
        source = CameraSource(name, "pictures", f"pictures/{name}", *SIZE, FRAMES + offset)
        sources.append(replace(source, offset=offset, turned=turned))
    (folder / "masks" / "cam1").mkdir(parents=True)
    for frame in range(FRAMES):
        cv2.imwrite(str(folder / "masks" / "cam1" / f"{frame:03d}.png"), np.zeros(SIZE[::-1], np.uint8))
    sources[0] = replace(sources[0], masks="masks/cam1")
    (folder / "calibration").mkdir()
    write_calibration(walk.cameras[:3], folder / "calibration" / "cameras.toml")
    footage = FootageSource(FPS, FRAMES, tuple(sources))
    manifest = SessionManifest(name="take", title="Walk", created=now(), body="human31", footage=footage)
    write_manifest(folder, manifest)
    return Session(folder)


def masks_in_use(session: Session) -> tuple[str, ...]:
    return tuple(source.masks for source in Session(session.path).manifest.footage.cameras)


def files_of(session: Session) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in sorted(session.path.rglob("*")) if path.is_file()}


@pytest.mark.slow
def test_the_masks_are_the_sessions_own_until_others_are_chosen(session: Session, walk: Rendered) -> None:
    made = set_up_background(session, "person")
    assert made.knobs == {"background_model": "auto"}
    assert made.notes == ()
    assert all(view.agreement > 0.85 for view in made.quality.views)
    now_there = Session(session.path)
    footage = now_there.footage()
    for camera in ("cam1", "cam2", "cam3"):
        for frame in range(FRAMES):
            mask = footage.mask(camera, frame)
            assert mask is not None
            assert overlap(mask, walk.masks[camera, frame]) >= 0.9, (camera, frame)
    footage.close()
    assert session_settings(now_there).evidence.background_model == "auto"
    # Other frames are the same camera's first ones now, of which no masks were made.
    changed = change_footage(now_there, offsets={"cam3": 1})
    assert masks_in_use(session) == ("masks/cam1", "", "")
    assert any("--source person" in note for note in changed.notes)
    assert not (session.path / PERSON_MASKS).exists()


def test_masks_that_came_with_the_footage_can_be_chosen_again(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studio.runs.setup.background_setup.person_masks", drawn)
    set_up_background(session, "person", tune=False)
    assert masks_in_use(session) == tuple(f"person_masks/1/cam{n}" for n in (1, 2, 3))
    assert json.loads((session.path / "evidence.json").read_text())["schema"] == 3
    set_up_background(Session(session.path), "person", tune=False)
    assert masks_in_use(session) == tuple(f"person_masks/2/cam{n}" for n in (1, 2, 3))
    assert [path.name for path in (session.path / PERSON_MASKS).iterdir()] == ["2"]
    set_up_background(Session(session.path), "median", tune=False)
    assert read_evidence(session).knobs == {"background_model": "median"}
    with pytest.raises(FootageError, match=f"camera cam2 in session '{session.name}'"):
        set_up_background(Session(session.path), "masks")
    manifest = Session(session.path).manifest
    assert manifest.footage.cameras[0].masks == "person_masks/2/cam1"
    (session.path / "evidence.json").write_text(
        json.dumps({"schema": 2, "knobs": {}, "given_masks": {f"cam{n}": "masks/cam1" for n in (1, 2, 3)}})
    )
    set_up_background(Session(session.path), "masks", tune=False)
    assert masks_in_use(session) == ("masks/cam1",) * 3
    assert read_evidence(session).knobs == {"background_model": "mask"}
    assert not (session.path / PERSON_MASKS).exists()


def drawn(cameras: tuple[Camera, ...], *_: object) -> list[PersonMasks]:
    """Masks without a network, of which cam2 has none in the last frame."""
    mask = np.zeros(SIZE[::-1], np.uint8)
    mask[10:20, 30:60] = 255
    return [
        PersonMasks(frame, {camera.name: mask for camera in cameras}, ("cam2",) if frame == 2 else ())
        for frame in (1, 0, 2)
    ]


def test_who_is_not_seen_is_named(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studio.runs.setup.background_setup.person_masks", drawn)
    assert set_up_background(session, "person", tune=False).notes == ("cam2: nobody was seen in frame 2.",)
    assert frames_in_words([5, 0, 1, 2, 9]) == "frames 0 to 2, 5, 9"
    assert frames_in_words(range(0, 20, 2)) == "frames 0, 2, 4, 6, 8, 10 and 4 more"


@pytest.mark.parametrize("again", [False, True])
@pytest.mark.parametrize("fault", ["cancelled", "disk full"])
def test_what_fails_leaves_all_as_it_was(
    session: Session, monkeypatch: pytest.MonkeyPatch, fault: str, *, again: bool
) -> None:
    monkeypatch.setattr("studio.runs.setup.background_setup.person_masks", drawn)
    if again:
        set_up_background(session, "person", tune=False)
        session = Session(session.path)
    before = files_of(session)
    if fault == "cancelled":

        def cancelled(*_: object, **__: object) -> list[PersonMasks]:
            raise WorkCancelledError("It was cancelled.", "")

        # Once the masks are written, and in use.
        monkeypatch.setattr("studio.runs.setup.background_setup.mask_quality", cancelled)
        with pytest.raises(WorkCancelledError):
            set_up_background(session, "person")
    else:
        write, written = Path.write_bytes, []

        def full(path: Path, content: bytes) -> int:
            written.append(path)
            if len(written) > 6:
                raise OSError(errno.ENOSPC, "No space left on device")
            return write(path, content)

        monkeypatch.setattr(Path, "write_bytes", full)
        with pytest.raises(SessionError, match="disk full"):
            set_up_background(session, "person", tune=False)
        monkeypatch.undo()
    assert files_of(session) == before
    assert (session.path / PERSON_MASKS).exists() == again


@dataclass
class Shown:
    """Footage from memory."""

    cameras: tuple[Camera, ...]
    shown: Mapping[tuple[str, int], Bytes]
    frame_count: int
    fps: float
    gone: frozenset[tuple[str, int]] = frozenset()

    def picture(self, camera: str, frame: int) -> Bytes:
        return self.shown[camera, frame]

    def absent(self, frame: int) -> frozenset[str]:
        return frozenset(camera for camera, at in self.gone if at == frame)

    def size(self, _: str) -> tuple[int, int]:
        return SIZE

    def masks(self, progress: Callable[[str, int, int], None] = no_progress) -> dict[int, PersonMasks]:
        found = person_masks(self.cameras, self, progress)  # pyright: ignore[reportArgumentType]
        return {one.frame: one for one in found}


@pytest.mark.slow
def test_somebody_comes_and_goes(walk: Rendered) -> None:
    """Nobody in frames 0 and 4; he is found in frame 2 and followed back to 1; a camera stops in frame 3."""
    cameras = walk.cameras[1:3]
    shown = {
        (camera.name, frame): walk.empty[camera.name]
        if frame in (0, 4)
        else walk.pictures[camera.name, frame - 1]
        for camera in cameras
        for frame in range(5)
    }
    footage = Shown(cameras, shown, 5, 8.0, frozenset([("cam2", 3)]))
    reports: list[tuple[int, int]] = []
    found = footage.masks(lambda _, done, total: reports.append((done, total)))
    assert sorted(found) == [0, 1, 2, 3, 4]
    assert found[0].unseen == found[4].unseen == ("cam2", "cam3")
    assert found[1].unseen == found[2].unseen == found[3].unseen == ()
    assert not found[0].masks["cam3"].any()
    assert not found[3].masks["cam2"].any()
    for frame, camera in ((1, "cam2"), (1, "cam3"), (2, "cam2"), (3, "cam3")):
        assert overlap(found[frame].masks[camera], walk.masks[camera, frame - 1]) >= 0.9, (frame, camera)
    assert reports == sorted(reports)
    assert reports[-1] == (5, 5)


@pytest.mark.slow
def test_nobody_at_all_is_an_error(walk: Rendered) -> None:
    shown = {(camera.name, 0): walk.empty[camera.name] for camera in walk.cameras[1:3]}
    with pytest.raises(FootageError, match="No camera sees a person"):
        Shown(walk.cameras[1:3], shown, 1, FPS).masks()


@pytest.mark.slow
def test_whom_most_cameras_see_is_followed(walk: Rendered) -> None:
    """Two of three cameras see another one as well, who is nearer to them: one of them alone would take him."""
    other = rendered_walk(1, at=(-1000.0, 900.0), seed=5)
    cameras, shown = walk.cameras[:3], {}
    for camera in cameras:
        key = camera.name, 0
        shown[key] = walk.pictures[key].copy()
        if camera.name != "cam2":
            beside = other.masks[key] > 0
            assert not (walk.masks[key][beside] > 0).any()
            shown[key][beside] = other.pictures[key][beside]
    found = Shown(cameras, shown, 1, FPS).masks()[0]
    assert found.unseen == ()
    for camera in cameras:
        assert overlap(found.masks[camera.name], walk.masks[camera.name, 0]) >= 0.9, camera.name
    alone = Shown(cameras[2:], shown, 1, FPS).masks()[0]
    assert overlap(alone.masks["cam3"], other.masks["cam3", 0]) >= 0.9
