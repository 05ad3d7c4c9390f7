"""Masks of anything from brush strokes: carried both ways, corrected later, kept as files, refused when wrong."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from patched_ball import FRAMES, PatchedBall, patched_ball
from rendered_people import overlap

from studio.evidence.stroke_cut import StrokeCut
from studio.evidence.strokes import Stroke
from studio.foundations.arrays import Bytes
from studio.foundations.errors import FootageError, NotFoundError, SessionError, WorkCancelledError
from studio.runs.setup.background_setup import set_up_background
from studio.runs.setup.stroke_masks import kept_frames, preview_mask
from studio.sessions import stroke_files
from studio.sessions.background_files import STROKE_MASKS, forget_unused_masks, made_masks
from studio.sessions.footage_changes import change_footage
from studio.sessions.session import Session
from studio.sessions.stroke_files import (
    made_of_strokes,
    read_strokes,
    replace_strokes,
    restore_strokes,
    stored_strokes,
    strokes_of_file,
    write_strokes,
)


@pytest.fixture
def ball(tmp_path: Path) -> PatchedBall:
    return patched_ball(tmp_path / "ball")


def overlaps(ball: PatchedBall) -> dict[tuple[str, int], float]:
    """Of the masks in use with the true ones, by camera and frame."""
    footage = Session(ball.session.path).footage()
    found: dict[tuple[str, int], float] = {}
    for key, true in ball.masks.items():
        mask = footage.mask(*key)
        assert mask is not None
        found[key] = overlap(mask, true)
    footage.close()
    return found


def mask_files(session: Session) -> dict[str, bytes]:
    """The newest masks made of strokes, by camera and name."""
    made = made_of_strokes(Session(session.path))
    return {
        f"{path.parent.name}/{path.name}": path.read_bytes() for path in sorted(made.place.glob("*/*.png"))
    }


@pytest.mark.parametrize("frame", [0, 3])
def test_strokes_in_one_frame_cut_the_subject_out_of_all(ball: PatchedBall, frame: int) -> None:
    made = set_up_background(ball.session, "strokes", strokes=ball.strokes(frame))
    assert made.knobs == {"background_model": "auto"}
    assert all(view.agreement > 0.85 for view in made.quality.views)
    found = overlaps(ball)
    assert len(found) == 3 * FRAMES
    assert min(found.values()) >= 0.93, found
    assert read_strokes(ball.session) == ball.strokes(frame)
    assert Session(ball.session.path).manifest.footage.cameras[0].masks == "stroke_masks/1/cam0"


def test_later_strokes_change_only_what_follows_as_if_all_were_made_again(
    ball: PatchedBall, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_up_background(ball.session, "strokes", strokes=ball.strokes(1), tune=False)
    before = mask_files(ball.session)
    x, y, r = ball.circles["cam0", 4]
    # The subject without its upper half from frame 4 on.
    away = Stroke(
        camera="cam0", frame=4, kind="outside", width=r, points=((x - r, y - 0.6 * r), (x + r, y - 0.6 * r))
    )
    strokes = (*ball.strokes(1), away)
    cuts: list[object] = []
    cut = StrokeCut.cut

    def counted(self: StrokeCut, *args: object, **more: object) -> Bytes:
        cuts.append(args)
        return cut(self, *args, **more)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(StrokeCut, "cut", counted)
    made = set_up_background(Session(ball.session.path), "strokes", strokes=strokes, tune=False)
    assert len(cuts) == 2
    assert made.notes == (
        "cam0: frames 0 to 3 as they were.",
        "cam1: frames 0 to 5 as they were.",
        "cam2: frames 0 to 5 as they were.",
    )
    after = mask_files(ball.session)
    assert {name for name in before if before[name] != after[name]} == {"cam0/000004.png", "cam0/000005.png"}
    fresh = patched_ball(tmp_path / "fresh")
    set_up_background(fresh.session, "strokes", strokes=strokes, tune=False)
    assert mask_files(fresh.session) == after
    again = set_up_background(Session(ball.session.path), "strokes", tune=False)
    assert again.notes == ("The strokes are as they were: the masks made of them are used again.",)
    assert mask_files(ball.session) == after


def test_frames_that_strokes_cannot_change_are_kept() -> None:
    def stroke(frame: int, width: float = 2.0, kind: str = "inside") -> Stroke:
        return Stroke(camera="a", frame=frame, kind=kind, width=width, points=((1.0, 1.0),))  # pyright: ignore[reportArgumentType]

    first = {3: (stroke(3),)}
    assert kept_frames(first, first, 10) == range(10)
    assert kept_frames({**first, 7: (stroke(7),)}, first, 10) == range(7)
    assert kept_frames(first, {**first, 7: (stroke(7),)}, 10) == range(7)
    outside = (stroke(1, kind="outside"),)
    assert kept_frames({**first, 1: outside}, first, 10) == range(2, 10)
    assert kept_frames({**first, 1: outside, 5: outside}, first, 10) == range(2, 5)
    assert kept_frames({1: (stroke(1),), **first}, first, 10) == range(0)
    assert kept_frames({3: (stroke(3, 9.0),)}, first, 10) == range(0)


def test_other_pictures_have_other_masks(ball: PatchedBall) -> None:
    """A change of the footage's offsets makes the kept masks those of other frames."""
    set_up_background(ball.session, "strokes", strokes=ball.strokes(1), tune=False)
    changed = change_footage(Session(ball.session.path), offsets={"cam2": 1})
    assert any("--source" in note for note in changed.notes)
    assert any("brush strokes are of the pictures as they were" in note for note in changed.notes)
    assert made_of_strokes(Session(ball.session.path)) is None
    set_up_background(Session(ball.session.path), "strokes", tune=False)
    assert made_of_strokes(Session(ball.session.path)) is not None


