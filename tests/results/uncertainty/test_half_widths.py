"""Half widths of a run's joints: made of its twin, the same each time, kept until the run changes, or refused."""

import dataclasses
import json
import shutil

import msgspec
import numpy as np
import pytest
from toy_session import true_poses
from tracked_runs import finish

from studio.body.forward_kinematics import marker_points
from studio.body.person import marker_motion
from studio.foundations.errors import RunError
from studio.foundations.progress import no_progress
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.shared_page import shared_page
from studio.results.inspection.tables import Selection
from studio.results.inspection.views import look_over
from studio.results.uncertainty import half_widths as module
from studio.results.uncertainty import twin
from studio.results.uncertainty.half_widths import (
    FILE_NAME,
    WIDER,
    Uncertainty,
    frames_of_twin,
    kept_uncertainty,
    measure_uncertainty,
    true_coverage,
    uncertainty_of,
)
from studio.results.uncertainty.twin import TwinErrors, points_of, reported
from studio.results.uncertainty.twin_person import person_of_poses
from studio.runs.new_run import prepare_run
from studio.sessions.results_store import ResultsWriter
from studio.sessions.run_record import FILE_NAME as RECORD_NAME
from studio.sessions.session import Session

FRAMES = 10


def kept_of(run: InspectedRun) -> Uncertainty:
    kept = kept_uncertainty(run)
    assert kept.of is not None
    assert kept.stale == ""
    return kept.of


def test_each_joint_has_half_widths_a_bias_and_a_scatter(measured: InspectedRun) -> None:
    kept = kept_of(measured)
    assert [one.point for one in kept.points] == [marker.name for marker in measured.body.markers]
    assert (kept.frames, kept.track) == (FRAMES, "raw")
    assert 1 <= kept.blocks <= FRAMES // kept.alike
    for one in kept.points:
        half, eighty, most = one.half_widths_mm
        assert half is not None
        assert 0.0 < half < 300.0
        assert eighty is None or eighty >= half
        # Ten frames are fewer than nineteen blocks.
        assert most is None
        assert one.scatter_mm[0] is not None
        assert 0.0 < one.bias < 200.0
    wrist = next(one for one in kept.points if one.point == "LWrist")
    assert (wrist.carrier, wrist.limb) == ("left_forearm", "left arm")
    assert next(one.carrier for one in kept.points if one.point == "LKnee") == "left_thigh"
    assert {one.camera for one in kept.faults} == {camera.name for camera in measured.run.cameras()}


def test_the_twin_is_the_same_each_time_and_sees_no_truth(own: InspectedRun) -> None:
    before = kept_of(own)
    shutil.rmtree(own.session.path / "truth")
    measure_uncertainty(own, no_progress, again=True)
    assert kept_of(own) == before
    (own.run.folder / FILE_NAME).unlink()
    measure_uncertainty(own, no_progress)
    assert kept_of(own) == before


