"""Tables of points of other programs: what of them is kept, under which names and in which unit."""

from pathlib import Path

import numpy as np
import pytest

from studio.body.motion_files.points_tables import own_form
from studio.body.motion_files.truth_files import read_truth
from studio.foundations.errors import TruthError

HEADS, XYZ = ",Head,Head,Head,LAnkle,LAnkle,LAnkle", ",x,y,z,x,y,z"


def test_tables_of_other_programs(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    points = [("Head", "LAnkle"), (1.5, -2.5, 1700.0), (4.0, 5.0, 80.0)]
    cells = ",".join(f"{value}" for place in points[1:] for value in place)
    tables = {
        "dlc": f"scorer{',D' * 6}\nbodyparts{HEADS}\ncoords{XYZ}\n0,%s\n",
        "dlc, one animal": f"scorer{',D' * 6}\nindividuals{',a' * 6}\nbodyparts{HEADS}\ncoords{XYZ}\n0,%s\n",
        "motive": "Format Version,1.23,Take Name,t,Length Units,Millimeters\n\n"
        f",Type{',Marker' * 6}\n,Name{HEADS.replace(',', ',S:')}\n,ID,1,1,1,2,2,2\n,{',Position' * 6}\n"
        f"Frame,Time (Seconds){XYZ.upper()}\n0,0.0,%s\n",
        "vicon": f"Trajectories\n100\n,,S:Head,,,S:LAnkle,,\nFrame,Sub Frame{XYZ.upper()}\n,{',mm' * 6}\n0,0,%s\n",
    }
    for text in tables.values():
        path.write_text(text % cells)
        motion = read_truth(path, 60.0, 1)
        assert motion.names == points[0]
        assert motion.positions[0].tolist() == [list(points[1]), list(points[2])]
    tsv = tmp_path / "a.tsv"
    tsv.write_text(
        "NO_OF_FRAMES\t1\nFREQUENCY\t60\nMARKER_NAMES\tHead\tLAnkle\n" + cells.replace(",", "\t") + "\n"
    )
    assert read_truth(tsv, 60.0, 1).positions[0, 0].tolist() == [1.5, -2.5, 1700.0]


def test_nexus_ends_where_another_kind_of_data_begins(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    table = f"Frame,Sub Frame{XYZ.upper()}\n,{',mm' * 6}\n0,0,1,2,3,4,5,6\n"
    path.write_text(f"Trajectories\n100\n,,S:Head,,,S:LAnkle,,\n{table}\nDevices\n1000\n0,0,7,7,7,8,8,8\n")
    assert read_truth(path, 60.0, 1).positions.tolist() == [[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]]


def test_of_motives_columns_those_of_markers_count(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        "Format Version,1.23,Length Units,Millimeters\n\n"
        f",Type{',Bone' * 3}{',Marker' * 3}\n,Name{',S:Hip' * 3}{',S:Head' * 3}\n,{',Position' * 6}\n"
        f"Frame,Time (Seconds){XYZ.upper()}\n0,0.0,1,2,3,4,5,6\n"
    )
    motion = read_truth(path, 60.0, 1)
    assert motion.names == ("Head",)
    assert motion.positions.tolist() == [[[4.0, 5.0, 6.0]]]
    path.write_text(path.read_text().replace("Marker", "Bone"))
    assert read_truth(path, 60.0, 1).names == ("Hip", "Head")


@pytest.mark.parametrize("place", [0, 1])
def test_motives_names_may_stand_in_either_of_the_first_columns(tmp_path: Path, place: int) -> None:
    path = tmp_path / "a.csv"
    types, names = (("," + word, word + ",")[1 - place] for word in ("Type", "Name"))
    path.write_text(
        f"Format Version,1.23,Length Units,Millimeters\n\n{types}{',Marker' * 3}\n{names}{',S:Head' * 3}\n"
        f",{',Position' * 3}\nFrame,Time (Seconds),X,Y,Z\n0,0.0,1,2,3\n"
    )
    assert read_truth(path, 60.0, 1).names == ("Head",)


@pytest.mark.parametrize(("word", "mm"), [("Meters", 1000.0), ("Centimeters", 10.0), ("Millimeters", 1.0)])
def test_motives_header_names_the_unit(tmp_path: Path, word: str, mm: float) -> None:
    path = tmp_path / "a.csv"
    place = np.array([1.5, -2.5, 1700.0]) / mm
    path.write_text(
        f"Format Version,1.23,Length Units,{word}\n\n,Type{',Marker' * 3}\n,Name{',S:Head' * 3}\n,{',Position' * 3}\n"
        f"Frame,Time (Seconds),X,Y,Z\n0,0.0,{place[0]},{place[1]},{place[2]}\n"
    )
    np.testing.assert_allclose(read_truth(path, 60.0, 1).positions[0, 0], place * mm)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("scorer,D,D\nbodyparts,Head,Head\ncoords,x,y\n0,1,2\n", "holds pixels"),
        (
            f"scorer{',D' * 6}\nindividuals,a,a,a,b,b,b\nbodyparts{HEADS}\ncoords{XYZ}\n0,1,2,3,4,5,6\n",
            "2 individuals",
        ),
        ("Format Version,1.23\nFrame,Time\n", "Motive"),
        ("Trajectories\n100\n", "Nexus"),
        (f"Trajectories\n100\n,,S:Head,,\nFrame,Sub Frame{XYZ.upper()}\n", "Nexus"),
    ],
)
def test_what_such_tables_cannot_mean_is_said(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(TruthError, match=words):
        read_truth(tmp_path / "a.csv", 60.0, 1)


def cut(text: str) -> list[list[str]]:
    """Rows of a table written with blanks between its cells, "-" for one that is empty and "~" for a blank."""
    lines = [line.split() for line in text.splitlines() if line.strip()]
    return [["" if cell == "-" else cell.replace("~", " ") for cell in line] for line in lines]


DLC = """
    -         -      -      -      -          -      -      -      -
    SCORER    D      D      D      D          D      D      D      D
    bodyparts Nose   Nose   Nose   Nose       Tail   Tail   Tail   Tail
    coords    X      y      z      likelihood x      y      z      likelihood
    7         1      2      3      0.5        4      5      6      0.5
    -         -      -      -      -          -      -      -      -
    8         -      -      -      -          -      9
"""
MOTIVE = """
    Format~Version 1.23 Length~Units Meters -      -          -         -          -     -          -     -
    -     -
    of    Name
    of    Type
    -     Type   Marker   Marker   Marker   Bone     Rotation   Bone   Marker   Marker   Marker
    -     Name   S:A:Hip  S:A:Hip  S:A:Hip  S:Leg    S:Leg      S:Leg  Toe      Toe      Toe
    -     ID     1        1        1        2        2          2      3        3        3
    -     -      Position Position Position Position Rotation   Error  Position Position Position Position
    Frame Time   X        Y        Z        X        X          X      X        Y        Z        X        Y
    0     0.0    1        2        3        4        5          6      7        8        9
    1     0.1    10       -        -        -        -          -      11       -        12
    2     0.2    13
"""
VICON = """
    Trajectories
    100
    -     -     S:Hip -     -     -     Toe
    Frame Sub   X     Y     Z     RX    X     Y     Z
    -     -     mm    mm    mm    deg   cm    inch
    4     0     1     2     3     0     4     5     6
    5     0     9     -     -     0     10
    Model Outputs
    4     0     1     2     3     0     4     5     6
"""
QUALISYS = """
    NO_OF_FRAMES 2
    7            7
    MARKER_NAMES Hip Toe -
    Time         Frame
    - 0.5        1   2    3   4   5,5   6   7
    2 0.6        8   9    10  11  12    13  14
"""


@pytest.mark.parametrize(
    ("table", "wanted"),
    [
        (
            DLC,
            "frame Nose_x Nose_y Nose_z Tail_x Tail_y Tail_z\n7 1 2 3 4 5 6\n8 - - - - 9 -",
        ),
        (
            MOTIVE,
            "frame Hip_x_m Hip_y_m Hip_z_m Toe_x_m Toe_y_m Toe_z_m\n0 1 2 3 7 8 9\n1 10 - - 11 - 12\n2 13 - - - - -",
        ),
        (
            VICON,
            "frame Hip_x_mm Hip_y_mm Hip_z_mm Toe_x_cm Toe_y Toe_z\n4 1 2 3 4 5 6\n5 9 - - 10 - -",
        ),
        (
            QUALISYS,
            "frame Hip_x_mm Hip_y_mm Hip_z_mm Toe_x_mm Toe_y_mm Toe_z_mm\n0 1 2 3 4 5,5 6\n1 8 9 10 11 12 13",
        ),
    ],
)
def test_every_cell_is_where_its_point_axis_and_frame_say(table: str, wanted: str) -> None:
    assert own_form(Path("a.csv"), cut(table)) == cut(wanted)
