"""Which axis a file of markers means by up."""

from pathlib import Path

import numpy as np
import pytest

from studio.body.motion_files.marker_meaning import turned_up, up_of_markers
from studio.body.motion_files.trc import MarkerMotion
from studio.foundations.errors import TruthError

NAMES = ("Head", "LAnkle", "RAnkle", "Hip")


def person(frames: int = 3) -> np.ndarray:
    """(F, M, 3) one who stands, z up."""
    at = np.array([[20.0, 0.0, 1700.0], [50.0, 100.0, 80.0], [-50.0, -100.0, 90.0], [0.0, 0.0, 950.0]])
    return np.tile(at, (frames, 1, 1))


def along(axis: str, places: np.ndarray) -> np.ndarray:
    """Places with z up in a file whose `axis` points up."""
    number, sign = "xyz".index(axis[-1]), -1.0 if axis[0] == "-" else 1.0
    turned = np.roll(places, number - 2, axis=-1)
    return turned * sign if sign > 0 else turned * np.where(np.arange(3) == number, -1.0, 1.0)


@pytest.mark.parametrize("axis", ["x", "y", "z", "-x", "-y", "-z"])
def test_up_is_where_heads_are_above_feet(axis: str) -> None:
    assert up_of_markers(NAMES, along(axis, person())) == axis
    motion = MarkerMotion(NAMES, np.arange(3.0), along(axis, person()), notes=("read",))
    turned = turned_up(Path("a.trc"), motion, "", usual="y")
    np.testing.assert_allclose(turned.positions[..., 2], person()[..., 2])
    assert turned.notes[0] == "read"
    assert len(turned.notes) == (1 if axis == "y" else 2)
    named = turned_up(Path("a.trc"), motion, axis, usual="y")
    np.testing.assert_array_equal(named.positions, turned.positions)
    assert named.notes == ("read",)
    assert up_of_markers(NAMES, along(axis, person() / 2000.0)) == axis
    with pytest.raises(TruthError, match="no axis"):
        turned_up(Path("a.trc"), motion, "up", usual="y")


@pytest.mark.parametrize(
    ("lean", "floor", "axis"),
    [
        (36.0, 0.0, "z"),
        (38.0, 0.0, ""),
        (0.0, 0.34, "z"),
        (0.0, 0.36, ""),
        (0.0, -0.34, "z"),
        (0.0, -0.36, ""),
    ],
)
def test_who_leans_far_or_stands_high_shows_no_axis(lean: float, floor: float, axis: str) -> None:
    """lean : degrees. floor : of the feet, in lengths of the way from feet to head."""
    places = np.zeros((3, 2, 3))
    places[:, 0] = 2.0 * np.array([np.sin(np.radians(lean)), 0.0, np.cos(np.radians(lean))])
    places[..., 2] += 2.0 * floor
    assert up_of_markers(("nose", "ltoe"), places) == axis


@pytest.mark.parametrize(
    ("names", "axis"),
    [
        (("S:HEAD", "a:b:LHEE"), "z"),
        (("c7", "Foot"), "z"),
        (("Forehead", "Foot"), ""),
        (("Head", "Forefoot"), ""),
        (("Head", "Hip"), ""),
        (("Hip", "Foot"), ""),
        (("Head:Hip", "Foot"), ""),
    ],
)
def test_heads_and_feet_are_known_by_their_names(names: tuple[str, str], axis: str) -> None:
    assert up_of_markers(names, person()[:, :2]) == axis


def test_markers_that_are_missing_say_nothing() -> None:
    """Most frames lack the head, or both feet, or all is in one place; what is left decides."""
    places = person(9)
    places[:3, 0] = np.nan
    places[3, 1:3] = np.nan
    places[4] = 0.0
    places[5:7, 1, 1] = np.nan
    assert up_of_markers(NAMES, places) == "z"
    places[:, 0] = np.nan
    assert up_of_markers(NAMES, places) == ""
    assert up_of_markers(NAMES, np.zeros((3, 4, 3))) == ""


def test_most_frames_decide() -> None:
    assert up_of_markers(NAMES, np.concatenate([person(5), along("x", person(4))])) == "z"
    assert up_of_markers(NAMES, np.concatenate([person(4), along("x", person(5))])) == "x"


def test_the_middle_of_feet_counts_each_that_is_there() -> None:
    """One foot alone would stand too high: with both they are at a third of the way."""
    places = np.array([[[0.0, 0.0, 2.9], [0.0, 0.0, -0.1], [0.0, 0.0, 1.5]]])
    names = ("head", "lfoot", "rfoot")
    assert up_of_markers(names, places) == "z"
    places[0, 1] = np.nan
    assert up_of_markers(names, places) == ""