def test_what_is_kept_is_not_made_again_unless_the_run_has_changed(
    own: InspectedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[range] = []

    def counted(run: InspectedRun, frames: range, progress: object) -> TwinErrors:
        made.append(frames)
        count, points = len(frames), len(points_of(run.body))
        return TwinErrors(np.ones((count, points, 3)), np.tile(np.eye(3), (count, points, 1, 1)), ())

    monkeypatch.setattr(module, "track_twin", counted)
    measure_uncertainty(own, no_progress)
    assert made == []
    measure_uncertainty(own, no_progress, again=True)
    assert made == [range(FRAMES)]
    with ResultsWriter(own.run.folder) as writer:
        writer.forget_from(FRAMES - 1)
    kept = kept_uncertainty(own)
    assert "have changed" in kept.stale
    assert "measure them again" in kept.words[0]
    assert look_over(own, "uncertainty", Selection()).tables[0].rows == ()
    measure_uncertainty(own, no_progress)
    assert made[1:] == [range(FRAMES - 1)]
    assert not kept_uncertainty(own).stale
    calibration = own.session.path / "calibration" / "cameras.toml"
    calibration.write_text(calibration.read_text() + "\n")
    assert kept_uncertainty(own).stale


def test_cancelled_it_leaves_nothing(own: InspectedRun) -> None:
    (own.run.folder / FILE_NAME).unlink()
    before = {path.name for path in own.run.folder.iterdir()}
    steps: list[str] = []

    def stop(step: str, done: int, total: int) -> None:
        steps.append(step)
        if step == "tracking the twin" and done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        measure_uncertainty(own, stop)
    assert {path.name for path in own.run.folder.iterdir()} == before
    assert list(dict.fromkeys(steps)) == ["what the masks get wrong", "tracking the twin"]
    assert kept_uncertainty(own).of is None
    assert "has not been measured" in kept_uncertainty(own).words[0]


def test_the_twin_s_joints_are_where_the_run_reports_them(measured: InspectedRun) -> None:
    poses = reported(measured.run).poses
    person = person_of_poses(measured.body, poses, 60.0)
    markers = marker_motion(person)
    names = [marker.name for marker in measured.body.markers]
    own = marker_points(measured.body, poses)[:, [names.index(name) for name in markers.names]]
    assert markers.positions == pytest.approx(own, abs=0.01)


def test_errors_of_a_known_size_give_their_half_widths(measured: InspectedRun) -> None:
    rng, count = np.random.default_rng(2), 400
    points = len(points_of(measured.body))
    errors = rng.standard_normal((count, points, 3)) + np.array([30.0, 0.0, 0.0])
    turns = np.tile(np.eye(3), (count, points, 1, 1))
    known = uncertainty_of(measured.body, TwinErrors(errors, turns, ()), "raw", "")
    assert known.alike == 1
    for one in known.points:
        assert one.bias_mm == pytest.approx((30.0, 0.0, 0.0), abs=0.3)
        assert one.half_widths_mm[0] == pytest.approx(WIDER[0] * 30.0, abs=0.3)
        # Half, 80 and 95 % of the lengths of vectors of three normal numbers are below these.
        assert np.divide(one.scatter_mm, WIDER) == pytest.approx((1.54, 2.15, 2.80), abs=0.25)
        assert one.found == pytest.approx((0.5, 0.8, 0.95), abs=0.03)


def test_a_truth_says_how_often_the_half_widths_hold(measured: InspectedRun) -> None:
    kept = kept_of(measured)
    wide = msgspec.structs.replace(
        kept,
        points=tuple(msgspec.structs.replace(one, half_widths_mm=(0.0, 1e9, None)) for one in kept.points),
    )
    assert set(true_coverage(measured, wide).values()) == {(0.0, 1.0, None)}


def test_the_tables_have_what_is_kept(measured: InspectedRun) -> None:
    kept = kept_of(measured)
    shown = look_over(measured, "uncertainty", Selection())
    assert shown.notes == kept_uncertainty(measured).words
    rows = shown.table("joints").records()
    assert [row["within_50"] for row in rows] == [one.half_widths_mm[0] for one in kept.points]
    assert [row["within_95"] for row in rows] == [None] * len(kept.points)
    coverage = shown.table("coverage").records()
    assert [row["promised"] for row in coverage[:3]] == [0.5, 0.8, 0.95]
    assert 0.0 <= coverage[0]["true"] <= 1.0
    assert len(shown.table("faults").rows) == 4
    path = shown.table("path").records()
    assert len({row["point"] for row in path}) == 1
    assert [row["frame"] for row in path] == list(range(FRAMES))
    names = [marker.name for marker in measured.body.markers]
    places = marker_points(measured.body, reported(measured.run).poses)[:, names.index(str(path[0]["point"]))]
    assert [[row["x"], row["y"], row["z"]] for row in path] == places.tolist()
    arms = look_over(measured, "uncertainty", Selection(limb="left arm")).table("joints").column("point")
    assert arms == ["LShoulder", "LElbow", "LWrist"]


def test_a_shared_page_has_what_holds(own: InspectedRun) -> None:
    figures = '"view":"uncertainty"'
    assert figures in shared_page(own, 2).replace(" ", "")
    (own.run.folder / FILE_NAME).unlink()
    assert figures not in shared_page(own, 2).replace(" ", "")


def test_words_say_what_is_promised_and_what_is_not(measured: InspectedRun) -> None:
    kept = kept_of(measured)
    words = module.words_of(kept)
    assert words[0].startswith("Measured on 10 frames of the run drawn again, ")
    assert any("cannot be promised: that takes" in one for one in words)
    assert words[-1].startswith("Not in it: ")


def edit_record(run: InspectedRun, **changes: object) -> InspectedRun:
    path = run.run.folder / RECORD_NAME
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    return InspectedRun(run.session, run.session.run(run.run.name))


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"live": True}, "its frames came on a clock, and a twin drops none"),
        ({"ping_pong": True}, "its frames came on a clock"),
        ({"corrected": 3}, "it was corrected by hand, which no twin repeats"),
        ({"first": 1}, "some of its frames are missing or damaged"),
    ],
)
def test_runs_of_which_too_much_would_be_promised_are_refused(
    own: InspectedRun, changes: dict[str, object], why: str
) -> None:
    with pytest.raises(RunError, match="cannot be promised") as refused:
        measure_uncertainty(edit_record(own, **changes), no_progress)
    assert why in str(refused.value)


