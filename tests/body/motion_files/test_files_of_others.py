"""Files as other programs write them: read as they are meant, and what was taken to be meant is said."""

from pathlib import Path

import numpy as np
import pytest

from studio.body.motion_files.bvh import read_bvh, read_bvh_file
from studio.body.motion_files.reading import read_recording
from studio.body.motion_files.trc import MarkerMotion, read_trc, write_trc
from studio.body.motion_files.truth_files import read_truth
from studio.foundations.errors import StudioError, TruthError

NAMES = ("Head", "LAnkle", "RAnkle", "Hip")
FRAMES = 4


def walking() -> np.ndarray:
    """(F, M, 3) mm, z up: a person of 1.7 m who walks along x."""
    at = np.array([[0.0, 0.0, 1700.0], [50.0, 100.0, 80.0], [-50.0, -100.0, 90.0], [0.0, 0.0, 950.0]])
    return at + 20.0 * np.arange(FRAMES)[:, None, None] * np.array([1.0, 0.0, 0.0]) + 3.25


def trc(path: Path, positions: np.ndarray | None = None, first: float = 0.0) -> Path:
    places = walking() if positions is None else positions
    write_trc(path, MarkerMotion(NAMES, np.arange(len(places)) / 60.0 + first, places))
    return path


def edited(path: Path, old: str, new: str, count: int = 1) -> Path:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))
    return path


def test_zeros_are_a_missing_marker(tmp_path: Path) -> None:
    lines = trc(tmp_path / "a.trc").read_text().splitlines()
    for row in (5, 6):
        cells = lines[row].split("\t")
        cells[2:5] = ["0.000000"] * 3
        lines[row] = "\t".join(cells)
    (tmp_path / "a.trc").write_text("\n".join(lines))
    found = read_trc(tmp_path / "a.trc")
    assert np.isnan(found.positions[:2, 0]).all()
    np.testing.assert_allclose(found.positions[2:], walking()[2:], atol=1e-3)
    np.testing.assert_allclose(found.positions[:2, 1:], walking()[:2, 1:], atol=1e-3)
    assert "2 times" in found.notes[0]


@pytest.mark.parametrize("word", ["NaN", "nan", "", "NA", "-1.#IND", "-", "9999999", "-99999.000"])
def test_a_word_for_missing_is_missing(tmp_path: Path, word: str) -> None:
    lines = trc(tmp_path / "a.trc").read_text().splitlines()
    cells = lines[6].split("\t")
    cells[2:5] = [word] * 3
    lines[6] = "\t".join(cells)
    (tmp_path / "a.trc").write_text("\n".join(lines))
    assert np.isnan(read_trc(tmp_path / "a.trc").positions[1, 0]).all()


@pytest.mark.parametrize(
    ("up", "file_from_world"),
    [
        ("z", np.eye(3)),
        ("x", np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])),
        ("-y", np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])),
    ],
)
def test_the_vertical_is_where_heads_are(tmp_path: Path, up: str, file_from_world: np.ndarray) -> None:
    """write_trc puts (y, z, x) of the world into the file: what is given to it is turned back first."""
    in_file = walking() @ file_from_world.T
    path = trc(tmp_path / "a.trc", in_file[:, :, [2, 0, 1]])
    found = read_truth(path, 60.0, FRAMES)
    assert f"along {up}" in found.notes[0]
    assert "--truth-up" in found.notes[0]
    np.testing.assert_allclose(found.positions[..., 2], walking()[..., 2], atol=1e-3)
    named = read_truth(path, 60.0, FRAMES, up)
    assert not named.notes
    np.testing.assert_allclose(named.positions, found.positions)


def test_who_lies_is_not_raised(tmp_path: Path) -> None:
    """Head and feet along the file's z, but nowhere near 0 there; the usual vertical stays."""
    lying = walking()[..., [2, 1, 0]] + np.array([2500.0, 0.0, 100.0])
    found = read_truth(trc(tmp_path / "a.trc", lying), 60.0, FRAMES)
    assert not found.notes
    np.testing.assert_allclose(found.positions, lying, atol=1e-3)
    with pytest.raises(TruthError, match="no axis"):
        read_truth(tmp_path / "a.trc", 60.0, FRAMES, "w")


