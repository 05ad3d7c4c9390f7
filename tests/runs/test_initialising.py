"""A start pose found in a frame of a session, from pictures alone; what is written, and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras
from random_people import people_session, random_moments

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import read_trc
from studio.body.subject import Subject
from studio.foundations.errors import NotFoundError, RunError, WorkCancelledError
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import marker_lengths, skeleton_of_height
from studio.results.drawing_footage.recipe_file import Picture, Recipe
from studio.runs.new_run import prepare_run
from studio.runs.search_space import default_sigma, parameter_names, search_space
from studio.runs.setup.initialising import (
    UNSURE,
    InitialPose,
    hull_of,
    initialise,
    keep_pose,
    seek,
    whole_problem,
)
from studio.runs.setup.start_pose_file import keep_start_pose, start_pose_from_file
from studio.runs.setup.workflow import StepStatus, workflow_of
from studio.search.settings import default_settings
from studio.search.trackers.initialisation import QUICK
from studio.search.trackers.start_candidates import facing
from studio.sessions.session import Session, start_pose_files

SETTINGS = default_settings("annealed", "edge-region-silhouette")


def found(session: Session, frame: int, body: str = "") -> InitialPose:
    """A pose that was not searched for."""
    tree = session.body(body or None)
    return InitialPose(
        frame=frame, body=tree.name, names=parameter_names(tree), pose=tree.neutral, confidence=0.876,
        margin=1.0, rival=None, agreement=1.0, overlap=0.8, hull_litres=80.0, evaluations=1, note="",
    )  # fmt: skip


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """Three moments of walking, running and boxing in random headings, one a frame; small pictures of four cameras."""
    rng = np.random.default_rng(21)
    skeleton = skeleton_of_height(1760.0, rng)
    motions = [make_motion(name, skeleton, 60, 30.0, {}) for name in ("walk", "run", "box")]
    motion = random_moments(motions, 3, np.random.default_rng(9), reach=250.0)
    picture = Picture(width=320, height=240, quality=16.0)
    recipe = Recipe(
        title="People", motion="stand", frames=3, body="human25", picture=picture, wardrobe="plain"
    )
    subject = Subject(body="human25", height_mm=1760.0, lengths_mm=marker_lengths(motion))
    place, cameras = tmp_path_factory.mktemp("people") / "people", ring_of_cameras(4, distance=2700.0)
    return people_session(place, motion, subject, cameras, recipe)


def errors_in(session: Session, frames: range, seed: int) -> list[float]:
    """The mean marker errors, mm, of the poses found in some frames of a session of people."""
    body = session.body()
    assert session.truth_path is not None
    truth = read_trc(session.truth_path)
    order = [truth.names.index(marker.name) for marker in body.markers]
    errors = []
    for frame in frames:
        pose = initialise(session, frame, seed=seed).pose
        apart = marker_points(body, pose)[0] - truth.positions[frame, order]
        errors.append(float(np.linalg.norm(apart, axis=1).mean()))
    return errors


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_people_in_random_moments_and_headings_are_found(people: Session) -> None:
    assert max(errors_in(people, range(3), seed=2)) <= 80.0


@pytest.mark.slow
def test_a_run_without_start_pose_finds_one(people: Session) -> None:
    steps: list[tuple[str, int, int]] = []
    run = prepare_run(people, first=1, last=2, progress=lambda *reported: steps.append(reported))
    assert run.record.start_pose is not None
    assert run.record.start_source.startswith("found in frame 1, confidence ")
    assert steps[-1][0] == "checking each limb"
    assert not (people.path / "start_pose.csv").exists()


def test_a_cancelled_search_ends(people: Session) -> None:
    steps: list[str] = []

    def stopped(step: str, _done: int, _total: int) -> None:
        steps.append(step)
        if len(steps) == 3:
            raise WorkCancelledError("Stopped.")

    with pytest.raises(WorkCancelledError):
        initialise(people, 0, progress=stopped)
    assert len(steps) == 3


def test_a_frame_that_is_not_there(people: Session) -> None:
    with pytest.raises(NotFoundError):
        initialise(people, 99)


def test_the_session_gets_a_start_pose_once_and_nothing_is_lost(session_on_disk: Session) -> None:
    session, names = session_on_disk, parameter_names(session_on_disk.body())
    first = keep_pose(session, found(session, 0))
    assert first.name == "start_pose.csv"
    assert session.start_pose() is not None
    assert first.read_text().splitlines()[0] == ",".join(("frame", *names))
    assert keep_pose(session, found(session, 5)).name == "start_pose-frame-5.csv"
    assert keep_pose(session, found(session, 5)).name == "start_pose-frame-5-2.csv"
    first.write_text("mine")
    assert keep_pose(session, found(session, 1), replace=True) == first
    assert session.start_pose_frame() == 1
    assert (session.path / "start_pose-before.csv").read_text() == "mine"
    assert keep_pose(session, found(session, 1), replace=True) == first
    assert (session.path / "start_pose-before.csv").read_text() == "mine"
    assert (session.path / "start_pose-before-2.csv").is_file()


def test_a_pose_of_low_confidence_is_in_doubt_until_it_is_confirmed(session_on_disk: Session) -> None:
    session = session_on_disk

    def step() -> StepStatus:
        return next(one for one in workflow_of(session).steps if one.step == "start-pose")

    keep_pose(session, found(session, 0))
    assert (step().state, step().why) == ("done", "")
    keep_pose(session, replace(found(session, 2), confidence=UNSURE - 0.01), replace=True)
    assert step().words == "found in frame 2, confidence 74 %"
    assert "It may face the other way" in step().why
    before = sorted(session.path.glob("start_pose*"))
    start = session.start_pose()
    assert start is not None
    for _ in range(2):
        keep_start_pose(session, session.body(), start, 2)
        assert (step().words, step().why) == ("found in frame 2, confidence 74 %, confirmed", "")
    assert sorted(session.path.glob("start_pose*")) == before
    start[0] += 1.0
    keep_start_pose(session, session.body(), start)
    assert step().words == "set by hand in frame 2"


def test_the_start_pose_of_another_body_is_one_that_track_takes(session_on_disk: Session) -> None:
    """What `initialise --body X` finds is where `track --body X` begins, and the session's own pose stays its own."""
    keep_pose(session_on_disk, found(session_on_disk, 1))
    other = load_body("human25")
    assert session_on_disk.start_pose(other) is None
    place = keep_pose(session_on_disk, found(session_on_disk, 2, "human25"))
    assert place.name == "start_pose-of-human25.csv"
    assert start_pose_files(session_on_disk.path) == (session_on_disk.path / "start_pose.csv", place)
    run = prepare_run(session_on_disk, body="human25", fit_shape=False)
    assert (run.record.start_source, run.record.first) == ("the session's start pose", 2)
    assert prepare_run(session_on_disk, fit_shape=False).record.first == 1
    # A second one replaces it only on request; the first then stays beside it.
    assert keep_pose(session_on_disk, found(session_on_disk, 4, "human25")) != place
    assert keep_pose(session_on_disk, found(session_on_disk, 5, "human25"), replace=True) == place
    assert session_on_disk.start_pose_frame("human25") == 5
    assert (session_on_disk.path / "start_pose-of-human25-before.csv").is_file()