def test_few_frames_lost_ones_and_cameras_that_are_gone_are_refused(
    own: InspectedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    states = ["lost", *["tracked"] * (FRAMES - 1)]
    why = module._why_none(own, range(FRAMES), list(range(FRAMES)), states)
    assert why == "its body is lost or not in view in 1 frame, where its place cannot be drawn"
    footage = own.session.manifest.footage
    fewer = dataclasses.replace(footage, cameras=footage.cameras[1:])
    monkeypatch.setattr(own.session, "manifest", msgspec.structs.replace(own.session.manifest, footage=fewer))
    why = module._why_none(own, range(FRAMES), list(range(FRAMES)), ["tracked"] * FRAMES)
    assert why.startswith("the footage of cam1 has been taken away since")
    monkeypatch.undo()
    with ResultsWriter(own.run.folder) as writer:
        writer.forget_from(5)
    with pytest.raises(RunError, match="it has 5 finished frames, and 8 are needed"):
        frames_of_twin(own)


def test_masks_that_lack_much_of_the_body_are_refused(
    own: InspectedRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    least = max(one.holes for one in kept_of(own).faults)
    monkeypatch.setattr(twin, "MOST_MISSING", 0.99 * least)
    with pytest.raises(
        RunError, match=r"cannot be promised: .* % of the body are missing in the masks of cam"
    ):
        measure_uncertainty(own, no_progress, again=True)


def test_a_likelihood_that_reads_colours_is_refused(own: InspectedRun) -> None:
    made = prepare_run(own.session, weighting="blobs", fit_shape=False, allow_inconsistent=True)
    why = module._why_not_drawn(InspectedRun(own.session, made), range(FRAMES), ["cam1"])
    assert why == "its likelihood 'blobs' reads colours, and a twin wears other clothes"


def test_a_body_that_is_no_person_is_drawn_with_its_cones(session_on_disk: Session) -> None:
    knobs = {"refine_frames": False, "particles": 40, "layers": 4, "start_repeats": 1}
    made = prepare_run(session_on_disk, knobs=knobs, fit_shape=False, start_pose=true_poses()[0])
    finish(session_on_disk, made)
    run = InspectedRun(session_on_disk, made)
    known = measure_uncertainty(run, no_progress).of
    assert known is not None
    assert [one.point for one in known.points] == list(points_of(run.body))
    widths = [one.half_widths_mm[0] for one in known.points]
    assert all(width is None or 0.0 <= width < 200.0 for width in widths)
    assert any(widths)