def test_the_first_time_stamp_places_the_rows(tmp_path: Path) -> None:
    found = read_truth(trc(tmp_path / "a.trc", first=0.5), 60.0, 200)
    assert found.times[0] == pytest.approx(0.5)
    assert "begins with frame 30" in found.notes[0]


def test_frames_counted_from_1_are_noticed(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("frame,Head_x_mm,Head_y_mm,Head_z_mm\n" + "".join(f"{n},{n},5,6\n" for n in (1, 2, 3)))
    found = read_truth(path, 60.0, 3)
    assert found.positions[:, 0, 0].tolist() == [1.0, 2.0, 3.0]
    assert found.times[0] == pytest.approx(0.0)
    assert "counts its frames from 1" in found.notes[0]
    other = read_truth(path, 60.0, 100)
    assert other.times[1] == pytest.approx(1 / 60.0)
    assert "if it counts frames from 1" in other.notes[0]


def frames_file(path: Path, rows: list[str]) -> Path:
    path.write_text("frame,Head_x,Head_y,Head_z\n" + "".join(f"{row}\n" for row in rows))
    return path


@pytest.mark.parametrize(
    ("rows", "count", "times", "words"),
    [
        (["1,1,2,3", "2,4,5,6"], 2, [0.0, 1.0], "counts its frames from 1 to 2"),
        (["0,1,2,3", "2,4,5,6"], 2, [0.0, 1.0, 2.0], ""),
        (["0,,,", "1,1,2,3", "2,4,5,6", "3,,,"], 2, [0.0, 1.0, 2.0], "counts its frames from 1 to 2"),
        (["1,1,2,3", "3,4,5,6"], 2, [0.0, 1.0, 2.0, 3.0], "begins with frame 1 (at 0.04 s)"),
        (["2,1,2,3", "3,4,5,6"], 3, [0.0, 1.0, 2.0, 3.0], "begins with frame 2 (at 0.08 s)"),
        (["5,,,"], 3, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], ""),
    ],
)
def test_which_frame_a_file_begins_with_is_said(
    tmp_path: Path, rows: list[str], count: int, times: list[float], words: str
) -> None:
    motion = read_truth(frames_file(tmp_path / "a.CSV", rows), 25.0, count)
    np.testing.assert_allclose(motion.times, np.array(times) / 25.0, atol=1e-12)
    assert len(motion.positions) == len(times)
    assert len(motion.notes) == bool(words)
    if words:
        assert words in motion.notes[0]
        assert ("count them from 0" in motion.notes[0]) is ("frame 1 " in words)


