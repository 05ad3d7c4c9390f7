"""A body from its film, by the verb and the command: what is read, refused and saved."""

from pathlib import Path

import pytest
from command_line import answer_of, call, refusal_of
from filmed_bodies import cameras_around, clicks_on, varied_poses, write_session

import studio
from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions
from studio.foundations.csv_text import as_csv
from studio.foundations.errors import BodyError, FootageError
from studio.sessions.landmark_clicks import COLUMNS, LANDMARKS_NAME, keep_clicks, stored_clicks
from studio.sessions.session import Session

BODY = with_dimensions(load_body("planar_arm4"), {"link_2_length": 400.0})
JOINTS = ("Root", "Joint1", "Joint2", "Joint3", "Tip")
CAMERAS = cameras_around(2500.0, 900.0, 600.0, 3)


@pytest.fixture(autouse=True)
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Session:
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path))
    return write_session(tmp_path / "arm", BODY, varied_poses(BODY, 4), CAMERAS, masks=False)


@pytest.fixture
def clicks(tmp_path: Path) -> Path:
    rows = [
        (one.frame, one.camera, one.landmark, one.x, one.y)
        for one in clicks_on(BODY, JOINTS, varied_poses(BODY, 4), CAMERAS)
    ]
    path = tmp_path / "clicks.csv"
    path.write_text(as_csv([COLUMNS, *rows]))
    return path


def test_the_command_says_what_it_measured_and_saves_the_body(clicks: Path, tmp_path: Path) -> None:
    said = call(
        "body-from-film arm --like planar_arm4 --frames 0,1,2 --as long-arm --landmarks", clicks
    ).stdout
    assert "link_2_length" in said
    assert "250.0 →" in said
    assert "link 2 " in said
    assert "In 1 frame not used they are" in said
    assert f"Saved as 'long-arm' ({tmp_path / 'bodies' / 'long-arm.toml'})" in said
    assert load_body("long-arm", (tmp_path / "bodies",)).dimensions["link_2_length"] == pytest.approx(
        400, rel=0.02
    )
    assert "There is a body 'long-arm' already" in refusal_of(
        "body-from-film arm --as long-arm --landmarks", clicks
    )
    told = answer_of("body-from-film arm --as long-arm --replace --landmarks", clicks)
    assert told["body"] == "long-arm"
    assert {one["name"]: one["decided"] for one in told["sizes"]}["link_2_length"] is True
    assert studio.subject("arm", body="long-arm").dimensions["link_2_length"] == pytest.approx(400, rel=0.02)


def test_clicks_that_the_session_keeps_are_taken_where_no_file_is_given(session: Session) -> None:
    assert "No landmarks were clicked" in refusal_of("body-from-film arm")
    keep_clicks(session, clicks_on(BODY, JOINTS, varied_poses(BODY, 4), CAMERAS))
    made = studio.body_from_film("arm")
    assert made.file is None
    assert made.body.dimensions["link_2_length"] == pytest.approx(400, rel=0.02)
    path = session.path / LANDMARKS_NAME
    path.write_text(f"{path.read_text()}99,cam1,Tip,5,5\n0,gone,Tip,5,5\n")
    assert len(stored_clicks(session)) == 4 * 3 * 5  # without those for which there is no footage any more
    keep_clicks(session, [])
    assert not (session.path / LANDMARKS_NAME).exists()


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("0,cam9,Tip,5,5", "there is no camera 'cam9'"),
        ("9,cam1,Tip,5,5", "there is no frame 9"),
        ("0,cam1,Tip,5,nan", "lies outside the picture"),
        ("0,cam1,Tip,5,9000", "lies outside the picture of cam1, 640x480"),
        ("0,cam1,Tip,five,5", "has a row that is no click: 0,cam1,Tip,five,5"),
        ("0,cam1,,5,5", "names no landmark"),
        ("0,cam1", "has a row that is no click"),
        ("0,cam1,Tip,5,5\n0,cam1,Tip,6,6", "'Tip' is given twice in cam1, frame 0"),
    ],
)
def test_a_file_of_clicks_that_does_not_fit_is_refused(tmp_path: Path, row: str, words: str) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text(f"frame,camera,landmark,x,y\n{row}\n")
    with pytest.raises(FootageError, match=words):
        studio.body_from_film("arm", path)


def test_a_file_without_the_columns_and_an_unknown_body_are_refused(tmp_path: Path, clicks: Path) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text("frame,view,landmark,x,y\n0,cam1,Tip,5,5\n")
    with pytest.raises(FootageError, match="no column 'camera'"):
        studio.body_from_film("arm", path)
    with pytest.raises(BodyError, match="no body 'snake'"):
        studio.body_from_film("arm", clicks, like="snake")
    with pytest.raises(BodyError, match="no landmark 'Root'"):
        studio.body_from_film("arm", clicks, like="mouse")
