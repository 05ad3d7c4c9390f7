"""Named points as CSV beside the footage become the session's truth, in its world."""

from pathlib import Path

import numpy as np
import pytest
from sources import video_source, write_pose2sim
from toy_footage import rig

import studio
from studio.body.motion_files.trc import read_trc
from studio.footage.calibration.carried_points import carried
from studio.footage.capture.calibration_files import read_calibration, with_up
from studio.foundations.errors import CalibrationError, TruthError
from studio.foundations.geometry.camera import Camera
from studio.sessions.importers.importing import ImportOptions, add_footage, import_source
from studio.sessions.session import Session


def seen_points(cameras: tuple[Camera, ...], count: int = 3) -> np.ndarray:
    """(count, 2, 3) mm, in view of all cameras."""
    middle = np.mean([camera.centre + 3000.0 * camera.rotation[2] for camera in cameras], axis=0)
    return middle + np.random.default_rng(0).uniform(-100.0, 100.0, (count, 2, 3))


def write_points(path: Path, points: np.ndarray) -> Path:
    rows = [
        f"{frame},{name},{','.join(map(str, place))}"
        for frame, both in enumerate(points)
        for name, place in zip(("Hip", "Neck"), both, strict=True)
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(["frame,point,x_mm,y_mm,z_mm", *rows]) + "\n")
    return path


def truth_of(session: Session) -> np.ndarray:
    assert session.truth_path is not None
    motion = read_trc(session.truth_path)
    assert motion.names == ("Hip", "Neck")
    return motion.positions


def test_points_in_the_calibrations_world_turn_with_it(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    points = seen_points(rig(2, "cam_"))
    write_points(source / "truth" / "points.csv", points)
    plain = import_source(source, tmp_path / "plain").session
    np.testing.assert_allclose(truth_of(plain), points, atol=0.1)
    assert any("points.csv" in note for note in plain.manifest.notes)
    turned = import_source(
        source, tmp_path / "turned", ImportOptions(up="y", allow_inconsistent=True)
    ).session
    read = read_calibration(source / "calibration" / "Calib.toml")
    expected, _ = carried(points, read.cameras, with_up(read, "y").cameras)
    assert np.abs(expected - points).max() > 500.0
    np.testing.assert_allclose(truth_of(turned), expected, atol=0.1)


def test_a_calibration_beside_the_points_is_their_world(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    cameras = rig(2, "cam_")
    moved = tuple(
        type(camera)(
            camera.name,
            camera.width,
            camera.height,
            camera.matrix,
            camera.distortion,
            camera.rotation,
            camera.translation - camera.rotation @ np.array([0.0, 0.0, 700.0]),
        )
        for camera in cameras
    )
    write_pose2sim(source / "truth" / "theirs.toml", moved)
    points = seen_points(cameras)
    write_points(source / "truth" / "points.csv", points + np.array([0.0, 0.0, 700.0]))
    session = import_source(source, tmp_path / "made").session
    np.testing.assert_allclose(truth_of(session), points, atol=0.1)


def test_footage_added_to_an_empty_session_brings_its_points(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    points = seen_points(rig(2, "cam_"))
    write_points(source / "truth" / "points.csv", points)
    session = studio.new_session(tmp_path / "empty")
    added = add_footage(session, source).session
    np.testing.assert_allclose(truth_of(added), points, atol=0.1)


@pytest.mark.parametrize(
    ("points", "wrong"), [("frame,point,x,y,z\n0,Hip,a,b,c\n", TruthError), (None, CalibrationError)]
)
def test_points_that_cannot_be_used_stop_the_import(
    tmp_path: Path, points: str | None, wrong: type[Exception]
) -> None:
    source = video_source(tmp_path / "source")
    path = write_points(source / "truth" / "points.csv", 1000.0 * seen_points(rig(2, "cam_")))
    if points is not None:
        path.write_text(points)
    with pytest.raises(wrong):
        import_source(source, tmp_path / "made")
    assert not (tmp_path / "made").exists()


def test_times_of_points_count_by_the_footages_own_rate(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    points = seen_points(rig(2, "cam_"))
    rows = [
        f"{frame / 60.0:.4f},{name},{','.join(map(str, place))}"
        for frame, both in enumerate(points)
        for name, place in zip(("Hip", "Neck"), both, strict=True)
    ]
    (source / "truth").mkdir()
    (source / "truth" / "points.csv").write_text("\n".join(["time,point,x_mm,y_mm,z_mm", *rows]) + "\n")
    session = import_source(source, tmp_path / "made", ImportOptions(fps=60.0)).session
    np.testing.assert_allclose(truth_of(session), points, atol=0.1)


def test_a_table_of_angles_beside_the_points_is_left_out(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    points = seen_points(rig(2, "cam_"))
    write_points(source / "truth" / "points.csv", points)
    (source / "truth" / "joint_angles.csv").write_text("frame,A1_rad,A2_rad\n0,0.1,0.2\n")
    session = import_source(source, tmp_path / "made").session
    np.testing.assert_allclose(truth_of(session), points, atol=0.1)
    assert any("joint_angles.csv' was left out" in note for note in session.manifest.notes)
