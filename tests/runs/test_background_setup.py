"""Backgrounds of a session: files, exclusions, knobs that new runs begin with, plates cleaned by the other views."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from toy_footage import write_video

from studio.evidence.backgrounds import Backgrounds
from studio.evidence.pipeline import EvidenceMaker
from studio.footage.capture.calibration_files import write_calibration
from studio.foundations.errors import CalibrationError, FootageError, NotFoundError, SettingsError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.cameras import placed_camera
from studio.runs.new_run import prepare_run
from studio.runs.setup.background_setup import set_up_background
from studio.runs.setup.clean_plates import median_of_empty
from studio.runs.setup.session_settings import session_settings
from studio.sessions.background_files import (
    add_polygon,
    read_evidence,
    set_backgrounds,
    set_region,
    use_given_backgrounds,
    write_evidence,
)
from studio.sessions.importers.importing import ImportOptions, import_source
from studio.sessions.session import Session

FRAMES, SIZE = 12, (160, 120)


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three cameras see a dark post that wanders through a room of patches."""
    folder = tmp_path_factory.mktemp("post")
    places = [(3200.0, 0.0), (-1600.0, 2800.0), (-1600.0, -2800.0)]
    cameras = tuple(
        placed_camera(f"cam{n}", (x, y, 1500.0), (0.0, 0.0, 900.0), size=SIZE, focal_px=110.0)
        for n, (x, y) in enumerate(places)
    )
    (folder / "calibration").mkdir()
    write_calibration(cameras, folder / "calibration" / "cameras.toml")
    for n, camera in enumerate(cameras):
        (folder / "pictures" / camera.name).mkdir(parents=True)
        for frame in range(FRAMES):
            picture = empty(n)
            x, top, bottom = post(camera, frame)
            picture[max(0, top) : bottom, max(0, x - 8) : x + 8] = (20, 15, 25)
            cv2.imwrite(str(folder / "pictures" / camera.name / f"{frame:03d}.png"), picture)
    return folder


