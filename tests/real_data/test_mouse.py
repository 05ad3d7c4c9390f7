"""A mouse from the pictures of a board and raw videos to errors in mm, through the verbs a person uses (issue 13).

The strokes are those of one person in the first picture of each camera. Sheets of all views are kept to be looked at
(STUDIO_ARTEFACTS, default artefacts/mouse).
"""

import shutil
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import pytest
from kept_overlays import keep_overlays

import studio
from studio.body.motion_files.truth_files import read_truth
from studio.results.evaluation.errors import Evaluation
from studio.runs.checking import RunCheck
from studio.runs.setup.mask_quality import MaskQuality
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

pytestmark = [pytest.mark.slow, pytest.mark.real_data]

STROKES = Path(__file__).with_name("mouse_setup_strokes.json")
BOARD = "charuco:8x11,24,18.75,DICT_4X4_1000"
ASKED = (
    "Nose",
    "Ear_L",
    "Ear_R",
    "Neck",
    "Trunk",
    "TTI",
    "Haunch_left",
    "Haunch_right",
    "Shoulder_left",
    "Shoulder_right",
)
"""The points of the issue's Show 2."""
MOST_MM = 6.0
"""Measured were 5.6 to 5.8 with two seeds, the right shoulder (9) and the haunches (7.5) worst."""


@dataclass(frozen=True)
class Workflow:
    """What the steps gave."""

    session: Session
    masks: MaskQuality
    confidence: float
    run: StoredRun
    check: RunCheck
    errors: Evaluation


@pytest.fixture(scope="module")
def mouse(real_data: Path) -> Path:
    folder = real_data / "mouse"
    if not folder.is_dir():
        pytest.skip("the mouse's footage is not here")
    return folder


@pytest.fixture(scope="module")
def workflow(mouse: Path, tmp_path_factory: pytest.TempPathFactory) -> Workflow:
    take = tmp_path_factory.mktemp("mouse") / "take"
    (take / "truth").mkdir(parents=True)
    shutil.copytree(mouse / "videos", take / "videos")
    shutil.copyfile(mouse / "truth_frames_0_59.csv", take / "truth" / "points.csv")
    shutil.copyfile(mouse / "calibration" / "calibration.toml", take / "truth" / "calibration.toml")
    (take / "subject.toml").write_text('body = "mouse"\n')
    (take / "calibration").mkdir()
    board = mouse / "board"
    studio.calibrate(
        board,
        BOARD,
        intrinsics=board,
        extrinsics=board,
        floor="frame:0",
        to=take / "calibration" / "cameras.toml",
    )
    session = studio.import_footage(take, take.parent / "session")
    studio.background(session, "strokes", strokes=STROKES, tune=False)
    session = Session(session.path)
    masks = studio.mask_quality(session)
    start = studio.initialise(session)
    run = studio.track(session, name="first").run
    keep_overlays("mouse", session, run, 30)
    return Workflow(session, masks, start.confidence, run, studio.check(run), studio.evaluate(run))


def test_the_board_gives_the_cameras_and_the_truth_arrives_in_their_world(
    workflow: Workflow, mouse: Path
) -> None:
    report = msgspec.json.decode(
        (workflow.session.path.parent / "take/calibration/cameras.report.json").read_bytes()
    )
    assert report
    assert workflow.session.truth_path is not None
    carried = read_truth(workflow.session.truth_path, workflow.session.manifest.fps)
    given = read_truth(mouse / "truth_frames_0_59.csv", workflow.session.manifest.fps)
    assert carried.positions.shape == given.positions.shape == (60, 15, 3)
    # Distances in the animal do not depend on the world; the two calibrations differ by up to a percent.
    for one, other in (("Nose", "TTI"), ("TTI", "TailTip"), ("Haunch_left", "Haunch_right")):
        spans = [
            np.linalg.norm(
                motion.positions[:, motion.names.index(one)] - motion.positions[:, motion.names.index(other)],
                axis=1,
            )
            for motion in (carried, given)
        ]
        np.testing.assert_allclose(spans[0], spans[1], atol=2.0)
    # It sits on the base, so its points are between the base and a few centimetres above.
    heights = carried.positions[..., 2]
    assert np.nanmin(heights) > -5.0
    assert np.nanmax(heights) < 80.0


def test_the_masks_of_the_strokes_agree_in_all_views(workflow: Workflow) -> None:
    print([(view.camera, round(view.agreement, 3)) for view in workflow.masks.views])
    assert all(view.agreement >= 0.88 for view in workflow.masks.views)
    assert not workflow.masks.doubts


def test_the_start_pose_is_found_without_a_click(workflow: Workflow) -> None:
    print(workflow.confidence)
    assert workflow.confidence >= 0.7


def test_all_frames_are_tracked_without_a_jump(workflow: Workflow) -> None:
    print(workflow.check.in_words())
    assert workflow.check.count == 120
    assert not workflow.check.lost
    assert not workflow.check.turned
    assert not workflow.check.jumps
    assert workflow.check.inside_mean >= 0.85


def test_the_points_are_where_people_saw_them(workflow: Workflow) -> None:
    """The labels' own uncertainty is 2 to 3 mm."""
    errors = workflow.errors.per_marker_mm
    print({name: round(value, 1) for name, value in errors.items()})
    assert len(workflow.errors.frames) == 60
    assert float(np.mean([errors[name] for name in ASKED])) <= MOST_MM
