"""The shape from a run's first frames: fitted, stored, reported, and unchanged where it is undetermined."""

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras
from moving_bodies import standing

from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions
from studio.body.model import BodyModel
from studio.body.shape_space import dimension_kinds, keeps_taped, untaped_lengths
from studio.body.subject import REPORTED_SPREAD, Subject, fit_subject
from studio.evidence.settings import EvidenceSettings
from studio.runs.new_run import prepare_run
from studio.runs.search_space import default_sigma
from studio.runs.setup import shape_on_the_way
from studio.runs.setup.shape_on_the_way import FOLDER, GUESSED, MEASURED, FittedShape, shaped_body
from studio.runs.setup.workflow import run_changes
from studio.search.settings import default_settings
from studio.sessions.run_record import RunRecord
from studio.sessions.session import Session

WALK = Path(__file__).parents[2] / "sample_sessions" / "walk"
CAMERAS = ring_of_cameras(4, 480, 360)


@pytest.fixture
def walk(tmp_path: Path) -> Session:
    """A copy of the bundled walk without the shape that comes with it."""
    shutil.copytree(WALK, tmp_path / "walk", ignore=shutil.ignore_patterns("runs", FOLDER))
    return Session(tmp_path / "walk")


def shaped(body: BodyModel, true: BodyModel, height_spread: float | None = None) -> FittedShape:
    """The shape of a body in footage of another one that moves a leg and an arm."""
    names = [entry.name for entry in body.parameters]
    pose = standing(body, left_shoulder_rx=0.6, right_shoulder_rx=-0.6)

    def posture(frame: int) -> np.ndarray:
        moved = pose.copy()
        moved[names.index("left_hip_ry")] += 0.06 * frame
        moved[names.index("right_elbow_ry")] -= 0.05 * frame
        return moved

    return shaped_body(
        body,
        CAMERAS,
        lambda frame: drawn_evidence(true, posture(frame), CAMERAS, frame),
        range(8),
        posture(0),
        default_sigma(body, 30.0),
        height_spread=height_spread,
    )


def test_lengths_that_were_guessed_of_a_height_are_fitted() -> None:
    """Longer legs under a shorter trunk: measured lengths stay as they are, guessed ones come near."""
    body, _ = fit_subject(load_body("human31"), Subject(height_mm=1760.0))
    legs = [f"{side}_{part}_length" for side in ("left", "right") for part in ("thigh", "shin")]
    true = with_dimensions(body, {name: 1.06 * body.dimensions[name] for name in legs})
    true = with_dimensions(true, {"torso_length": 0.92 * body.dimensions["torso_length"]})

    def off(found: BodyModel) -> float:
        return float(
            np.mean([abs(found.dimensions[name] - true.dimensions[name]) for name in (*legs, "torso_length")])
        )

    kept, fitted = (shaped(body, true, spread).body for spread in (None, REPORTED_SPREAD))
    assert off(kept) == off(body)
    assert keeps_taped(body, kept.dimensions)
    assert not keeps_taped(body, fitted.dimensions)
    assert off(fitted) < 0.5 * off(body)


def test_thicker_limbs_are_found_and_bones_are_kept() -> None:
    body, _ = fit_subject(load_body("human31"), Subject(height_mm=1760.0))
    assert body.definition is not None
    kinds = dimension_kinds(body.definition)
    radii = [name for name, kind in kinds.items() if kind == "radius" and ("arm" in name or "shin" in name)]
    stout = with_dimensions(body, {name: 1.3 * body.dimensions[name] for name in radii})
    found = shaped(body, stout)
    lengths = {name for name, kind in kinds.items() if kind == "length"} - untaped_lengths(body)
    assert all(found.body.dimensions[name] == body.dimensions[name] for name in lengths)
    ratios = [found.body.dimensions[name] / body.dimensions[name] for name in radii]
    assert np.mean(ratios) > 1.15
    assert found.overlap[1] > found.overlap[0]


