"""Exports as a whole: options, what is refused, what is left behind, cancelling, zips, calibrations."""

import dataclasses
import tomllib
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from export_runs import MADE, moving_poses, track_of

from studio.foundations.errors import (
    ExportError,
    NotFoundError,
    SessionError,
    SettingsError,
    WorkCancelledError,
)
from studio.foundations.knobs import knobs_of
from studio.foundations.registry import PlugInError
from studio.operations.exports import discard_export, export_into_run, kept_exports, kept_file
from studio.results.export.exporting import export_run, options_for
from studio.results.export.formats import FORMATS, format_of_file
from studio.results.export.naming import joint_names, name_map
from studio.results.export.options import ExportOptions
from studio.results.export.task import ExportTask, Written, agreed, apart, turned_apart


@pytest.fixture
def arm(make_run):
    """A run of the planar arm, 40 frames."""
    return make_run("planar_arm4", lambda body: track_of(moving_poses(body, 40)))


def left_behind(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if not path.name.startswith("toy-")}


def test_every_option_belongs_to_some_format_and_every_format_is_written() -> None:
    taken = {name for form in FORMATS.values() for name in form.takes}
    assert taken == {entry.name for entry in knobs_of(ExportOptions)}
    scenes = {name for name, form in FORMATS.items() if form.what == "scene"}
    assert {name for name, form in FORMATS.items() if form.write is None} == scenes


def test_auto_becomes_what_the_format_expects() -> None:
    assert (options_for(FORMATS["trc"], {}).unit, options_for(FORMATS["trc"], {}).up) == ("m", "y")
    assert (options_for(FORMATS["c3d"], {}).unit, options_for(FORMATS["c3d"], {}).up) == ("mm", "z")
    assert options_for(FORMATS["bvh"], {"unit": "cm"}).unit == "cm"