def test_masks_made_of_strokes_stay_while_another_source_is_used(ball: PatchedBall) -> None:
    set_up_background(ball.session, "strokes", strokes=ball.strokes(1), tune=False)
    set_up_background(Session(ball.session.path), "threshold", tune=False)
    now = Session(ball.session.path)
    forget_unused_masks(now)
    assert made_of_strokes(now) is not None
    assert set_up_background(now, "strokes", tune=False).notes[0].startswith("The strokes are as they were")


def test_masks_that_others_are_making_stay(ball: PatchedBall, tmp_path: Path) -> None:
    """Their folder is unfinished, or its masks are not in use yet; who is alone removes what nobody uses."""
    set_up_background(ball.session, "strokes", strokes=ball.strokes(1), tune=False)
    session = Session(ball.session.path)
    with made_masks(session, STROKE_MASKS) as made:
        unused = made.folder.with_name("7")
        unused.mkdir()
        other = subprocess.Popen(
            [sys.executable, "-c", AT_WORK, str(session.path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert other.stdin is not None
        assert other.stdout is not None
        assert other.stdout.readline() == b"at work\n"
        set_up_background(Session(session.path), "threshold", tune=False)
        assert made.folder.is_dir()
        assert unused.is_dir()
        other.communicate(b"end\n")
        assert other.returncode == 0
    now = Session(session.path)
    assert (now.path / now.manifest.footage.cameras[0].masks).is_dir()
    forget_unused_masks(now)
    assert not unused.exists()


AT_WORK = """
import sys
from pathlib import Path
from studio.sessions.work_under_way import working_on
with working_on(Path(sys.argv[1]), "background"):
    print("at work", flush=True)
    sys.stdin.readline()
"""


@pytest.mark.parametrize(
    ("entry", "wrong"),
    [
        ({"camera": "cam9"}, "no camera 'cam9'"),
        ({"frame": FRAMES}, "no frame 6"),
        ({"frame": -1}, "no frame -1"),
        ({"width": 0}, "1 to 2000 pixels wide"),
        ({"points": []}, "0 points"),
        ({"points": [[900, 10]]}, "outside the picture of 240x180"),
        ({"kind": "beside"}, "kind"),
        ({"points": [[1, 2, 3]]}, "points"),
        ({"brush": 3}, "brush"),
    ],
)
def test_a_file_of_strokes_is_refused_with_the_reason(
    ball: PatchedBall, tmp_path: Path, entry: dict[str, object], wrong: str
) -> None:
    stroke = {"camera": "cam0", "frame": 0, "kind": "inside", "width": 3, "points": [[10, 20]]}
    path = tmp_path / "strokes.json"
    path.write_text(json.dumps({"strokes": [stroke]}))
    assert strokes_of_file(ball.session, path)[0].points == ((10.0, 20.0),)
    path.write_text(json.dumps({"strokes": [stroke, stroke | entry]}))
    with pytest.raises((FootageError, SessionError), match=wrong):
        strokes_of_file(ball.session, path)
    path.write_text("[1, 2")
    with pytest.raises(SessionError, match=r"strokes\.json"):
        strokes_of_file(ball.session, path)


def test_every_camera_needs_a_stroke_inside(ball: PatchedBall) -> None:
    with pytest.raises(FootageError, match="Camera cam1 has no stroke inside"):
        set_up_background(ball.session, "strokes", strokes=ball.strokes(0, "cam0"))
    assert read_strokes(ball.session) == ()


def test_what_is_cancelled_leaves_all_as_it_was(ball: PatchedBall) -> None:
    write_strokes(ball.session, ball.strokes(0))
    before = {str(path): path.read_bytes() for path in ball.session.path.rglob("*") if path.is_file()}
    seen: list[int] = []

    def cancelled(_step: str, done: int, total: int) -> None:
        seen.append(done)
        assert total == 3 * FRAMES
        if done >= 4:
            raise WorkCancelledError("It was cancelled.", "")

    with pytest.raises(WorkCancelledError):
        set_up_background(ball.session, "strokes", strokes=ball.strokes(2), progress=cancelled)
    assert seen[:4] == [1, 2, 3, 4]
    assert {str(path): path.read_bytes() for path in ball.session.path.rglob("*") if path.is_file()} == before


def test_the_preview_is_the_mask_that_is_made(ball: PatchedBall) -> None:
    """In the strokes' own frame the same; in the next one, with masks made before, about the same."""
    strokes = ball.strokes(1)
    alone = preview_mask(ball.session, "cam1", 1, strokes)
    assert alone is not None
    assert preview_mask(ball.session, "cam1", 3, strokes) is None
    assert preview_mask(ball.session, "cam0", 1, ball.strokes(1, "cam1")) is None
    set_up_background(ball.session, "strokes", strokes=strokes, tune=False)
    now = Session(ball.session.path)
    footage = now.footage()
    assert (footage.mask("cam1", 1) == alone).all()
    kept = preview_mask(now, "cam1", 3, strokes)
    assert kept is not None
    assert (footage.mask("cam1", 3) == kept).all()
    x, y, r = ball.circles["cam1", 3]
    more = Stroke(camera="cam1", frame=3, kind="outside", width=r, points=((x, y - r), (x, y - r)))
    changed = preview_mask(now, "cam1", 3, (*strokes, more))
    footage.close()
    assert not changed[int(y - r) : int(y - 0.7 * r), int(x)].any()
    assert overlap(changed, ball.masks["cam1", 3]) > 0.6


def test_a_models_projection_finds_what_motion_lost(ball: PatchedBall) -> None:
    """The subject is suddenly far from where it was: within reach of nothing but the projection."""
    footage = ball.session.footage()
    cut = StrokeCut()
    first, there = footage.picture("cam2", 5), footage.picture("cam2", 0).copy()
    cut.begin(first, ball.strokes(5, "cam2"))
    there[:, 130:] = first[:, 130:]
    x, y, r = (round(value) for value in ball.circles["cam2", 5])
    box, far = np.s_[y - r : y + r + 1, x - r : x + r + 1], np.s_[y - r : y + r + 1, 200 - r : 200 + r + 1]
    true = np.zeros_like(ball.masks["cam2", 5])
    true[far] = ball.masks["cam2", 5][box]
    there[true > 0] = first[ball.masks["cam2", 5] > 0]
    there[ball.masks["cam2", 5] > 0] = 120
    there[ball.masks["cam2", 0] > 0] = 120
    assert overlap(cut.copy().cut(there), true) < 0.5
    assert overlap(cut.cut(there, (), true), true) > 0.9
    footage.close()


def test_a_run_is_projected_by_its_frames(ball: PatchedBall) -> None:
    with pytest.raises(NotFoundError, match="no run 'none'"):
        set_up_background(ball.session, "strokes", strokes=ball.strokes(0), run="none")
    assert made_of_strokes(ball.session) is None


def test_strokes_that_the_footage_has_no_place_for_any_more_hinder_nothing(ball: PatchedBall) -> None:
    strokes = ball.strokes(0)
    late = Stroke(camera="cam1", frame=FRAMES - 1, kind="outside", width=4.0, points=((5.0, 5.0),))
    gone = Stroke(camera="gone", frame=0, kind="inside", width=4.0, points=((5.0, 5.0),))
    write_strokes(ball.session, (*strokes, late))
    restore_strokes(ball.session, (*strokes, late, gone))
    session = change_footage(ball.session, offsets={"cam0": 1}).session
    assert session.manifest.frame_count == FRAMES - 1
    assert read_strokes(session) == strokes
    set_up_background(session, "strokes", tune=False)
    assert stored_strokes(session) == (*strokes, late, gone)

    def cancelled(*_: object) -> None:
        raise WorkCancelledError("Cancelled.")

    with pytest.raises(WorkCancelledError):
        set_up_background(Session(session.path), "strokes", strokes=ball.strokes(1), progress=cancelled)
    assert stored_strokes(session) == (*strokes, late, gone)


def test_strokes_of_two_cameras_kept_at_once_are_both_kept(
    ball: PatchedBall, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One camera's are being written while the other's are to be."""
    written, wait = threading.Event(), threading.Event()
    restore = stroke_files.restore_strokes

    def slow(session: Session, strokes: Sequence[Stroke]) -> None:
        if not written.is_set():
            written.set()
            wait.wait(1.0)
        restore(session, strokes)

    monkeypatch.setattr(stroke_files, "restore_strokes", slow)
    with ThreadPoolExecutor(2) as threads:
        first = threads.submit(replace_strokes, ball.session, "cam0", ball.strokes(0, "cam0"))
        assert written.wait(20.0)
        second = threads.submit(replace_strokes, ball.session, "cam1", ball.strokes(0, "cam1"))
        time.sleep(0.2)
        wait.set()
        first.result()
        second.result()
    assert {one.camera for one in read_strokes(ball.session)} == {"cam0", "cam1"}
