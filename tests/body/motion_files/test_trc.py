"""TRC files in and out."""

from pathlib import Path

import numpy as np
import pytest

from studio.body.motion_files.trc import MarkerMotion, number_or_nan, read_trc, write_trc
from studio.foundations.errors import TruthError

HEADER = (
    "PathFileType\t4\t(X/Y/Z)\twalk.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "60\t60\t2\t2\t{unit}\t60\t1\t2\n"
    "Frame#\tTime\tHip\t\t\tNeck\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
    "\n"
)
ROWS = "1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.0166667\t1.5\t2.5\t3.5\t4.5\t5.5\t6.5\n"


def written(folder: Path, rows: str = ROWS, unit: str = "m", header: str = HEADER) -> Path:
    path = folder / "walk.trc"
    path.write_text(header.format(unit=unit) + rows)
    return path


def test_y_up_metres_become_z_up_millimetres(tmp_path: Path) -> None:
    motion = read_trc(written(tmp_path))
    assert motion.names == ("Hip", "Neck")
    np.testing.assert_allclose(motion.positions[0], [[3000, 1000, 2000], [6000, 4000, 5000]])
    np.testing.assert_allclose(motion.times, [0.0, 0.0166667])
    assert (motion.unit, motion.rate) == ("m", 60.0)


def test_the_unit_of_the_header_counts(tmp_path: Path) -> None:
    np.testing.assert_allclose(read_trc(written(tmp_path, unit="mm")).positions[0, 0], [3, 1, 2])


@pytest.mark.parametrize(("unit", "tolerance"), [("m", 1e-4), ("mm", 1e-4)])
def test_what_is_written_is_read_back(tmp_path: Path, unit: str, tolerance: float) -> None:
    rng = np.random.default_rng(3)
    positions = rng.normal(0.0, 1000.0, (5, 3, 3))
    positions[2, 1] = np.nan
    motion = MarkerMotion(("A", "B", "C"), np.arange(5) / 60.0, positions, unit, 60.0)
    write_trc(tmp_path / "out.trc", motion)
    back = read_trc(tmp_path / "out.trc")
    np.testing.assert_allclose(back.positions, positions, atol=tolerance)
    np.testing.assert_allclose(back.times, motion.times, atol=1e-8)
    assert back.names == motion.names
    assert [path.name for path in tmp_path.iterdir()] == ["out.trc"]


@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_a_marker_in_the_origin_is_not_missing(tmp_path: Path, unit: str) -> None:
    positions = np.zeros((2, 1, 3))
    write_trc(tmp_path / "out.trc", MarkerMotion(("A",), np.arange(2) / 60.0, positions, unit, 60.0))
    np.testing.assert_allclose(read_trc(tmp_path / "out.trc").positions, positions, atol=2e-4)


def test_a_marker_with_three_blank_cells_is_missing(tmp_path: Path) -> None:
    motion = read_trc(written(tmp_path, ROWS.replace("4.5\t5.5\t6.5", "\t\t")))
    assert np.isnan(motion.positions[1, 1]).all()
    assert np.isfinite(motion.positions[1, 0]).all()