@pytest.mark.parametrize(
    ("name", "requested", "error", "words"),
    [
        ("glb", {"unit": "cm"}, ExportError, "Option 'unit' means nothing to GLB"),
        ("bvh", {"unit": "inch"}, SettingsError, "'unit' cannot be 'inch'"),
        ("bvh", {"colour": "red"}, SettingsError, "no setting 'colour'"),
        ("bvh", {"fps": -1}, SettingsError, "'fps'"),
        ("trc", {"first": 9, "last": 9}, ExportError, "No frame lies from 9 to before 9"),
    ],
)
def test_wrong_options_are_refused(name: str, requested: dict, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        options_for(FORMATS[name], requested)


def test_an_unknown_ending_names_the_formats() -> None:
    with pytest.raises(SettingsError, match="no export format 'fbx'") as refused:
        format_of_file(Path("walk.fbx"))
    assert "glb" in refused.value.hint
    with pytest.raises(ExportError, match="no ending"):
        format_of_file(Path("walk"))


def test_a_track_that_there_is_not(arm, tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match="no track 'smooth'"):
        export_run(*arm, FORMATS["bvh"], {"track": "smooth"}, tmp_path / "arm.bvh")
    assert left_behind(tmp_path) == set()


def test_a_file_that_does_not_read_back_is_not_offered(arm, tmp_path: Path) -> None:
    """The old file stands, nothing else is left, and the cause is named."""

    def broken(task: ExportTask) -> Written:
        task.place.write_text("half")
        return Written((task.place,), agreed(task.place, 12.5, 0.0))

    place = tmp_path / "arm.bvh"
    place.write_text("the old one")
    with pytest.raises(ExportError, match=r"differs when it is read back: 12\.5 mm"):
        export_run(*arm, dataclasses.replace(FORMATS["bvh"], write=broken), {"track": MADE}, place)
    assert place.read_text() == "the old one"
    assert left_behind(tmp_path) == {"arm.bvh"}


def test_cancelling_leaves_nothing(arm, tmp_path: Path) -> None:
    response: list[str] = []

    def stopped(step: str, _done: int, _total: int) -> None:
        response.append(step)
        if len(response) > 1:
            raise WorkCancelledError("Stopped.")

    with pytest.raises(WorkCancelledError):
        export_run(*arm, FORMATS["csv"], {"track": MADE}, tmp_path / "arm.csv", progress=stopped)
    assert response[0] == "writing"
    assert left_behind(tmp_path) == set()


def test_a_place_that_cannot_be_written(arm, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="is a folder"):
        export_run(*arm, FORMATS["csv"], {"track": MADE}, tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(SessionError, match="cannot be written"):
        export_run(*arm, FORMATS["csv"], {"track": MADE}, tmp_path / "file" / "arm.csv")


def test_the_scene_needs_its_recorder(arm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A studio that was not installed, only put on the path, has nothing plugged in."""
    monkeypatch.setattr("studio.foundations.registry.metadata.entry_points", lambda **which: ())
    with pytest.raises(PlugInError, match="No installed package gives 'scene-recorder'"):
        export_run(*arm, FORMATS["viser"], {"track": MADE}, tmp_path / "arm.viser")


def test_exports_are_kept_in_the_run(arm) -> None:
    session, run = arm
    assert kept_exports(run) == ()
    first = export_into_run(session, run, FORMATS["trc"], {"track": MADE, "unit": "mm"})
    assert first.file == "toy-planar_arm4-first-moved-mm.trc"
    assert kept_file(run, first.file).stat().st_size == first.bytes
    second = export_into_run(session, run, FORMATS["c3d"], {"track": MADE, "last": 20})
    assert second.file.endswith("-moved-to20.c3d")
    assert [kept.file for kept in kept_exports(run)] == [second.file, first.file]
    again = export_into_run(session, run, FORMATS["trc"], {"track": MADE, "unit": "mm"})
    assert [kept.file for kept in kept_exports(run)] == [again.file, second.file]
    discard_export(run, second.file)
    assert [kept.file for kept in kept_exports(run)] == [first.file]
    for name in (second.file, "../run.json", f"{first.file}.said.json", ""):
        with pytest.raises(NotFoundError):
            kept_file(run, name)


def test_several_files_become_one_zip(arm, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studio.results.export.marker_files.MOST_C3D_FRAMES", 25)
    session, run = arm
    kept = export_into_run(session, run, FORMATS["c3d"], {"track": MADE, "split": True})
    assert kept.file.endswith("-c3d.zip")
    with zipfile.ZipFile(kept_file(run, kept.file)) as packed:
        assert packed.testzip() is None
        assert [name[-6:] for name in packed.namelist()] == ["-1.c3d", "-2.c3d"]


def test_calibrations_for_other_tools(arm, tmp_path: Path) -> None:
    """TOML read by tomllib, YAML by OpenCV: the run's own camera."""
    session, run = arm
    camera = run.cameras()[0]
    report = export_run(session, run, FORMATS["toml"], {}, tmp_path / "Calib.toml")
    reported = tomllib.loads(report.files[0].read_text())[camera.name]
    np.testing.assert_allclose(np.array(reported["translation"]) * 1000.0, camera.translation, atol=1e-6)
    np.testing.assert_allclose(cv2.Rodrigues(np.array(reported["rotation"]))[0], camera.rotation, atol=1e-9)
    report = export_run(session, run, FORMATS["yml"], {}, tmp_path / "cameras.yml")
    storage = cv2.FileStorage(str(report.files[0]), cv2.FILE_STORAGE_READ)
    np.testing.assert_allclose(storage.getNode("camera_matrix").mat(), camera.matrix, atol=1e-9)
    storage.release()
    with pytest.raises(ExportError, match=r"No calibration 'opencv' is written as '\.toml'") as refused:
        export_run(session, run, FORMATS["toml"], {"calibration": "opencv"}, tmp_path / "Calib.toml")
    assert "pose2sim or aniposelib" in refused.value.hint


@pytest.mark.parametrize("name", ["halpe26", "mixamo", "opensim"])
def test_maps_give_each_joint_and_point_one_name(name: str) -> None:
    reported = name_map(name)
    assert len(set(reported.joints.values())) == len(reported.joints)
    assert all(place.marker or place.limb for places in reported.points.values() for place in places)
    own = ("pelvis", "thorax", "tail")
    names, note = joint_names(own, name)
    assert len(set(names)) == 3
    assert "tail" in note


def test_what_is_missing_must_be_missing_in_both() -> None:
    points = np.zeros((3, 2, 3))
    holed = points.copy()
    holed[1, 0] = np.nan
    assert apart(points, points + 0.06) == pytest.approx(0.06 * np.sqrt(3.0))
    assert apart(holed, holed) == 0.0
    assert apart(points, holed) == np.inf
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])[None]
    assert turned_apart(turn, np.eye(3)[None]) == pytest.approx(90.0)
    with pytest.raises(ExportError, match="inf mm"):
        agreed(Path("walk.trc"), float("inf"))
    with pytest.raises(ExportError, match=r"0\.02 degrees"):
        agreed(Path("walk.bvh"), 0.0, 0.02)
