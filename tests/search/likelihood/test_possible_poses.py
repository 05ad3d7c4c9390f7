"""Hard priors: real poses are never refused, impossible ones are."""

from pathlib import Path

import numpy as np
import pytest
from sample_walk import WALK

from studio.body.branches import within_limits
from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.inverse_kinematics import pose_from_markers
from studio.body.model import BodyModel
from studio.body.motion_files.reading import read_recording
from studio.body.motion_files.trc import read_trc
from studio.body.person import PersonMotion, marker_motion
from studio.body.retargeting import on_skeleton
from studio.body.subject import Subject, fit_subject
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import marker_lengths, skeleton_of_height
from studio.search.likelihood.hard_priors import HardPriors
from studio.sessions.session import Session

HEIGHT = 1760.0
# Mean distance (mm) left by inverse kinematics of motions that the body can make.
EXACT = 1.0


def _body(name: str = "human31", motion: PersonMotion | None = None) -> BodyModel:
    lengths = {} if motion is None else marker_lengths(motion)
    return fit_subject(load_body(name), Subject(name, HEIGHT, lengths))[0]


def _markers(body: BodyModel) -> dict[str, np.ndarray]:
    places = marker_points(body, body.neutral)[0]
    return dict(zip([marker.name for marker in body.markers], places, strict=True))


def _middle(body: BodyModel, one: str, two: str) -> np.ndarray:
    markers = _markers(body)
    return 0.5 * (markers[one] + markers[two])


def _reaching(body: BodyModel, **targets: np.ndarray) -> np.ndarray:
    """The rest pose with some markers elsewhere, within the limits; elbows and knees before them are free."""
    markers = _markers(body)
    chains = {"Wrist": ("Elbow",), "Ankle": ("Knee",)}
    free = {f"{name[0]}{part}" for name in targets for part in chains.get(name[1:], ())}
    kept = {name: place for name, place in markers.items() if name not in free} | targets
    pose, error = pose_from_markers(body, tuple(kept), np.array(list(kept.values())), body.neutral)
    assert error < 10.0
    return pose


@pytest.mark.parametrize("side", ["L", "R"])
def test_an_arm_through_the_trunk_and_a_hand_in_the_head_are_refused(side: str) -> None:
    body = _body()
    priors = HardPriors(body)
    for target in (_middle(body, "Hip", "Neck"), _middle(body, "Neck", "Head")):
        pose = _reaching(body, **{f"{side}Wrist": target})
        assert priors.hold(pose[None])
        assert not priors.hold(pose[None], limbs_apart=True)


def test_shins_through_each_other_are_refused_and_beside_each_other_are_not() -> None:
    body = _body()
    priors, markers = HardPriors(body), _markers(body)
    crossed = _reaching(body, LAnkle=markers["RAnkle"], RAnkle=markers["LAnkle"])
    assert priors.hold(crossed[None])
    assert not priors.hold(crossed[None], limbs_apart=True)
    # One ankle 220 mm before the other: crossed legs, as people stand.
    ahead = np.array([110.0, 0.0, 0.0])
    beside = _reaching(body, LAnkle=markers["RAnkle"] + ahead, RAnkle=markers["LAnkle"] - ahead)
    assert priors.hold(beside[None], limbs_apart=True)


def test_an_upper_arm_in_the_trunk_is_refused() -> None:
    body = _body()
    markers = _markers(body)
    inside = _middle(body, "Hip", "Neck") + np.array([0.0, 20.0, 0.0])
    elbow = markers["LShoulder"] + (inside - markers["LShoulder"]) * 327.0 / np.linalg.norm(
        inside - markers["LShoulder"]
    )
    kept = {name: place for name, place in markers.items() if name not in {"LWrist"}} | {"LElbow": elbow}
    pose, _ = pose_from_markers(body, tuple(kept), np.array(list(kept.values())), body.neutral)
    assert not HardPriors(body).apart(pose[None])


def _truth(body: BodyModel, motion: PersonMotion, step: int) -> tuple[np.ndarray, float]:
    """Poses of a motion by inverse kinematics, within the limits, and the mean remaining distance (mm)."""
    truth, pose, poses, errors = marker_motion(motion), body.neutral, [], []
    for positions in truth.positions[::step]:
        pose, error = pose_from_markers(body, truth.names, positions, pose)
        poses.append(pose)
        errors.append(error)
    return np.array(poses), float(np.mean(errors))


@pytest.mark.slow
def test_the_walk_samples_truth_is_never_refused() -> None:
    session = Session(WALK)
    body, truth = session.body(), read_trc(WALK / "truth" / "walk.trc")
    pose, poses = session.start_pose(body), []
    assert pose is not None
    for positions in truth.positions[::5]:
        pose, error = pose_from_markers(body, truth.names, positions, pose)
        assert error < EXACT
        poses.append(pose)
    assert HardPriors(body).hold(np.array(poses), limbs_apart=True).all()


@pytest.mark.parametrize("body_name", ["human31", "human34"])
@pytest.mark.parametrize("name", ["walk", "run", "box", "handstand", "stand"])
def test_written_motions_are_never_refused(body_name: str, name: str) -> None:
    motion = make_motion(name, skeleton_of_height(HEIGHT, np.random.default_rng(1)), 150, 60.0, {})
    body = _body(body_name, motion)
    poses, error = _truth(body, motion, 15)
    assert error < EXACT
    assert HardPriors(body).hold(poses, limbs_apart=True).all()


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.parametrize(
    ("file", "step"),
    [
        ("05_01.amc", 100),
        ("CMU_01_01.bvh", 600),
        ("amp_humanoid_run.npz", 20),
        ("amp_humanoid_cartwheel.npz", 72),
    ],
)
def test_recorded_motions_are_never_refused(real_data: Path, file: str, step: int) -> None:
    folder = real_data / "cmu-motion"
    recorded = read_recording(folder / file, folder / "05.asf" if file.endswith(".amc") else None)
    motion = on_skeleton(recorded, skeleton_of_height(HEIGHT, np.random.default_rng(1)))
    body = _body("human31", motion)
    poses, error = _truth(body, motion, step)
    assert error < 10.0
    assert HardPriors(body).hold(poses, limbs_apart=True).all()


@pytest.mark.real_data
def test_the_lee_walks_initial_pose_holds_once_it_is_written_within_the_limits(real_data: Path) -> None:
    body = load_body("human31")
    pose = np.array((real_data / "lee-walk" / "InitialPose.txt").read_text().split(), dtype=float)
    priors = HardPriors(body)
    assert not priors.hold(pose[None]).any()
    assert priors.apart(pose[None]).all()
    assert priors.hold(within_limits(body, pose)[None], limbs_apart=True).all()