def test_the_source_of_a_pose_names_its_confidence(session_on_disk: Session) -> None:
    assert found(session_on_disk, 7).source == "found in frame 7, confidence 88 %"


def test_a_frame_without_a_body_is_refused(session_on_disk: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studio.runs.problem_source.anything_seen", lambda _: False)
    with pytest.raises(RunError, match="shows no body"):
        initialise(session_on_disk, 0)


def test_an_arm_that_is_fixed_to_the_world_is_found_with_one_camera(session_on_disk: Session) -> None:
    found = initialise(session_on_disk, 0)
    assert "One camera" in found.note
    assert found.confidence > 0.9
    assert found.margin == np.inf
    assert found.overlap > 0.6


@pytest.mark.slow
def test_a_drawn_body_without_feet_is_sought_with_feet() -> None:
    """On masks of a body with feet, the one without faces the right way, for no feet could point the other way."""
    cameras, with_feet = ring_of_cameras(4), load_body("human25")
    truth = with_feet.neutral.copy()
    truth[[0, 3]] = 200.0, 0.8
    evidence = drawn_evidence(with_feet, truth, cameras)
    body = load_body("human31")
    space = search_space(body, default_sigma(body, 60.0))
    hull, box, note = hull_of(body, cameras, evidence)
    assert not note
    middle = hull.weights() @ hull.centres
    assert np.linalg.norm(middle[:2] - [200.0, 0.0]) < 60.0
    problem = whole_problem(body, cameras, SETTINGS, evidence)
    found = seek(problem, space, body, hull, box, cameras=4, seed=0, effort=QUICK)
    assert facing(body, found.pose[None])[0] @ facing(with_feet, truth[None])[0] > 0.8


def test_masks_without_a_volume_in_common_make_no_hull() -> None:
    cameras, body = ring_of_cameras(2), load_body("human25")
    hull, _, note = hull_of(body, cameras, drawn_evidence(body, None, cameras))
    assert hull is None
    assert "no volume" in note
    assert hull_of(body, cameras[:1], drawn_evidence(body, body.neutral, cameras[:1]))[0] is None


def test_the_file_is_one_that_track_takes(session_on_disk: Session, tmp_path: Path) -> None:
    place = keep_pose(session_on_disk, found(session_on_disk, 3))
    copy = tmp_path / "pose.csv"
    copy.write_bytes(place.read_bytes())
    body = session_on_disk.body()
    assert np.array_equal(start_pose_from_file(copy, body, 3, 60.0)[0], body.neutral)