def test_decimal_commas(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("frame;Head_x_mm;Head_y_mm;Head_z_mm\n0;-506,5755;1,5;2,25\n1;;;\n")
    found = read_truth(path, 60.0, 2)
    assert found.positions[0, 0].tolist() == [-506.5755, 1.5, 2.25]
    assert np.isnan(found.positions[1]).all()
    made = trc(tmp_path / "a.trc")
    head, *rows = made.read_text().split("Frame#")
    made.write_text(head + "Frame#" + rows[0].replace(".", ","))
    np.testing.assert_allclose(read_trc(made).positions, walking(), atol=1e-3)


def test_a_name_given_twice_is_named(tmp_path: Path) -> None:
    with pytest.raises(TruthError, match="'RAnkle' twice"):
        read_trc(edited(trc(tmp_path / "a.trc"), "LAnkle", "RAnkle"))


BVH = """HIERARCHY
ROOT Bip01 Hips
{
 OFFSET 0 90 0
 CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
 JOINT Bip01 L Thigh {
  OFFSET 10 -5 0
  CHANNELS 6 XPOSITION Yposition Zposition Zrotation Yrotation Xrotation
  End Site
  {
   OFFSET 0 -40 0
  }
  End Site
  {
   OFFSET 5 -40 0
  }
 }
}
MOTION

Frames: 2

Frame Time: 0.0333333
0 90 0 0 0 0 10 -5 0 5 0 0
0 91 0 0 0 0 10 -5 0 5 0 0
0 92 0 0 0 0 10 -5 0 5 0 0
"""


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_bvh_of_other_programs(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "TAKE.BVH"
    path.write_bytes(
        BVH.replace("Thigh", "Oberschenkel ü" if encoding == "latin-1" else "Thigh").encode(encoding)
    )
    found = read_recording(path)
    assert found.names[0] == "Bip01 Hips"
    assert found.names[1].startswith("Bip01 L ")
    assert len(found.positions) == 3
    assert "2 frames are announced, 3 follow" in found.notes[0]
    np.testing.assert_allclose(
        np.linalg.norm(found.rest[1] - found.rest[0]), np.hypot(10, 5) * 25.4 / 0.45, rtol=1e-9
    )


def test_position_channels_of_zeros_are_added_to_the_offset_and_stretched_bones_refused(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.bvh"
    path.write_text(BVH.replace("10 -5 0 5", "0 0 0 5"))
    assert np.linalg.norm(read_bvh(path, 1.0).rest[1]) == pytest.approx(np.hypot(10, 5))
    path.write_text(BVH.replace("0 92 0 0 0 0 10", "0 92 0 0 0 0 25"))
    with pytest.raises(StudioError, match="bone stretches"):
        read_bvh(path)
    assert len(read_bvh_file(path).moves) == 3


@pytest.mark.parametrize(
    ("word", "factor"), [("Millimeters", 1.0), ("meters", 1000.0), ("MM", 1.0), ("Centimetres", 10.0)]
)
def test_a_unit_may_be_a_word(tmp_path: Path, word: str, factor: float) -> None:
    path = trc(tmp_path / "a.trc", walking() / 1000.0)
    metres = read_trc(path).positions
    edited(path, "\tm\t", f"\t{word}\t")
    np.testing.assert_allclose(read_trc(path).positions * 1000.0, metres * factor, atol=1e-3)


def test_a_trc_whose_tabs_became_blanks_says_so(tmp_path: Path) -> None:
    path = trc(tmp_path / "a.trc")
    path.write_text(path.read_text().replace("\t", "    "))
    with pytest.raises(TruthError, match="no tabs"):
        read_trc(path)


@pytest.mark.parametrize(
    "head",
    ["frame,Nose_x,Nose_y,Nose_z", "Frame,Nose.X,Nose.Y,Nose.Z", "frame,Nose X (mm),Nose Y (mm),Nose Z (mm)",
     "frame,Nose x [mm],Nose y [mm],Nose z [mm]", "# exported\nframe, Nose_x, Nose_y, Nose_z"],
)  # fmt: skip
def test_columns_of_a_point_are_spelt_in_many_ways(tmp_path: Path, head: str) -> None:
    (tmp_path / "a.csv").write_text(f"{head}\n0,1.5,2.5,3.5\n1,4,5,6\n")
    motion = read_truth(tmp_path / "a.csv", 60.0)
    assert motion.names == ("Nose",)
    assert motion.positions[:, 0].tolist() == [[1.5, 2.5, 3.5], [4.0, 5.0, 6.0]]


def test_a_bvh_with_decimal_commas(tmp_path: Path) -> None:
    (tmp_path / "a.bvh").write_text(
        "HIERARCHY\nROOT Hips\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation"
        " Xrotation\n End Site\n {\n  OFFSET 0 1,5 0\n }\n}\nMOTION\nFrames: 1\nFrame Time: 0,02\n1,5 0 0 90 0 0\n"
    )
    motion = read_bvh(tmp_path / "a.bvh")
    assert motion.fps == 50.0
