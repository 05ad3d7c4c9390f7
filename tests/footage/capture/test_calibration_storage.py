"""OpenCV's files are read as OpenCV reads them, and what is damaged is refused without harm to the process."""

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from calibration_samples import CAMERAS, easymocap, opencv_sample

from studio.footage.capture.calibration_storage import Storage
from studio.foundations.errors import CalibrationError

HEAD = "%YAML:1.0\n---\n"
MATRIX = "K: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 1., 2, 3, 4, 5, 6, 7, 8, 9 ]\n"
BASE64 = "data: !!binary |\n    ICAgAAAAAAAABEAAAAAAAAAAAAAAAAAAAAAAAAAA\n      AAAAAAAAAAAAAAAE\n"
NUMBERS = "data: [ 1., 2, 3, 4, 5, 6, 7, 8, 9 ]\n"

MALFORMED: dict[str, tuple[str, str]] = {
    "no cols": (HEAD + MATRIX.replace("   cols: 3\n", ""), "the matrix 'K' has no 'cols'"),
    "no rows": (HEAD + MATRIX.replace("   rows: 3\n", ""), "the matrix 'K' has no 'rows'"),
    "no type": (HEAD + MATRIX.replace("   dt: d\n", ""), "the matrix 'K' has no 'dt'"),
    "no data": (HEAD + MATRIX.replace("   " + NUMBERS, ""), "the matrix 'K' has no 'data'"),
    "large cols": (HEAD + MATRIX.replace("cols: 3", "cols: 2000000000"), "'cols' of the matrix 'K' is no whole"),
    "negative rows": (HEAD + MATRIX.replace("rows: 3", "rows: -3"), "'rows' of the matrix 'K' is no whole"),
    "broken rows": (HEAD + MATRIX.replace("rows: 3", "rows: 3.5"), "'rows' of the matrix 'K' is no whole"),
    "text for cols": (HEAD + MATRIX.replace("cols: 3", "cols: three"), "'cols' of the matrix 'K' is no whole"),
    "more than its data": (HEAD + MATRIX.replace("rows: 3", "rows: 300"), "is 300x3 but has 9 numbers"),
    "strange type": (HEAD + MATRIX.replace("dt: d", 'dt: "99999999d"'), "is no type of numbers"),
    "many channels": (HEAD + MATRIX.replace("dt: d", 'dt: "999d"'), "is 3x3x999 but has 9 numbers"),
    "damaged base64": (HEAD + MATRIX.replace(NUMBERS, BASE64), "is no list of numbers"),
    "a word among the numbers": (HEAD + MATRIX.replace("5,", "five,"), "is no list of numbers"),
    "lists in the list": (HEAD + MATRIX.replace("4, 5", "[4, 5]"), "is no list of numbers"),
    "400 digits": (HEAD + MATRIX.replace("5,", "5" * 400 + ","), "not finite"),
    "infinite": (HEAD + MATRIX.replace("5,", ".Inf,"), "not finite"),
    "nested lists": (HEAD + "K: " + "[" * 200_000, "is not closed"),
    "nested, closed": (HEAD + "K: " + "[" * 200_000 + "]" * 200_000, "has no numbers in 'K'"),
    "nested maps": (HEAD + "\n".join(" " * depth + "a:" for depth in range(2000)), "has no numbers in 'K'"),
    "twice": (HEAD + MATRIX + MATRIX, "'K' a second time"),
    "closed too often": (HEAD + "K: [1, 2]]", "not open"),
    "unclosed quotes": (HEAD + 'K: "' + '\\"' * 50_000, "is not closed"),
    "long key": (HEAD + "K" + " " * 200_000, "is no entry"),
    "long number": (HEAD + "K: " + "1" * 200_000, "has no numbers"),
    "nested tags": ('<?xml version="1.0"?><opencv_storage>' + "<a>" * 200_000, "nested deeper"),
    "other xml": ('<?xml version="1.0"?><calibration/>', "outermost tag is <calibration>"),
    "xml matrix without cols": (
        '<?xml version="1.0"?><opencv_storage><K type_id="opencv-matrix"><rows>3</rows><dt>d</dt>'
        "<data>1 2 3 4 5 6 7 8 9</data></K></opencv_storage>",
        "the matrix 'K' has no 'cols'",
    ),
    "json": ('{"K": ' + "[" * 200_000, "begins with neither"),
}  # fmt: skip

READ_EACH = """
import json, sys
from pathlib import Path
from studio.footage.capture.calibration_storage import Storage
from studio.foundations.errors import CalibrationError
for path in sorted(Path(sys.argv[1]).iterdir()):
    try:
        outcome = "read: " + str(Storage(path).numbers("K").shape)
    except CalibrationError as refusal:
        outcome = refusal.message
    print(json.dumps([path.stem, outcome]), flush=True)
"""