def test_empty_cells_at_a_rows_end_are_none(tmp_path: Path) -> None:
    motion = read_trc(written(tmp_path, ROWS.replace("\t6\n", "\t6\t\t\n")))
    np.testing.assert_array_equal(motion.positions, read_trc(written(tmp_path)).positions)
    with pytest.raises(TruthError, match="line 7 has 10 columns"):
        read_trc(written(tmp_path, ROWS.replace("\t6\n", "\t6\t\t7\n")))


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (ROWS.replace("2.5", "nan"), "line 8 gives only part of marker Hip"),
        (ROWS.replace("2.5", "inf"), "column 4 (Hip Y)"),
        (ROWS.replace("5.5", "five"), "column 7 (Neck Y) is 'five'"),
        (ROWS.replace("0.0166667", ""), "column 2 (Time)"),
        *((ROWS.replace(f"\t{cell}\t", "\t\t"), "only part of marker Hip") for cell in ("1.5", "2.5", "3.5")),
        (ROWS.replace("\t6.5", ""), "line 8 has 7 columns, not 8"),
        (ROWS.replace("0.0166667", "0.0"), "does not rise"),
        (ROWS.splitlines()[0], "has 1 rows and its header says 2"),
        ("", "has 0 rows"),
    ],
)
def test_a_broken_row_is_named(tmp_path: Path, rows: str, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        read_trc(written(tmp_path, rows))
    assert message in caught.value.message
    assert caught.value.hint


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("{unit}", "feet"), "unit 'feet'"),
        (("Neck", "Hip"), "marker 'Hip' twice"),
        (("60\t60\t2\t2", "60\t60\t2\t3"), "2 markers and line 3 says 3"),
        (("PathFileType", "Something"), "five header lines"),
        (("60\t60\t2", "x\t60\t2"), "no DataRate"),
    ],
)
def test_a_broken_header_is_named(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    with pytest.raises(TruthError, match=message):
        read_trc(written(tmp_path, header=HEADER.replace(*change)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("60\t60\t2\t2", "0\t60\t2\t2"), "a DataRate of 0"),
        (("60\t60\t2\t2", "-1\t60\t2\t2"), "a DataRate of -1"),
        (("60\t60\t2\t2", "inf\t60\t2\t2"), "no DataRate"),
        (("60\t60\t2\t2", "60\t60\tx\t2"), "no NumFrames"),
        (("60\t60\t2\t2", "60\t60\t2\t1"), "2 markers and line 3 says 1"),
        (("Hip\t\t\tNeck", "\t\t\tNeck"), "names 1 markers and line 3 says 2"),
        (("Hip\t\t\tNeck", "\t\t\t"), "names 0 markers and line 3 says 2"),
        (("2\t2\t{unit}", "2\t0\t{unit}"), "2 markers and line 3 says 0"),
    ],
)
def test_a_headers_numbers_must_fit(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    assert change[0] in HEADER
    with pytest.raises(TruthError, match=message):
        read_trc(written(tmp_path, header=HEADER.replace(*change)))


def test_a_table_without_markers_is_refused(tmp_path: Path) -> None:
    header = HEADER.replace("2\t2\t{unit}", "2\t0\t{unit}").replace("Hip\t\t\tNeck", "\t\t\t")
    with pytest.raises(TruthError, match="names 0 markers and line 3 says 0"):
        read_trc(written(tmp_path, header=header))


def test_a_header_that_announces_fewer_rows_or_more_cells_is_taken(tmp_path: Path) -> None:
    header = HEADER.replace("60\t60\t2\t2", "60\t60\t1\t2").replace("Neck\t\t\n", "Neck\t\t\t\t\t\n")
    assert len(read_trc(written(tmp_path, header=header)).positions) == 2
    with pytest.raises(TruthError, match="has 0 rows and its header says 0"):
        read_trc(written(tmp_path, "", header=HEADER.replace("60\t60\t2", "60\t60\t0")))


def test_the_row_whose_time_does_not_rise_is_named(tmp_path: Path) -> None:
    rows = "".join(f"{n}\t{time}\t1\t2\t3\t4\t5\t6\n" for n, time in enumerate((0.0, 0.1, 0.2, 0.1, 0.3), 1))
    with pytest.raises(TruthError, match=r"row 4 \(0\.1 s\) does not rise"):
        read_trc(written(tmp_path, rows))


@pytest.mark.parametrize(
    ("cells", "is_missing"),
    [
        *(
            ((f"{sign}{'9' * digits}",) * 3, 4 <= digits <= 8)
            for digits in range(3, 10)
            for sign in ("", "-")
        ),
        (("9999", "9999", "99999"), False),
        (("0", "0", "1"), False),
        (("0", "0.0", "-0"), True),
        (("5", "5", "5"), False),
    ],
)
def test_three_zeros_and_three_times_the_same_nines_are_missing(
    tmp_path: Path, cells: tuple[str, str, str], is_missing: bool
) -> None:
    path = written(tmp_path, ROWS.replace("4.5\t5.5\t6.5", "\t".join(cells)), unit="cm")
    if max(map(len, cells)) >= 9 and not is_missing:
        with pytest.raises(TruthError, match=r"marker 'Neck' is at .* mm in row 2"):
            read_trc(path)
        return
    motion = read_trc(path)
    assert np.isnan(motion.positions[1, 1]).all() == is_missing
    assert np.isfinite(motion.positions[1, 1]).all() != is_missing
    assert np.isfinite(motion.positions[[0, 0, 1], [0, 1, 0]]).all()
    value = "0 0 0" if cells[0] == "0" else f"{cells[0]} three times"
    notes = (f"'walk.trc' has {value} for a marker 1 times: taken for missing.",) if is_missing else ()
    assert motion.notes == notes


@pytest.mark.parametrize(("metres", "is_read"), [("9999.9", True), ("10000.1", False), ("-10000.1", False)])
def test_places_beyond_ten_kilometres_are_refused(tmp_path: Path, metres: str, is_read: bool) -> None:
    path = written(tmp_path, ROWS.replace("5.5", metres))
    if is_read:
        read_trc(path)
        return
    with pytest.raises(TruthError, match=r"marker 'Neck' is at -?1\.00001e\+07 mm in row 2"):
        read_trc(path)


@pytest.mark.parametrize(
    ("text", "value"), [("1,5", 1.5), ("1.5", 1.5), ("1,000.5", None), ("1e3", 1000.0), ("x", None)]
)
def test_a_comma_is_a_decimal_one_where_there_is_no_point(text: str, value: float | None) -> None:
    assert number_or_nan(text) == pytest.approx(np.nan if value is None else value, nan_ok=True)


@pytest.mark.parametrize(
    ("unit", "rows"),
    [
        ("mm", "1\t0.00000000\t0.5000\t-2000.0000\t1.2346\t\t\t\n"
               "2\t0.01333333\t0.0001\t0.0000\t0.0000\t7.0000\t8.0000\t-0.0000\n"),
        ("m", "1\t0.00000000\t0.0005000\t-2.0000000\t0.0012346\t\t\t\n"
              "2\t0.01333333\t0.0000001\t0.0000000\t0.0000000\t0.0070000\t0.0080000\t-0.0000000\n"),
    ],
)  # fmt: skip
def test_a_table_is_written_to_the_last_letter(tmp_path: Path, unit: str, rows: str) -> None:
    places = np.array(
        [[[1.23456, 0.5, -2000.0], [np.nan] * 3], [[0.00003, 0.0, 0.00004], [-0.00001, 7.0, 8.0]]]
    )
    places[1, 0] *= 1.0 if unit == "mm" else 1e-3
    write_trc(tmp_path / "out.trc", MarkerMotion(("A", "B"), np.arange(2) / 75.0, places, unit, 75.0))
    assert (tmp_path / "out.trc").read_text() == (
        "PathFileType\t4\t(X/Y/Z)\tout.trc\n"
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
        f"75\t75\t2\t2\t{unit}\t75\t1\t2\nFrame#\tTime\tA\t\t\tB\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n{rows}"
    )


def test_binary_rubbish_is_no_trc(tmp_path: Path) -> None:
    (tmp_path / "x.trc").write_bytes(bytes(range(256)))
    with pytest.raises(TruthError, match="is not a TRC file"):
        read_trc(tmp_path / "x.trc")


@pytest.mark.parametrize(
    ("kept", "words"), [(5, "0 rows"), (4, "five header lines"), (0, "five header lines")]
)
def test_a_file_that_ends_in_or_after_its_header_says_so(tmp_path: Path, kept: int, words: str) -> None:
    path = written(tmp_path, rows="")
    path.write_text("\n".join(path.read_text().split("\n")[:kept]))
    with pytest.raises(TruthError, match=words):
        read_trc(path)
