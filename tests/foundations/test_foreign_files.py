"""Whatever a file of others makes a parser raise is said with the file's name; pipes are refused, not waited for."""

import errno
import io
import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from studio.body.reader import read_body
from studio.body.subject import read_subject
from studio.footage.calibration.floor import read_clicks
from studio.footage.capture.calibration_files import find_calibrations, read_calibration, read_intrinsics
from studio.foundations.errors import CalibrationError, FootageError, StudioError
from studio.foundations.foreign_files import foreign_file
from studio.search.behaviour.model_file import read_model
from studio.sessions.archives import unpack

DEEP_TOML = "a = " + "[" * 20_000
DEEP_JSON = "[" * 20_000

LENS = "matrix = [[{number}, 0.0, 64.0], [0.0, 120.0, 48.0], [0.0, 0.0, 1.0]]\nsize = [128, 96]\n"
CAMERA = (
    "[cam]\n"
    + LENS
    + "distortions = [0.0, 0.0, 0.0, 0.0]\nrotation = [0.0, 0.0, 0.0]\ntranslation = [0, 0, 9]\n"
)
OPENCV = (
    "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n"
    "  data: [ 120., 0., {centre}, 0., 120., 48., 0., 0., 1. ]\n"
)


def archive_with_wrong_offsets(path: Path) -> None:
    """A zip whose index points before the file's begin: seeking there is an OSError (invalid argument)."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as packed:
        packed.writestr("a.txt", "content")
    content = bytearray(stream.getvalue())
    end = content.rfind(b"PK\x05\x06")
    offset = int.from_bytes(content[end + 16 : end + 20], "little")
    content[end + 16 : end + 20] = (offset + 1000).to_bytes(4, "little")
    path.write_bytes(bytes(content))


def model_with_a_flipped_bit(path: Path) -> None:
    """Compressed arrays whose stream is damaged in the middle: zlib.error."""
    np.savez_compressed(path.with_suffix(".npz"), head=np.arange(5000) % 251)
    content = bytearray(path.with_suffix(".npz").read_bytes())
    content[len(content) // 3] ^= 0xFF
    content[50:70] = b"\xff" * 20
    path.write_bytes(bytes(content))


FILES: dict[str, tuple[Callable[[Path], object], Callable[[Path], object]]] = {
    "offsets.zip": (archive_with_wrong_offsets, lambda path: unpack(path, path.parent)),
    "noise.zip": (lambda path: path.write_bytes(b"PK\x05\x06" * 60), lambda path: unpack(path, path.parent)),
    "noise.tar.xz": (lambda path: path.write_bytes(bytes(range(256))), lambda path: unpack(path, path.parent)),
    "digits_calib.toml": (lambda path: path.write_text(CAMERA.format(number="9" * 400)), read_calibration),
    "more_digits_calib.toml": (lambda path: path.write_text(CAMERA.format(number="9" * 5000)), read_calibration),
    "deep_calib.toml": (lambda path: path.write_text(DEEP_TOML), read_calibration),
    "deep_lens_calib.toml": (lambda path: path.write_text(DEEP_TOML), read_intrinsics),
    "centre.yml": (lambda path: path.write_text(OPENCV.format(centre="1e308")), read_intrinsics),
    "words.cal": (lambda path: path.write_bytes(b"\xff\xfe\x00"), read_calibration),
    "flipped.behaviour": (model_with_a_flipped_bit, read_model),
    "clicks.json": (lambda path: path.write_bytes(b'{"points": [{"pixels": {"\xff\xfe": [1, 2]}}]}'), read_clicks),
    "deep_clicks.json": (lambda path: path.write_text(DEEP_JSON), read_clicks),
    "deep_body.toml": (lambda path: path.write_text(DEEP_TOML), read_body),
    "digits_body.toml": (lambda path: path.write_text("a = " + "9" * 5000), read_body),
    "deep_subject.toml": (lambda path: path.write_text(DEEP_TOML), read_subject),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_what_a_parser_raises_is_said_with_the_files_name(tmp_path: Path, name: str) -> None:
    make, read = FILES[name]
    make(tmp_path / name)
    with pytest.raises(StudioError) as caught:
        read(tmp_path / name)
    assert name in caught.value.message
    assert caught.value.hint.endswith(".")
    assert len(caught.value.message) < 600


def test_a_folder_with_deep_toml_is_looked_through(tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(DEEP_TOML)
    (tmp_path / "cameras.toml").write_text("a = " + "9" * 5000)
    assert [path.name for path in find_calibrations(tmp_path)] == ["cameras.toml"]


def test_a_full_disk_is_no_fault_of_the_file(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No space"), foreign_file(tmp_path, StudioError, "a file", "Look."):
        raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    ("problem", "said"),
    [
        (RecursionError("maximum recursion depth exceeded"), "(maximum recursion depth exceeded)"),
        (MemoryError(), "(MemoryError)"),
        (OSError(errno.EINVAL, "Invalid argument"), "Invalid argument"),
        (AssertionError("x" * 10_000), "…)"),
    ],
)
def test_any_exception_names_the_file(tmp_path: Path, problem: Exception, said: str) -> None:
    with (
        pytest.raises(FootageError, match=r"'a\.mp4' is not a video, or is damaged") as caught,
        foreign_file(tmp_path / "a.mp4", FootageError, "a video", "Copy it again."),
    ):
        raise problem
    assert said in caught.value.message
    assert len(caught.value.message) < 300


def test_a_file_whose_folder_was_moved_meanwhile_is_no_wrong_path(tmp_path: Path) -> None:
    path = tmp_path / "renamed" / "cameras.toml"
    with (
        pytest.raises(CalibrationError, match=r"cameras\.toml' is no longer there") as caught,
        foreign_file(path, CalibrationError, "a calibration", "Copy it again."),
    ):
        path.read_bytes()
    assert "new name" in caught.value.hint


def test_what_says_itself_what_is_wrong_passes(tmp_path: Path) -> None:
    with (
        pytest.raises(CalibrationError, match=r"^camera 3 Look"),
        foreign_file(tmp_path / "a.toml", FootageError, "a video", "Copy it again."),
    ):
        raise CalibrationError("camera 3", "Look.")


# ---------------------------------------------------------------------- what is no regular file

READ = """
import json, sys
from pathlib import Path
from studio.search.behaviour.model_file import read_model
from studio.body.reader import read_body
from studio.body.subject import read_subject
from studio.footage.calibration.floor import read_clicks
from studio.footage.capture.calibration_files import find_calibrations, read_calibration
from studio.footage.capture.stream_files import mend_recording
from studio.footage.capture.pictures import check_picture, read_picture
from studio.footage.capture.timestamps import read_timestamps
from studio.body.motion_files.trc import read_trc
from studio.footage.capture.video import measure_video
from studio.footage.capture.video import probe_video
from studio.foundations.errors import StudioError
from studio.sessions.archives import unpack
from studio.sessions.importers.importing import import_source
from studio.sessions.manifest import read_manifest
from studio.sessions.named_rows import pose_frame