def read_in_a_child(folder: Path) -> dict[str, str]:
    """What reading each file of a folder came to, in a process that may die of it."""
    done = subprocess.run(
        [sys.executable, "-c", READ_EACH, str(folder)],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    outcomes = dict(json.loads(line) for line in done.stdout.splitlines())
    assert done.returncode == 0, f"died after {list(outcomes)}: {done.stderr[-2000:]}"
    return outcomes


def test_malformed_files_are_refused_by_name_and_the_process_lives(tmp_path: Path) -> None:
    for name, (text, _) in MALFORMED.items():
        (tmp_path / f"{name}.yml").write_text(text)
    outcomes = read_in_a_child(tmp_path)
    assert set(outcomes) == set(MALFORMED)
    for name, (_, message) in MALFORMED.items():
        assert message in outcomes[name], name
        assert f"'{name}.yml'" in outcomes[name]


def test_an_import_with_a_matrix_without_its_columns_is_refused(tmp_path: Path) -> None:
    """The pair of EasyMocap that ended the server: nothing of it may reach native memory."""
    intri = easymocap(tmp_path / "pair")
    text = intri.read_bytes().replace(b"  cols: 3\r\n", b"", 1)
    assert text != intri.read_bytes()
    intri.write_bytes(text)
    script = (
        "import sys; from pathlib import Path\n"
        "from studio.footage.capture.calibration_files import read_calibration\n"
        "from studio.foundations.errors import CalibrationError\n"
        "try: read_calibration(Path(sys.argv[1]))\n"
        "except CalibrationError as refusal: print(refusal.message)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(intri)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.returncode == 0, done.stderr
    assert "'intri.yml': the matrix 'K_00' has no 'cols'" in done.stdout


@pytest.mark.parametrize("suffix", ["yml", "xml"])
def test_what_opencv_writes_is_read_as_opencv_reads_it(tmp_path: Path, suffix: str) -> None:
    rng, path = np.random.default_rng(5), tmp_path / f"c.{suffix}"
    written: dict[str, np.ndarray] = {}
    for number, kind in enumerate((np.float64, np.float32, np.int32, np.uint8, np.float64, np.float32)):
        shape = ((3, 3), (4, 4), (1, 5), (7, 1), (40, 30), (6, 1, 2))[number]
        scale = 10.0 ** rng.integers(-8, 9) if kind in (np.float64, np.float32) else 100.0
        written[f"M{number}"] = (scale * rng.random(shape)).astype(kind)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, values in written.items():
        storage.write(name, values)
    storage.write("camera_name", 'the "left" one: no. 3')
    storage.write("width", 640)
    storage.write("error", 1e-12)
    storage.writeComment("rows: [ of a comment")
    storage.release()
    ours, theirs = Storage(path), cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert set(ours.names) == {*written, "camera_name", "width", "error"}
    for name, values in written.items():
        found = ours.numbers(name)
        assert found.shape == values.shape
        assert np.array_equal(found.astype(values.dtype), theirs.getNode(name).mat())
    assert ours.text("camera_name") == theirs.getNode("camera_name").string() == 'the "left" one: no. 3'
    assert ours.numbers("width") == 640.0
    assert ours.numbers("error") == 1e-12
    assert ours.text("width") == ours.text("nothing") == ""


HAND_WRITTEN = """%YAML:1.0
# written by a person
---
names:
- "a"
- 'b'
width:640   # px
"K": !!opencv-matrix
    rows: 2
    cols: 2
    dt: d
    data: [ 1, -2.5e1,   # first row
3., .5 ]
T: [1, 2, 3,]
t:
  - 4
  - 5
note: it's # a remark
board: { rows: 3, name: "x" }
deep:
  inner:
    most: 1
empty:
...
K: 7
"""


def test_what_people_write_is_read(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_bytes(HAND_WRITTEN.replace("\n", "\r\n").encode())
    storage = Storage(path)
    assert storage.names == ("names", "width", "K", "T", "t", "note", "board", "deep", "empty")
    assert storage.numbers("K").tolist() == [[1.0, -25.0], [3.0, 0.5]]
    assert storage.numbers("T").tolist() == [1.0, 2.0, 3.0]
    assert storage.numbers("t").tolist() == [4.0, 5.0]
    assert storage.numbers("width") == 640.0
    assert storage.text("note") == "it's"
    for name in ("names", "note", "board", "deep", "empty"):
        with pytest.raises(CalibrationError, match=f"no numbers in '{name}'"):
            storage.numbers(name)


def test_bytes_changed_at_random_never_end_the_process(tmp_path: Path) -> None:
    place = {"R": CAMERAS[0].rotation, "T": CAMERAS[0].translation[:, None]}
    sources = [easymocap(tmp_path / "pair").read_bytes()]
    sources += [
        opencv_sample(tmp_path / f"c.{suffix}", CAMERAS[0], **place).read_bytes() for suffix in ("yml", "xml")
    ]
    signs = (*(bytes([sign]) for sign in b'[]{}:!<"-#\\\n'), b"1e999", b"</data>", b"---")
    rng, folder = np.random.default_rng(14), tmp_path / "changed"
    folder.mkdir()
    for number in range(600):
        content = bytearray(
            sources[number % len(sources)].replace(b"K_00", b"K").replace(b"camera_matrix", b"K")
        )
        for _ in range(int(rng.integers(1, 6))):
            at, kind = int(rng.integers(len(content))), int(rng.integers(3))
            if kind == 0:
                content[at] = int(rng.integers(256))
            elif kind == 1:
                del content[at : at + int(rng.integers(1, 40))]
            else:
                content[at:at] = signs[int(rng.integers(len(signs)))]
        (folder / f"{number:04d}.yml").write_bytes(bytes(content))
    outcomes = read_in_a_child(folder)
    assert len(outcomes) == 600
    assert sum(outcome.startswith("read: ") for outcome in outcomes.values()) > 60
    assert sum(not outcome.startswith("read: ") for outcome in outcomes.values()) > 60
