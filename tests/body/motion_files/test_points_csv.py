"""CSV files of named points: both shapes, units, gaps, and everything that can be wrong with one."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio.body.motion_files.points_csv import read_points
from studio.body.motion_files.truth_files import read_truth
from studio.foundations.errors import StudioError, TruthError

LONG = "frame,point,x_mm,y_mm,z_mm,score\n0,Nose,1,2,3,0.9\n0,Tail,4,5,6,0.8\n2,Nose,7,8,9,0.7\n2,Tail,,,,\n"


def written(folder: Path, text: str, name: str = "points.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_may_stand_in_any_order(tmp_path: Path) -> None:
    rows = [line.split(",") for line in LONG.splitlines()]
    turned = "\n".join(",".join([point, *places, frame]) for frame, point, *places in rows) + "\n"
    motion, other = (read_points(written(tmp_path, text), 30.0) for text in (LONG, turned))
    assert other.names == motion.names
    np.testing.assert_array_equal(other.positions, motion.positions)


def test_empty_lines_between_rows_are_none(tmp_path: Path) -> None:
    head, *rows = LONG.splitlines()
    motion, other = (
        read_points(written(tmp_path, text), 30.0)
        for text in (LONG, "\n\n".join([head, *rows]) + "\n,,,,,\n")
    )
    np.testing.assert_array_equal(other.positions, motion.positions)


def test_a_row_a_point_with_a_frame_left_out_and_a_point_missing(tmp_path: Path) -> None:
    motion = read_points(written(tmp_path, LONG), 30.0)
    assert motion.names == ("Nose", "Tail")
    assert motion.unit == "mm"
    np.testing.assert_allclose(motion.times, [0.0, 1 / 30, 2 / 30])
    np.testing.assert_allclose(motion.positions[0], [[1, 2, 3], [4, 5, 6]])
    assert np.isnan(motion.positions[1]).all()
    np.testing.assert_allclose(motion.positions[2, 0], [7, 8, 9])
    assert np.isnan(motion.positions[2, 1]).all()


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_row_a_frame_as_anipose_writes_it(tmp_path: Path, separator: str) -> None:
    rows = [
        ["Ear_L_x", "Ear_L_y", "Ear_L_z", "Ear_L_error", "M_00", "Nose_x", "Nose_y", "Nose_z", "fnum"],
        ["1.5", "2", "3", "0.2", "1", "4", "5", "6", "0"],
        ["nan", "nan", "nan", "", "0", "4", "5", "7", "1"],
    ]
    motion = read_points(written(tmp_path, "\n".join(map(separator.join, rows))), 60.0)
    assert motion.names == ("Ear_L", "Nose")
    assert motion.unit == ""
    np.testing.assert_allclose(motion.positions[0], [[1.5, 2, 3], [4, 5, 6]])
    assert np.isnan(motion.positions[1, 0]).all()


def test_metres_and_seconds(tmp_path: Path) -> None:
    motion = read_truth(written(tmp_path, "time,marker,x_m,y_m,z_m\n0.5,Hip,1,0,0.25\n"), 10.0)
    assert len(motion.times) == 6
    np.testing.assert_allclose(motion.positions[5, 0], [1000, 0, 250])


@pytest.mark.parametrize(
    ("text", "names", "places"),
    [
        # Cells that are blank at the end of a row, and one row shorter than its header but for them.
        ("frame,A_x,A_y,A_z,,\n0,1,2,3,,\n1,4,5,6,,\n", "A", [[[1, 2, 3]], [[4, 5, 6]]]),
        ("frame,A_x,A_y,A_z\n0,1,2,3,,\n", "A", [[[1, 2, 3]]]),
        # A column that is none of a coordinate between those that are, and points with axes in any order.
        ("A_z,note,A_x,A_y,B.x,B.y,B.z,frame\n3,s,1,2,4,5,6,0\n", "A B", [[[1, 2, 3], [4, 5, 6]]]),
        # In a table with a row a point, columns with a point's name are others.
        ("frame,name,x,y,z,A_x,A_y,A_z\n0,B,1,2,3,7,8,9\n", "B", [[[1, 2, 3]]]),
        # In one with a row a frame, columns without are.
        ("frame,x,y,z,A_x,A_y,A_z\n0,1,2,3,7,8,9\n", "A", [[[7, 8, 9]]]),
        # Rows are counted from 0 where nothing numbers them.
        ("A_x,A_y,A_z\n1,2,3\n\n4,5,6\n", "A", [[[1, 2, 3]], [[4, 5, 6]]]),
        ("time,A_x,A_y,A_z\n0,1,2,3\n0.04,4,5,6\n", "A", [[[1, 2, 3]], [[4, 5, 6]]]),
        ("timestamp,A_x,A_y,A_z\n0.049,1,2,3\n", "A", [[[np.nan] * 3], [[1, 2, 3]]]),
        # Frames go before times.
        ("time,frame,A_x,A_y,A_z\n9,0,1,2,3\n", "A", [[[1, 2, 3]]]),
        ("frame,A_x,A_y,A_z\n1.0,1,2,3\n", "A", [[[np.nan] * 3], [[1, 2, 3]]]),
        ("frame,A_x_cm,A_y_cm,A_z_cm\n0,1,2,3\n", "A", [[[10, 20, 30]]]),
        ("# made\n\nframe;A_x;A_y;A_z\n0;1,5;-2,5;0\n# end\n", "A", [[[1.5, -2.5, 0]]]),
        ("frame\tA_x\tA_y\tA_z\n0\t1,5\t2\t3\n", "A", [[[1.5, 2, 3]]]),
    ],
)
def test_tables_are_read_as_they_are_meant(
    tmp_path: Path, text: str, names: str, places: list[list[list[float]]]
) -> None:
    motion = read_points(written(tmp_path, text), 25.0)
    assert motion.names == tuple(names.split())
    np.testing.assert_allclose(motion.positions, places)
    np.testing.assert_allclose(motion.times, np.arange(len(places)) / 25.0)
    assert motion.rate == 25.0


def test_zeros_and_rows_that_were_counted_are_said(tmp_path: Path) -> None:
    motion = read_points(written(tmp_path, "A_x,A_y,A_z\n0,0,0\n1,2,3\n"), 25.0)
    assert np.isnan(motion.positions[0]).all()
    assert ["taken for missing" in motion.notes[0], "counted from 0" in motion.notes[1]] == [True, True]
    assert not read_points(written(tmp_path, LONG), 25.0).notes


def test_the_last_frame_that_may_be_is_read(tmp_path: Path) -> None:
    text = "frame,A_x,A_y,A_z\n{},1,2,3\n"
    assert len(read_points(written(tmp_path, text.format(500_000)), 25.0).times) == 500_001
    with pytest.raises(TruthError, match="'500001' is no frame"):
        read_points(written(tmp_path, text.format(500_001)), 25.0)


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("", "no rows"),
        ("frame,point,x,y,z\n", "no rows"),
        ("point,x,y,z\nNose,1,2,3\n", "frames or times"),
        ("frame,point,u,v\n0,Nose,1,2\n", "coordinates"),
        ("frame,point,x,y\n0,Nose,1,2\n", "no column z"),
        ("frame,Nose_x,Nose_y\n0,1,2\n", "point 'Nose'"),
        ("frame,point,x,x,z\n0,Nose,1,2,3\n", "two columns 'x'"),
        ("frame,point,x_mm,y_m,z_mm\n0,Nose,1,2,3\n", "m, mm"),
        ("frame,point,x,y,z\n0,Nose,1,2\n", "line 2 has 4 columns"),
        ("frame,point,x,y,z\n0,Nose,1,2,3,4\n", "line 2 has 6 columns"),
        ("frame,point,x,y,z\n0,Nose,1,two,3\n", "y of point 'Nose' is 'two'"),
        ("frame,point,x,y,z\n0,Nose,1,,3\n", "y of point 'Nose' is ''"),
        ("frame,point,x,y,z\n0,Nose,1,inf,3\n", "'inf'"),
        ("frame,point,x,y,z\n0,Nose,1,1e12,3\n", "1e\\+12"),
        ("frame,A_x_mm,A_y_mm,A_z_mm,B_x,B_y,B_z\n0,1,2,3,1,2,3\n", "no unit"),
        ("frame,x,y,z\n0,1,2,3\n", "no columns of coordinates"),
        ("name,x,y,z\nA,1,2,3\n", "no column of frames"),
        ("frame,A_x,A_y,A_z\n0,,2,3\n", "x of point 'A' is ''"),
        ("frame,A_x,A_y,A_z\n0,-1e8,2,3\n", "is at -1e.08 mm in row 1"),
        ("time,A_x,A_y,A_z\nnan,1,2,3\n", "line 2: 'nan' is no time"),
        ("\n\nframe,point,x,y,z\n0,,1,2,3\n", "line 4 names no point"),
        ("frame,point,x,y,z\n0,,1,2,3\n", "names no point"),
        ("frame,point,x,y,z\n-1,Nose,1,2,3\n", "'-1' is no frame"),
        ("frame,point,x,y,z\n0.5,Nose,1,2,3\n", "'0.5' is no frame"),
        ("frame,point,x,y,z\n999999999,Nose,1,2,3\n", "is no frame"),
        ("frame,point,x,y,z\nnan,Nose,1,2,3\n", "is no frame"),
        ("time,point,x,y,z\n-2,Nose,1,2,3\n", "is no time"),
        ("frame,point,x,y,z\n0,Nose,1,2,3\n0,Nose,1,2,3\n", "a second time"),
        ('frame,point,x,y,z\n0,"Nose,1,2,3\n', "damaged"),
        ("frame,point,x,y,z\n0,N\0ose,1,2,3,4,5\n", "line 2"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, cause: str) -> None:
    with pytest.raises(TruthError, match=cause) as raised:
        read_points(written(tmp_path, text), 30.0)
    assert "points.csv" in str(raised.value)
    assert raised.value.hint


def test_more_numbers_than_memory_holds_are_refused(tmp_path: Path) -> None:
    rows = "\n".join(f"0,p{number},1,2,3" for number in range(200))
    with pytest.raises(TruthError, match="200 points and 500000"):
        read_points(written(tmp_path, f"frame,point,x,y,z\n{rows}\n499999,p0,1,2,3\n"), 30.0)


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TruthError, match="no truth that can be read"):
        read_truth(written(tmp_path, LONG, "points.txt"), 30.0)
    with pytest.raises(TruthError, match="cannot be read"):
        read_truth(tmp_path / "none.csv", 30.0)
    (tmp_path / "bytes.csv").write_bytes(bytes(range(256)))
    with pytest.raises(TruthError, match=r"bytes\.csv"):
        read_truth(tmp_path / "bytes.csv", 30.0)


@pytest.mark.slow
@given(st.integers(0, len(LONG) - 1), st.text(max_size=4))
def test_no_change_of_a_file_raises_anything_else(
    tmp_path_factory: pytest.TempPathFactory, at: int, put: str
) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "points.csv"
    path.write_bytes((LONG[:at] + put + LONG[at + 1 :]).encode("utf-8", "surrogatepass"))
    try:
        motion = read_points(path, 30.0)
    except StudioError:
        return
    assert motion.positions.shape == (len(motion.times), len(motion.names), 3)
