"""What is said of a run's rig: predicted and measured, kept until the run changes, the same each time, or refused."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from drawn_people import ring_of_cameras
from looking_cameras import turned_to

from studio.foundations.errors import RunError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.results.inspection.reading import InspectedRun
from studio.results.rig import study as module
from studio.results.rig.study import (
    FILE_NAME,
    PRESENT,
    RigErrors,
    RigRequest,
    RigStudy,
    kept_rig,
    study_rig,
)
from studio.results.uncertainty.mask_faults import MaskFaults
from studio.results.uncertainty.twin import TwinCamera, TwinErrors, points_of, reported
from studio.sessions.results_store import ResultsWriter
from studio.sessions.run_record import FILE_NAME as RECORD_NAME

FRAMES = 10


def study_of(run: InspectedRun) -> RigStudy:
    kept = kept_rig(run)
    assert kept.study is not None
    assert kept.stale == ""
    return kept.study


def rigs_of(run: InspectedRun) -> dict[str, RigErrors]:
    return {one.name: one for one in study_of(run).rigs}


def names_tracked(
    monkeypatch: pytest.MonkeyPatch, begin: Callable[[Progress], None] = lambda _: None
) -> list[str]:
    """The cameras of each twin that is tracked from now on, in no time: off by 10 mm in each direction for each camera
    less than 8. begin : is given the progress of each.
    """
    tracked: list[str] = []

    class QuickTwins:
        def __init__(self, run: InspectedRun, frames: range, _: Progress) -> None:
            self.size = (len(frames), len(points_of(run.body)))

        def track(self, progress: Progress, rig: Sequence[TwinCamera], *, seed: int = 0) -> TwinErrors:
            begin(progress)
            tracked.append(" ".join(one.camera.name for one in rig))
            errors = np.full((*self.size, 3), 10.0 * (8 - len(rig)) + seed)
            return TwinErrors(errors, np.tile(np.eye(3), (*self.size, 1, 1)), ())

        def close(self) -> None:
            pass

    monkeypatch.setattr(module, "Twins", QuickTwins)
    return tracked


def test_the_present_rig_s_prediction_is_what_its_twin_showed(measured: InspectedRun) -> None:
    study = study_of(measured)
    assert [one.name for one in study.rigs] == [PRESENT]
    present = study.present
    assert study.points == points_of(measured.body)
    assert present.tracked_mm is not None
    assert present.predicted_mm == pytest.approx(present.tracked_mm)
    assert present.by_seed == pytest.approx([np.mean(present.tracked_mm)])
    assert 0.0 < present.predicted < 200.0
    assert [one.name for one in present.cameras] == ["cam1", "cam2", "cam3", "cam4"]
    camera = measured.run.cameras()[0]
    assert present.cameras[0].place == pytest.approx(camera.centre)
    assert not present.cameras[0].is_new
    assert study.frames == FRAMES
    assert len(study.figure.points) == len(study.points)


def test_rigs_are_predicted_without_a_twin_and_kept_beside_one_another(
    own: InspectedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracked = names_tracked(monkeypatch)
    study_rig(own, RigRequest(leave_out=True), no_progress)
    study_rig(own, RigRequest(best=2), no_progress)
    study_rig(own, RigRequest(move=["cam1=0,-3500,1500"], add=["0,3400,1500"]), no_progress)
    assert tracked == []
    rigs = rigs_of(own)
    changed = "cam1 to (0.00, -3.50, 1.50) m and one more at (0.00, 3.40, 1.50) m"
    without = [f"without cam{number}" for number in range(1, 5)]
    assert [*rigs] == [PRESENT, *without, "best 2 places beside the present cameras", changed]
    present = rigs[PRESENT].predicted
    assert all(rigs[name].predicted > present for name in without)
    assert all(rigs[name].tracked is None for name in (*without, changed))
    best = rigs["best 2 places beside the present cameras"]
    assert best.predicted < present
    study = study_of(own)
    chosen = {one.order: one for one in study.places if one.order}
    assert sorted(chosen) == [1, 2]
    assert best.cameras[4].place == pytest.approx(chosen[1].place)
    assert best.cameras[5].place == pytest.approx(chosen[2].place)
    assert all(one.predicted < present for one in study.places if one.sees > 0.9)
    assert [one.name for one in rigs[changed].cameras] == ["cam1-moved", "cam2", "cam3", "cam4", "new1"]
    assert [one.is_new for one in rigs[changed].cameras] == [True, False, False, False, True]
    tables = {one.name: one for one in study.tables()}
    assert len(tables["joints"].rows) == len(rigs) * len(study.points)
    assert tables["rigs"].records()[1]["tracked"] is None
    assert {row["rig"] for row in tables["cameras"].records()} == {
        "best 2 places beside the present cameras",
        changed,
    }


def test_a_whole_rig_instead_has_other_cameras_alone(
    own: InspectedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracked = names_tracked(monkeypatch)
    study_rig(own, RigRequest(best=3, instead=True, twins=True, lens="cam2", heights=[1500.0]), no_progress)
    rig = rigs_of(own)["best 3 places instead of the present cameras"]
    assert tracked == ["new1 new2 new3"]
    assert {one.like for one in rig.cameras} == {"cam2"}
    assert [one.place[2] for one in rig.cameras] == pytest.approx([1500.0] * 3)
    assert rig.tracked == pytest.approx(np.sqrt(3.0) * 50.0)


def test_what_is_tracked_is_kept_as_it_comes_and_not_tracked_again(
    own: InspectedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    def begin(progress: Progress) -> None:
        progress("tracking the twin", 0, 1)

    tracked = names_tracked(monkeypatch, begin)

    def stop(step: str, done: int, total: int) -> None:
        if step.startswith("without cam3"):
            assert step == "without cam3: tracking the twin"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study_rig(own, RigRequest(leave_out=True, twins=True), stop)
    assert tracked == ["cam2 cam3 cam4", "cam1 cam3 cam4"]
    known = {name: one.tracked for name, one in rigs_of(own).items() if name != PRESENT}
    assert [*known.values()] == [pytest.approx(50.0 * np.sqrt(3.0))] * 2 + [None] * 2
    study_rig(own, RigRequest(leave_out=True, twins=True), no_progress)
    assert tracked[2:] == ["cam1 cam2 cam4", "cam1 cam2 cam3"]
    study_rig(own, RigRequest(leave_out=True, twins=True, seeds=2), no_progress)
    assert tracked[4:] == ["cam1 cam2 cam3 cam4", *tracked[:4]]
    again = rigs_of(own)["without cam1"]
    assert again.by_seed == pytest.approx(np.sqrt(3.0) * np.array([50.0, 51.0]))
    assert again.tracked == pytest.approx(np.sqrt(3.0) * 50.5)
    study_rig(own, RigRequest(), no_progress, again=True)
    assert tracked[9:] == ["cam1 cam2 cam3 cam4"]
    assert [*rigs_of(own)] == [PRESENT]
    study_rig(own, RigRequest(frames=8), no_progress)
    assert study_of(own).frames == 8


def test_the_same_request_has_the_same_answer(own: InspectedRun) -> None:
    before = study_of(own)
    (own.run.folder / FILE_NAME).unlink()
    study_rig(own, RigRequest(), no_progress)
    assert study_of(own) == before
    request = RigRequest(best=2, heights=[1000.0, 2000.0])
    study_rig(own, request, no_progress)
    first = study_of(own)
    study_rig(own, request, no_progress)
    assert study_of(own) == first


def test_a_study_no_longer_holds_once_the_run_has_changed(
    own: InspectedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracked = names_tracked(monkeypatch)
    with ResultsWriter(own.run.folder) as writer:
        writer.forget_from(FRAMES - 1)
    kept = kept_rig(own)
    assert "have changed" in kept.stale
    assert kept.words == (f"The study no longer holds, since {kept.stale}: ask again.",)
    study_rig(own, RigRequest(), no_progress)
    assert study_of(own).frames == FRAMES - 1
    calibration = own.session.path / "calibration" / "cameras.toml"
    calibration.write_text(calibration.read_text() + "\n")
    assert kept_rig(own).stale
    assert tracked == ["cam1 cam2 cam3 cam4"]


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        (RigRequest(move=["cam9=0,0,0"]), "Camera 'cam9' is none of run 'small'"),
        (RigRequest(move=["cam1=1,2,3", "cam1=1,2,4"]), "Camera 'cam1' is moved twice"),
        (RigRequest(move=["cam1=1,2"]), "'1,2' is no place"),
        (RigRequest(add=["far"]), "'far' is no place"),
        (RigRequest(best=1, instead=True), "A rig of one camera tells nothing of depth"),
        (RigRequest(best=1, lens="cam9"), "has no camera 'cam9'"),
        (RigRequest(best=1, spacing=10.0), "at most 600 are looked at"),
        (RigRequest(best=12, spacing=3000.0), "have half of the body in their picture"),
    ],
)
def test_what_cannot_be_asked_is_refused(measured: InspectedRun, request_: RigRequest, why: str) -> None:
    before = (measured.run.folder / FILE_NAME).read_bytes()
    with pytest.raises(RunError) as refused:
        study_rig(measured, request_, no_progress)
    assert why in refused.value.message
    assert refused.value.hint
    assert (measured.run.folder / FILE_NAME).read_bytes() == before


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"live": True}, "its frames came on a clock, and a twin drops none"),
        ({"corrected": 3}, "it was corrected by hand, which no twin repeats"),
        ({"first": 1}, "some of its frames are missing or damaged"),
    ],
)
def test_runs_that_say_nothing_of_their_rig_are_refused(
    own: InspectedRun, changes: dict[str, object], why: str
) -> None:
    path = own.run.folder / RECORD_NAME
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    run = InspectedRun(own.session, own.session.run(own.run.name))
    with pytest.raises(
        RunError, match="Where cameras should stand cannot be said from run 'small'"
    ) as refused:
        study_rig(run, RigRequest(), no_progress)
    assert why in refused.value.message


def test_rigs_of_one_camera_are_refused(own: InspectedRun, monkeypatch: pytest.MonkeyPatch) -> None:
    cameras = own.run.cameras()
    monkeypatch.setattr(type(own.run), "cameras", lambda self: cameras[:2])
    with pytest.raises(RunError, match="None of 2 cameras can be left out"):
        study_rig(own, RigRequest(leave_out=True), no_progress)
    monkeypatch.setattr(type(own.run), "cameras", lambda self: cameras[:1])
    with pytest.raises(RunError, match="it has one camera, and a rig of one tells nothing of depth"):
        study_rig(own, RigRequest(), no_progress)


def test_faults_go_with_the_limbs_into_another_camera(measured: InspectedRun) -> None:
    cameras, poses = measured.run.cameras(), reported(measured.run).poses
    faults = MaskFaults(measured.body, cameras, poses)
    mask = np.zeros((cameras[0].height, cameras[0].width), np.uint8)
    faults.measure(0, {"cam1": mask})
    clean = np.full_like(mask, 255)
    assert not faults.given_to(clean, 0, 3, 0).any()
    moved = faults.in_cameras([cameras[2], cameras[0]], [2, 0])
    assert moved.given_to(clean, 0, 3, 0).all()
    assert not moved.given_to(clean, 1, 3, 0).any()


def at_angle(name: str, degrees: float) -> Camera:
    like, angle = ring_of_cameras(1)[0], np.radians(degrees)
    centre = np.array([3500.0 * np.cos(angle), 3500.0 * np.sin(angle), 1500.0])
    rotation = turned_to(centre, (0.0, 0.0, 950.0))
    return Camera(name, like.width, like.height, like.matrix, like.distortion, rotation, -rotation @ centre)


@pytest.mark.slow
def test_the_twin_confirms_that_side_by_side_cameras_gain_most_from_one_at_right_angles(
    track: Callable[..., InspectedRun],
) -> None:
    run = track((at_angle("cam1", 85.0), at_angle("cam2", 95.0)), particles=150, layers=6)
    across, beside = "3500,0,1500", "0,3500,1500"
    study_rig(run, RigRequest(add=[across], twins=True, seeds=2), no_progress)
    study_rig(run, RigRequest(add=[beside], twins=True, seeds=2), no_progress)
    present, right, near = study_of(run).rigs
    assert right.predicted < near.predicted <= present.predicted
    assert right.tracked is not None
    assert near.tracked is not None
    assert present.tracked is not None
    assert right.tracked < 0.8 * near.tracked
    assert right.tracked < 0.8 * present.tracked


@pytest.mark.slow
def test_the_twin_confirms_that_the_camera_is_missed_most_that_alone_sees_the_upper_body(
    track: Callable[..., InspectedRun],
) -> None:
    down = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.35], [0.0, 0.0, 0.0]])
    *legs, whole = ring_of_cameras(4)
    lower = tuple(replace(one, matrix=one.matrix - one.height * down) for one in legs)
    run = track((*lower, whole), particles=150, layers=6)
    study_rig(run, RigRequest(leave_out=True, twins=True), no_progress)
    rigs = rigs_of(run)
    without = [rigs[f"without cam{number}"] for number in range(1, 5)]
    assert max(without, key=lambda one: one.predicted).name == "without cam4"
    assert max(without, key=lambda one: one.tracked or 0.0).name == "without cam4"