def empty(camera: int) -> np.ndarray:
    """The room as a camera sees it, (H, W, 3) uint8."""
    patches = np.random.default_rng(camera).integers(90, 220, (SIZE[1] // 20, SIZE[0] // 20, 3))
    return np.kron(patches, np.ones((20, 20, 1))).astype(np.uint8)


def post(camera: Camera, frame: int) -> tuple[int, int, int]:
    """Column of the post in a frame, and its top and bottom row."""
    angle = 2.0 * np.pi * frame / FRAMES
    at = np.array([500.0 * np.cos(angle), 500.0 * np.sin(angle)])
    pixels, _ = project(camera, np.array([[*at, 0.0], [*at, 1800.0]]))
    return round(float(pixels[0, 0])), round(float(pixels[1, 1])), round(float(pixels[0, 1]))


@pytest.fixture
def session(source: Path, tmp_path: Path) -> Session:
    """The post as a session."""
    return import_source(source, tmp_path / "post", ImportOptions(fps=30.0)).session


def plates(folder: Path, change: bool) -> dict[str, Path]:
    """Pictures of the empty rooms; with a bright visitor in camera 0's."""
    found = {}
    for n in range(3):
        picture = empty(n)
        if change and n == 0:
            picture[30:110, 20:40] = (250, 250, 0)
        found[f"cam{n}"] = folder / f"plate{n}.png"
        cv2.imwrite(str(found[f"cam{n}"]), picture)
    return found


def test_plates_are_taken_over_and_wrong_ones_refused(session: Session, tmp_path: Path) -> None:
    changed = set_backgrounds(session, plates(tmp_path, change=False))
    assert [source.background for source in changed.manifest.footage.cameras] == [
        f"background/cam{n}.png" for n in range(3)
    ]
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((60, 80, 3), np.uint8))
    with pytest.raises(FootageError, match="80x60"):
        set_backgrounds(changed, {"cam0": tmp_path / "small.png"})
    with pytest.raises(NotFoundError, match="cam9"):
        set_backgrounds(changed, {"cam9": tmp_path / "small.png"})


def test_what_is_excluded_is_in_no_mask(session: Session, tmp_path: Path) -> None:
    changed = set_backgrounds(session, plates(tmp_path, change=False))
    count = add_polygon(changed, "exclusions", "cam0", np.array([[0, 0], [159, 0], [159, 119], [0, 119]]))
    assert count == 160 * 120
    footage = changed.footage()
    maker = EvidenceMaker(
        changed.cameras(), footage, Backgrounds(footage), session_settings(changed).evidence, "none"
    )
    views = maker.evidence(0).views
    footage.close()
    assert not views[0].mask.any()
    assert views[1].mask.any()
    with pytest.raises(FootageError, match="160x119"):
        set_region(
            changed, "exclusions", "cam0", cv2.imencode(".png", np.zeros((119, 160), np.uint8))[1].tobytes()
        )
    assert set_region(changed, "exclusions", "cam0", b"") == 0


@pytest.mark.slow
def test_who_stood_in_a_plate_is_cleaned_away(session: Session, tmp_path: Path) -> None:
    changed = set_backgrounds(session, plates(tmp_path, change=True))
    setup = set_up_background(changed, "combined", tune=False)
    now = Session(session.path)
    kept = cv2.imread(str(session.path / now.manifest.footage.cameras[0].background))
    wrong = np.abs(kept.astype(int) - empty(0)).max(axis=2) > 20
    assert wrong[30:110, 20:40].mean() < 0.05
    assert wrong.mean() < 0.04
    assert setup.knobs["background_model"] == "gaussian"
    back = use_given_backgrounds(now)
    assert back.manifest.footage.cameras[0].background == "background/cam0.png"


@pytest.mark.slow
def test_a_run_begins_with_the_sessions_knobs(session: Session) -> None:
    set_up_background(session, "median", knobs={"mask_threshold": 9.0}, tune=False)
    assert read_evidence(session).knobs["background_model"] == "median"
    run = prepare_run(session, body="human31", start_pose=session.body("human31").neutral)
    assert run.record.settings["mask_threshold"] == 9.0
    assert run.record.settings["background_model"] == "median"
    other = prepare_run(
        session, body="human31", start_pose=session.body("human31").neutral, knobs={"mask_threshold": 5.0}
    )
    assert other.record.settings["mask_threshold"] == 5.0


def test_how_masks_are_made_is_read_from_older_files(session: Session) -> None:
    """Version 1 knew no masks of the studio's own."""
    path = session.path / "evidence.json"
    path.write_text(
        '{"schema": 1, "knobs": {"mask_threshold": 5.0}, "given": {"cam0": "background/cam0.png"}}'
    )
    found = read_evidence(session)
    assert (found.knobs, found.given, found.given_masks) == (
        {"mask_threshold": 5.0},
        {"cam0": "background/cam0.png"},
        {},
    )
    write_evidence(session, found)
    assert json.loads(path.read_text())["schema"] == 3


def test_sources_that_are_not_there_are_refused(session: Session) -> None:
    with pytest.raises(FootageError, match="no plate"):
        set_up_background(session, "plate")
    with pytest.raises(FootageError, match="no background source"):
        set_up_background(session, "guess")  # pyright: ignore[reportArgumentType]
    with pytest.raises(SettingsError):
        set_up_background(session, "median", knobs={"mask_threshold": -1.0})
    assert read_evidence(session).knobs == {}


def test_a_picture_is_no_clip_and_a_clip_no_picture(session: Session, tmp_path: Path) -> None:
    given = set_backgrounds(session, plates(tmp_path, change=False))
    with pytest.raises(FootageError, match="cam0 is a picture, no clip"):
        set_up_background(given, "clip", tune=False)
    assert set_up_background(given, "plate", tune=False).source == "plate"
    clips = {
        name: write_video(tmp_path / f"{name}.mp4", [cv2.imread(str(file))] * 3)
        for name, file in plates(tmp_path, change=False).items()
    }
    given = set_backgrounds(Session(session.path), clips)
    with pytest.raises(FootageError, match="cam0 is a video, no plate"):
        set_up_background(given, "plate", tune=False)
    assert set_up_background(given, "clip", tune=False).source == "clip"


def test_medians_are_of_empty_frames_only() -> None:
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 255, (5, 8, 8, 3), dtype=np.uint8)
    taken = np.zeros((5, 2, 2), np.uint8)
    taken[:3, 0, 0] = 1
    taken[:, 1, 1] = 1
    fallback = np.full((8, 8, 3), 7, np.uint8)
    out, count = median_of_empty(frames, taken, fallback)
    expected = np.floor(np.median(frames[3:, 1, 2].astype(float), axis=0) + 0.5)
    assert (out[1, 2] == expected).all()
    assert (out[6, 6] == 7).all()
    assert count[1, 2] == 2
    assert count[6, 6] == 0


def test_masks_are_set_up_where_nothing_in_front_can_be_looked_for(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    changed = set_backgrounds(session, plates(tmp_path, change=False))
    thing = np.zeros(SIZE[::-1], np.uint8)
    thing[:20, :30] = 255
    place = "studio.runs.setup.background_setup.find_things_in_front"
    monkeypatch.setattr(place, lambda *_: {"cam1": thing})
    notes = set_up_background(changed, "plate", tune=False).notes
    assert any("cam1: something stands in front" in note and "3.1 % of the picture" in note for note in notes)
    assert read_evidence(changed).found_in_front == ["cam1"]

    def refuse(*_: object) -> None:
        raise CalibrationError("No two cameras see a common place.", "Check the size.")

    monkeypatch.setattr(place, refuse)
    notes = set_up_background(changed, "plate", tune=False).notes
    assert notes == ("Nothing was looked for in front of the subject: No two cameras see a common place.",)
    assert set_up_background(changed, "plate", tune=False, find_in_front=False).notes == ()
