"""Clicked landmarks in a file and in a session: what is read, what is refused, what changed footage takes away."""

from pathlib import Path

import pytest
from toy_session import make_session

from studio.foundations.errors import FootageError
from studio.sessions.landmark_clicks import LandmarkClick, clicks_of_file, keep_clicks, stored_clicks
from studio.sessions.session import Session

HEAD = "frame,camera,landmark,x,y\n"


@pytest.fixture
def toy(tmp_path: Path) -> Session:
    return make_session(tmp_path / "toy", frames=3)


def camera(session: Session) -> str:
    return session.manifest.footage.cameras[0].name


def test_columns_stand_in_any_order_and_others_and_empty_lines_are_passed_over(
    toy: Session, tmp_path: Path
) -> None:
    name, path = camera(toy), tmp_path / "a.csv"
    path.write_text(
        f"x;by;landmark;y;camera;frame\n\n 12.5 ;me;arm tip;7;{name};2\n;;;;;\n3;;hip;4;{name};0;;\n"
    )
    clicks = clicks_of_file(toy, path)
    assert clicks == (LandmarkClick(2, name, "arm tip", 12.5, 7.0), LandmarkClick(0, name, "hip", 3.0, 4.0))
    keep_clicks(toy, clicks)
    assert stored_clicks(toy) == clicks
    keep_clicks(toy, ())
    assert stored_clicks(toy) == ()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no column 'frame'"),
        ("frame,camera,landmark,x\n", "no column 'y'"),
        ("frame,frame,camera,landmark,x,y\n", "no column 'frame', or several"),
        (f"{HEAD}0,CAM,hip,412,5,230\n", "no click: 0,CAM,hip,412,5,230"),
        (f"{HEAD}1.5,CAM,hip,4,5\n", "no click: 1.5,CAM"),
        (f"{HEAD}0,CAM,hip\n", "no click: 0,CAM,hip"),
        (f"{HEAD}0,CAM,{'a' * 200_000},1,2\n", "is not a CSV file of clicked landmarks"),
        (f'{HEAD}0,CAM,"hip,1,2\n', "is not a CSV file of clicked landmarks"),
        (f"{HEAD}0,CAM,hip,nan,5\n", "lies outside the picture"),
        (f"{HEAD}0,CAM,hip,1e9,5\n", "lies outside the picture"),
        (f"{HEAD}3,CAM,hip,4,5\n", "there is no frame 3; the footage has frames 0 to 2"),
        (f"{HEAD}0,nobody,hip,4,5\n", "there is no camera 'nobody'"),
        (f"{HEAD}0,CAM,,4,5\n", "names no landmark"),
        (f"{HEAD}0,CAM,hip,4,5\n0,CAM,hip,5,5\n", "'hip' is given twice"),
    ],
)
def test_what_is_no_click_is_named(toy: Session, tmp_path: Path, text: str, words: str) -> None:
    path, name = tmp_path / "a.csv", camera(toy)
    path.write_text(text.replace("CAM", name))
    with pytest.raises(FootageError) as no:
        clicks_of_file(toy, path)
    assert words.replace("CAM", name) in no.value.message
    assert no.value.hint