folder = Path(sys.argv[1])
asked = {
    "cam1.mp4": [probe_video, measure_video, mend_recording, lambda path: unpack(path, folder)],
    "a.png": [read_picture, check_picture],
    "a.toml": [read_calibration, read_body, read_subject],
    "a.cal": [read_calibration],
    "a.yml": [read_calibration],
    "extri.yml": [read_calibration],
    "a.qca.txt": [read_calibration],
    "a.trc": [read_trc],
    "a.csv": [read_timestamps, pose_frame],
    "a.json": [read_clicks],
    "session.json": [lambda path: read_manifest(folder)],
    "a.behaviour": [read_model],
}
for name, readers in asked.items():
    for number, read in enumerate(readers):
        try:
            read(folder / name)
            said = "read"
        except StudioError as refusal:
            said = refusal.message
        print(json.dumps([f"{name} {number}", said]), flush=True)
print(json.dumps(["calibrations", str(find_calibrations(folder))]), flush=True)
try:
    import_source(Path(sys.argv[2]), folder / "session")
    said = "imported"
except StudioError as refusal:
    said = refusal.message
print(json.dumps(["import", said]), flush=True)
"""


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names on this system")
def test_pipes_are_refused_by_name_and_not_waited_for(tmp_path: Path) -> None:
    """In a child process: one that waits would wait for ever."""
    folder, source = tmp_path / "pipes", tmp_path / "source"
    folder.mkdir()
    names = ("cam1.mp4", "a.png", "a.toml", "a.cal", "a.yml", "a.qca.txt", "a.trc", "a.csv", "a.json")
    for name in (*names, "intri.yml", "extri.yml", "session.json", "a.behaviour", "cameras.toml"):
        os.mkfifo(folder / name)
    source.mkdir()
    (source / "calibration.toml").write_text(CAMERA.format(number="120.0").replace("[cam]", "[cam1]"))
    os.mkfifo(source / "cam1.mp4")
    done = subprocess.run(
        [sys.executable, "-c", READ, str(folder), str(source)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    said = dict(json.loads(line) for line in done.stdout.splitlines())
    assert done.returncode == 0, f"after {list(said)}: {done.stderr[-2000:]}"
    calibrations, imported = said.pop("calibrations"), said.pop("import")
    assert "cam1.mp4" in imported
    assert "pipe" in imported
    assert "intri.yml" not in calibrations
    for key, message in said.items():
        assert key.split()[0] in message, (key, message)
        assert "is a pipe and no regular file" in message, (key, message)


def test_devices_and_sockets_are_refused_too(tmp_path: Path) -> None:
    with (
        pytest.raises(FootageError, match="'null' is a device and no regular file"),
        foreign_file(Path("/dev/null"), FootageError, "a video", "Copy it again."),
    ):
        pass
