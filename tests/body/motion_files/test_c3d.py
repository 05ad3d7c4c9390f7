"""C3D: written and read again, read by py-c3d, and what no reader may take."""

import warnings
from pathlib import Path

import c3d
import ezc3d
import numpy as np
import pytest

from studio.body.motion_files.c3d import read_c3d, read_c3d_points, write_c3d
from studio.body.motion_files.trc import MarkerMotion
from studio.foundations.errors import StudioError

NAMES = ("Head", "LAnkle", "RAnkle", "Hip", "Toe")


def motion(unit: str = "mm", rate: float = 50.0) -> MarkerMotion:
    places = np.random.default_rng(3).uniform(10.0, 900.0, (4, 5, 3)).astype(np.float32).astype(np.float64)
    places[2, 1] = np.nan
    return MarkerMotion(NAMES, np.arange(4) / rate, places, unit=unit, rate=rate)


def written(folder: Path, what: MarkerMotion, up: str = "z") -> Path:
    path = folder / "a.c3d"
    write_c3d(path, what, up=up, source={"run": "walk/run-1"})
    return path


@pytest.mark.parametrize(("unit", "mm"), [("mm", 1.0), ("cm", 10.0), ("m", 1000.0)])
def test_points_come_back_with_their_gaps_times_and_unit(tmp_path: Path, unit: str, mm: float) -> None:
    given = motion(unit)
    if unit == "m":
        given = MarkerMotion(NAMES, given.times, given.positions / 1000.0, unit=unit, rate=given.rate)
    path = written(tmp_path, given)
    np.testing.assert_array_equal(read_c3d_points(path), given.positions.astype(np.float32))
    found = read_c3d(path)
    assert (found.names, found.unit, found.rate) == (NAMES, unit, 50.0)
    np.testing.assert_allclose(found.times, given.times)
    np.testing.assert_allclose(found.positions, mm * given.positions, rtol=1e-6)


def test_py_c3d_sees_the_same_and_which_point_is_missing(tmp_path: Path) -> None:
    given = motion()
    with written(tmp_path, given).open("rb") as stream, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "No analog data found")
        reader = c3d.Reader(stream)
        frames = np.array([points.copy() for _, points, _ in reader.read_frames()])
        assert [label.strip() for label in reader.point_labels] == list(NAMES)
        assert reader.point_rate == 50.0
    missing = np.isnan(given.positions).any(axis=2)
    assert ((frames[..., 3] < 0.0) == missing).all()
    assert (frames[..., 3][~missing] == 0.0).all()
    np.testing.assert_allclose(frames[~missing][:, :3], given.positions[~missing], rtol=1e-6)


def test_a_point_at_the_origin_was_not_seen(tmp_path: Path) -> None:
    given = motion()
    given.positions[0, 0] = 0.0
    given.positions[1, 0] = (0.0, 0.0, 5.0)
    found = read_c3d(written(tmp_path, given))
    assert np.isnan(found.positions[0, 0]).all()
    np.testing.assert_allclose(found.positions[1, 0], [0.0, 0.0, 5.0])


@pytest.mark.parametrize(
    ("unit", "rate", "words"),
    [
        ("inch", 50.0, "unit 'inch'"),
        ("mm", 0.5, "0.5 frames a second"),
        ("mm", 20_000.0, "20000 frames a second"),
    ],
)
def test_units_and_rates_that_cannot_be_are_named(tmp_path: Path, unit: str, rate: float, words: str) -> None:
    with pytest.raises(StudioError, match=words) as no:
        read_c3d(written(tmp_path, motion(unit, rate)))
    assert "mm, cm or m" in no.value.hint


@pytest.mark.parametrize("rate", [1.0, 10_000.0])
def test_the_least_and_the_greatest_rate_are_read(tmp_path: Path, rate: float) -> None:
    assert read_c3d(written(tmp_path, motion(rate=rate))).rate == rate


@pytest.mark.parametrize(("up", "screen"), [("y", ["+Z", "+Y"]), ("z", ["+X", "+Z"])])
def test_a_file_says_how_it_is_seen_and_what_wrote_it(tmp_path: Path, up: str, screen: list[str]) -> None:
    content = ezc3d.c3d(str(written(tmp_path, motion(), up)))
    settings = content["parameters"]
    point = settings["POINT"]
    assert [point["X_SCREEN"]["value"], point["Y_SCREEN"]["value"]] == [[screen[0]], [screen[1]]]
    assert point["DESCRIPTIONS"]["value"] == list(NAMES)
    assert settings["MANUFACTURER"]["SOFTWARE"]["value"] == ["capture studio"]
    assert settings["STUDIO"]["RUN"]["value"] == ["walk/run-1"]
    residuals = content["data"]["meta_points"]["residuals"][0].T
    np.testing.assert_array_equal(residuals, np.where(np.isnan(motion().positions[..., 0]), -1.0, 0.0))


def changed(folder: Path, **settings: list[object]) -> Path:
    content = ezc3d.c3d(str(written(folder, motion())))
    for name, value in settings.items():
        content["parameters"]["POINT"][name]["value"] = value
    content.write(str(folder / "changed.c3d"))
    return folder / "changed.c3d"


@pytest.mark.parametrize("unit", [[], [" "], [" MM "]])
def test_points_without_a_unit_are_in_millimetres(tmp_path: Path, unit: list[object]) -> None:
    found = read_c3d(changed(tmp_path, UNITS=unit))
    assert found.unit == "mm"
    np.testing.assert_allclose(found.positions, motion().positions, rtol=1e-6)


def test_a_point_that_lies_too_far_away_is_named(tmp_path: Path) -> None:
    given = motion("m")
    given.positions[3, 2, 1] = 10_001.0
    with pytest.raises(StudioError, match=r"marker 'RAnkle' is at .* mm in row 4"):
        read_c3d(written(tmp_path, given))


def test_what_is_no_such_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudioError, match="does not exist"):
        read_c3d(tmp_path / "gone.c3d")
    (tmp_path / "text.c3d").write_text("no numbers")
    with pytest.raises(StudioError, match=r"text\.c3d"):
        read_c3d(tmp_path / "text.c3d")
    empty = MarkerMotion((), np.zeros(1), np.zeros((1, 0, 3)), unit="mm", rate=50.0)
    with pytest.raises(StudioError):
        read_c3d(written(tmp_path, empty))
