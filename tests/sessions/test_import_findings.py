"""Calibrations that would make results wrong are not imported without a word."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sources import video_source
from toy_footage import rig

from studio.footage.capture.calibration_files import export_calibration
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.sessions.importers.importing import ImportOptions, import_source

CAMERAS = rig(2, "cam_")


def in_world(camera: Camera, turn: np.ndarray) -> Camera:
    """The camera in a world whose axes are the columns of `turn`."""
    return replace(camera, rotation=camera.rotation @ turn)


Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
Z_DOWN = np.diag([1.0, -1.0, -1.0])
SPECK = """
title = "a speck of 10 mm"
[[parameters]]
name = "turn"
kind = "angle"
max_step = 100
limb = "speck"
[[joints]]
name = "speck"
parent = "world"
type = "hinge"
sequence = [{ turn = "z", by = "turn" }]
[[limbs]]
name = "speck"
joint = "speck"
length = 10
radius_start = 2
radius_end = 2
"""


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda camera: in_world(camera, Y_UP), "Y axis points up in all pictures, not Z"),
        (lambda camera: in_world(camera, Z_DOWN), "(minus Z axis points up|under the floor)"),
        (
            lambda camera: replace(camera, translation=camera.translation / 1000.0),
            "metres were taken for millimetres",
        ),
    ],
)
def test_what_makes_results_wrong_blocks(
    tmp_path: Path, spoil: Callable[[Camera], Camera], message: str
) -> None:
    source = video_source(tmp_path / "source")
    path = source / "calibration" / "Calib.toml"
    export_calibration(tuple(spoil(camera) for camera in CAMERAS), path, "aniposelib")
    # The unit is named, as FreeMoCap does, so that the distance between the cameras is not asked.
    path.write_text(path.read_text() + "\n[metadata.board]\nsquare_length_mm = 30.0\n")
    with pytest.raises(CalibrationError, match=message) as caught:
        import_source(source, tmp_path / "made")
    assert "--allow-inconsistent" in caught.value.hint
    assert not (tmp_path / "made").exists()
    report = import_source(source, tmp_path / "made", ImportOptions(allow_inconsistent=True))
    assert any("axis points up" in line or "floor" in line or "metres" in line for line in report.warnings)


@pytest.mark.parametrize(
    ("up", "axes"),
    [
        ("y", Y_UP),
        ("-z", Z_DOWN),
        ("x", np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])),
        ("-y", np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])),
        ("-x", np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])),
    ],
)
def test_the_remedies_work(tmp_path: Path, up: str, axes: np.ndarray) -> None:
    # The columns of `axes` are the file's axes in our world; its `up` is our z.
    sign = -1.0 if up.startswith("-") else 1.0
    turn = axes if (sign * axes[:, "xyz".index(up[-1])])[2] > 0 else axes.T
    np.testing.assert_allclose(sign * turn[:, "xyz".index(up[-1])], [0.0, 0.0, 1.0])
    assert np.linalg.det(turn) == pytest.approx(1.0)
    source = video_source(tmp_path / "source")
    path = source / "calibration" / "Calib.toml"
    spoilt = (in_world(camera, turn) for camera in CAMERAS)
    export_calibration(
        tuple(replace(camera, translation=camera.translation / 1000.0) for camera in spoilt),
        path,
        "aniposelib",
    )
    path.write_text(path.read_text() + "\n[metadata.board]\nsquare_length_mm = 30.0\n")
    with pytest.raises(CalibrationError):
        import_source(source, tmp_path / "made", ImportOptions(up=up))
    report = import_source(source, tmp_path / "made", ImportOptions(up=up, unit="m"))
    assert report.warnings == ()
    assert any("as requested" in note for note in report.notes)
    for found, wanted in zip(report.session.cameras(), CAMERAS, strict=True):
        np.testing.assert_allclose(found.centre[2], wanted.centre[2], atol=1e-6)
        np.testing.assert_allclose(found.rotation[:, 2], wanted.rotation[:, 2], atol=1e-9)
        assert found.quarter_turns == 0
        assert np.linalg.det(found.rotation) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("up", "right", "axes"),
    [(up, "z", np.eye(3)) for up in ("x", "y", "-x", "-y", "-z")]
    + [(up, "y", Y_UP) for up in ("x", "z", "-x", "-y", "-z")],
)
def test_the_remedy_for_a_wrong_axis_does_not_lead_to_another(
    tmp_path: Path, up: str, right: str, axes: np.ndarray
) -> None:
    """Whichever axis was named wrongly: the one that the remedy names is right."""
    source = video_source(tmp_path / "source")
    path = source / "calibration" / "Calib.toml"
    export_calibration(tuple(in_world(camera, axes) for camera in CAMERAS), path, "aniposelib")
    with pytest.raises(CalibrationError, match=f"{right.upper()} axis points up .* not") as caught:
        import_source(source, tmp_path / "made", ImportOptions(up=up, unit="mm"))
    assert f"--up={right} " in caught.value.hint.replace(",", " ")
    report = import_source(source, tmp_path / "made", ImportOptions(up=right, unit="mm"))
    assert not any("axis" in line for line in report.warnings)


def test_a_named_unit_is_believed_and_the_doubt_is_said(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    close = (replace(camera, translation=camera.translation / 100.0) for camera in CAMERAS)
    export_calibration(tuple(close), source / "calibration" / "Calib.toml", "aniposelib")
    report = import_source(source, tmp_path / "made", ImportOptions(unit="mm"))
    assert any("metres were taken for millimetres" in line for line in report.warnings)
    for camera, wanted in zip(report.session.cameras(), CAMERAS, strict=True):
        np.testing.assert_allclose(camera.translation, wanted.translation / 100.0, atol=1e-6)


def test_a_small_rig_around_a_small_body_is_of_its_unit(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    close = (replace(camera, translation=camera.translation / 100.0) for camera in CAMERAS)
    export_calibration(tuple(close), source / "calibration" / "Calib.toml", "aniposelib")
    path = source / "calibration" / "Calib.toml"
    path.write_text(path.read_text() + "\n[metadata.board]\nsquare_length_mm = 30.0\n")
    (source / "subject.toml").write_text('body = "speck"\n')
    (source / "bodies").mkdir()
    (source / "bodies" / "speck.toml").write_text(SPECK)
    report = import_source(source, tmp_path / "made")
    assert not any("millimetres" in line or "unit" in line for line in report.warnings)


@pytest.mark.parametrize(("words", "message"), [({"unit": "inch"}, "no unit"), ({"up": "w"}, "no axis")])
def test_units_and_axes_that_are_none(tmp_path: Path, words: dict[str, str], message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        import_source(video_source(tmp_path / "source"), tmp_path / "made", ImportOptions(**words))


def test_what_is_only_doubtful_warns(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    off = replace(
        CAMERAS[0], matrix=CAMERAS[0].matrix + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 32.0], [0.0, 0.0, 0.0]])
    )
    export_calibration((off, CAMERAS[1]), source / "calibration" / "Calib.toml", "pose2sim")
    report = import_source(source, tmp_path / "made")
    assert any("principal point" in line for line in report.warnings)