@pytest.mark.slow
def test_a_run_begins_with_the_shape_says_so_and_fits_it_once(
    walk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = prepare_run(walk, last=20).record
    own = walk.body().dimensions
    assert any("shape was fitted to frames 0 to 29" in note for note in first.notes)
    assert first.dimensions["left_thigh_length"] == own["left_thigh_length"]
    assert first.dimensions["left_thigh_radius_start"] != own["left_thigh_radius_start"]
    monkeypatch.setattr(shape_on_the_way, "shaped_body", lambda *_, **__: pytest.fail("fitted again"))
    again = prepare_run(walk, last=20, seed=5).record
    assert (again.dimensions, again.start_pose) == (first.dimensions, first.start_pose)
    plain = prepare_run(walk, last=20, fit_shape=False).record
    assert plain.dimensions == dict(own)
    assert (first.subject_dimensions, plain.subject_dimensions) == (dict(own), {})
    assert run_changes(walk, walk.run(first.name)) == []
    assert first.notes[-1].endswith(MEASURED)


@pytest.mark.slow
def test_a_run_of_which_only_a_height_is_known_fits_the_lengths(walk: Session) -> None:
    height = prepare_run(walk, last=12, subject=Subject(body="human31", height_mm=1760.0)).record
    assert height.notes[-1].endswith(GUESSED)
    assert height.dimensions["left_thigh_length"] != height.subject_dimensions["left_thigh_length"]


@pytest.fixture
def bundled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunRecord:
    """A run of the bundled walk with the shape that comes with it: it is not fitted."""
    shutil.copytree(WALK, tmp_path / "bundled" / "walk", ignore=shutil.ignore_patterns("runs"))
    with monkeypatch.context() as patched:
        patched.setattr(shape_on_the_way, "shaped_body", lambda *_, **__: pytest.fail("fitted again"))
        return prepare_run(Session(tmp_path / "bundled" / "walk"), last=20).record


def test_the_demo_begins_without_fitting_the_shape(bundled: RunRecord) -> None:
    assert any("shape was fitted" in note for note in bundled.notes)


@pytest.mark.slow
def test_the_shape_that_comes_with_the_walk_is_the_one_that_is_fitted(
    walk: Session, bundled: RunRecord
) -> None:
    fitted = prepare_run(walk, last=20).record
    # Thirty tracked frames lie between them: another processor's rounding moves a foot's length by 2.4 mm.
    assert bundled.dimensions == pytest.approx(fitted.dimensions, abs=5.0)
    assert bundled.start_pose == pytest.approx(fitted.start_pose, abs=5.0)


@pytest.mark.slow
def test_a_fit_is_found_again_whatever_the_last_bits_are(
    walk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sizes and start pose are computed anew each time, and another processor rounds otherwise."""
    start = walk.start_pose()
    assert start is not None
    first = prepare_run(walk, last=20, start_pose=start).record
    monkeypatch.setattr(shape_on_the_way, "shaped_body", lambda *_, **__: pytest.fail("fitted again"))
    nudged = np.nextafter(start, np.inf)
    assert prepare_run(walk, last=20, start_pose=nudged).record.dimensions == first.dimensions


def test_a_fit_with_the_masks_of_another_default_is_not_taken(
    walk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = walk.start_pose()
    assert start is not None
    keys = list[str]()
    for defaults in (EvidenceSettings(), EvidenceSettings(mask_shadow_darkest=0.6)):
        monkeypatch.setattr(shape_on_the_way, "EvidenceSettings", lambda kept=defaults: kept)
        settings = dataclasses.replace(default_settings(), evidence=defaults)
        keys.append(shape_on_the_way._key(walk, walk.body(), settings, start, range(30), None))
    assert keys[0] != keys[1]


def test_few_frames_or_one_camera_give_no_shape(walk: Session, session_on_disk: Session) -> None:
    late = prepare_run(walk, first=145, start_pose=walk.start_pose())
    assert late.record.dimensions == dict(walk.body().dimensions)
    start = np.zeros(4)
    arm = prepare_run(session_on_disk, start_pose=start).record
    assert arm.dimensions == dict(session_on_disk.body().dimensions)
    assert not (session_on_disk.path / FOLDER).exists()


@pytest.mark.slow
def test_masks_that_show_something_else_change_nothing(
    walk: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    fitted = shape_on_the_way.fitted_shape

    def worse(*given: object) -> object:
        found = fitted(*given)  # pyright: ignore[reportArgumentType]
        return dataclasses.replace(found, overlap=(0.5, 0.4))

    monkeypatch.setattr(shape_on_the_way, "fitted_shape", worse)
    record = prepare_run(walk, last=12).record
    assert record.dimensions == dict(walk.body().dimensions)
    assert any("The shape was not fitted" in note for note in record.notes)
