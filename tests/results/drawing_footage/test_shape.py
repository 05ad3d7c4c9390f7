"""People with the lengths of a tracker's shape file, in any subject's numbers."""

from pathlib import Path

import numpy as np
import pytest
from small_recipes import small

from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions
from studio.body.forward_kinematics import limb_ends
from studio.body.inverse_kinematics import pose_from_markers
from studio.body.model import BodyModel
from studio.body.motion_files.trc import read_trc
from studio.body.person import joint_points, marker_motion
from studio.body.subject import fit_subject, read_subject
from studio.foundations.errors import BodyError, StudioError
from studio.results.drawing_footage.circuit import circuit
from studio.results.drawing_footage.person import (
    marker_lengths,
    skeleton_of_subject,
    subject_of_file,
    with_hands_and_feet,
)
from studio.results.drawing_footage.recipe_file import read_recipe
from studio.results.drawing_footage.recipes import synthesize
from studio.sessions.session import Session

BODY = load_body("human31")
ORDER = BODY.definition.shape_order


@pytest.fixture
def shape_file(tmp_path: Path) -> Path:
    """A made-up subject: every length of the body's own changed by up to 8 % on its own."""
    factors = np.random.default_rng(12).uniform(0.92, 1.08, len(ORDER))
    values = [BODY.dimensions[name] * factor for name, factor in zip(ORDER, factors, strict=True)]
    path = tmp_path / "shape.txt"
    path.write_text("\n".join(f"{value:.6f}" for value in values))
    return path


def sized(path: Path) -> BodyModel:
    return fit_subject(BODY, subject_of_file(path, "human31"))[0]


def test_the_bones_have_the_shapes_lengths(shape_file: Path) -> None:
    subject = subject_of_file(shape_file, "human31")
    motion = circuit(skeleton_of_subject(subject), np.arange(12) / 30.0, {})
    lengths = marker_lengths(motion)
    dimensions = subject.dimensions_mm
    wanted = {"Hip_Neck": dimensions["torso_length"], "Neck_Head": dimensions["head_length"]}
    for letter, side in (("L", "left"), ("R", "right")):
        wanted[f"Hip_{letter}Hip"] = dimensions[f"{side}_hip_offset"]
        wanted[f"{letter}Hip_{letter}Knee"] = dimensions[f"{side}_thigh_length"]
        wanted[f"{letter}Knee_{letter}Ankle"] = dimensions[f"{side}_shin_length"]
        wanted[f"Neck_{letter}Shoulder"] = dimensions[f"{side}_clavicle_length"]
        wanted[f"{letter}Shoulder_{letter}Elbow"] = dimensions[f"{side}_upper_arm_length"]
        wanted[f"{letter}Elbow_{letter}Wrist"] = dimensions[f"{side}_forearm_length"]
    assert lengths == pytest.approx(wanted, abs=1e-6)


@pytest.mark.slow
def test_the_body_of_that_shape_meets_every_marker(shape_file: Path) -> None:
    motion = circuit(skeleton_of_subject(subject_of_file(shape_file, "human31")), np.arange(40) / 20.0, {})
    markers, body = marker_motion(motion), sized(shape_file)
    pose = body.neutral
    for frame in range(0, 40, 3):
        pose, error = pose_from_markers(body, markers.names, markers.positions[frame], pose)
        assert error < 1e-3, frame


def test_legs_of_different_lengths_are_levelled(shape_file: Path) -> None:
    bones = skeleton_of_subject(subject_of_file(shape_file, "human31"))
    left, right = (thigh + shin for thigh, shin in zip(bones.thigh, bones.shin, strict=True))
    motion = circuit(bones, np.arange(60) / 60.0, {})
    points = joint_points(motion)
    higher = np.mean(points["left_thigh"][:, 2] - points["right_thigh"][:, 2])
    assert higher == pytest.approx(left - right, abs=3.0)
    assert abs(left - right) > 6.0


def test_hands_and_feet_are_drawn_where_the_subject_has_them(shape_file: Path) -> None:
    subject = subject_of_file(shape_file, "human31")
    bones = skeleton_of_subject(subject)
    bare, _ = fit_subject(BODY, subject)
    full, _ = fit_subject(BODY, with_hands_and_feet(subject, bones))
    names = {limb.name for limb in full.drawn} - {limb.name for limb in bare.drawn}
    assert names == {"left foot", "right foot", "left hand", "right hand"}
    extra = ("foot", "hand")
    assert all(bare.dimensions[n] == full.dimensions[n] for n in ORDER if not any(e in n for e in extra))
    pose = full.neutral
    ends = limb_ends(full, pose[None])[0]
    at = {limb.name: ends[index] for index, limb in enumerate(full.drawn)}
    foot = at["left foot"]
    assert np.linalg.norm(foot[1] - foot[0]) == pytest.approx(bones.foot, rel=0.12)
    assert (foot[1] - foot[0])[0] > 0.95 * np.linalg.norm(foot[1] - foot[0])


def test_a_wrong_shape_file_is_refused(tmp_path: Path, shape_file: Path) -> None:
    with pytest.raises(BodyError, match="not a file"):
        subject_of_file(tmp_path / "none.txt", "human31")
    shape_file.write_text(" ".join(shape_file.read_text().split()[:-1]))
    with pytest.raises(BodyError, match="57"):
        subject_of_file(shape_file, "human31")
    flat = with_dimensions(BODY, {"left_shin_length": 0.0})
    short = tmp_path / "short.txt"
    short.write_text(" ".join(str(flat.dimensions[name]) for name in ORDER))
    with pytest.raises(BodyError, match="left_shin_length"):
        skeleton_of_subject(subject_of_file(short, "human31"))


@pytest.mark.slow
def test_a_recipe_may_name_shape_and_sigma(tmp_path: Path, shape_file: Path) -> None:
    names = [entry.name for entry in BODY.parameters]
    sigma = np.linspace(0.01, 0.31, len(names))
    (tmp_path / "steps.txt").write_text(" ".join(map(str, [*sigma, *np.zeros(62)])))
    entries = {"shape": "shape.txt", "sigma": "steps.txt", "girth": 1.2, "fps": 20, "room": "office"}
    recipe = small(tmp_path, "stand", frames=2, wardrobe="plain", **entries)
    session = Session(synthesize(recipe, tmp_path / "made"))
    assert session.manifest.warnings == ()
    body = session.body()
    of_shape = session.body(subject=read_subject(session.path / "subject_shape.toml"))
    assert of_shape.dimensions == sized(shape_file).dimensions
    found = session.sigma(60.0)
    assert found is not None
    np.testing.assert_allclose(found, sigma)
    at_20 = session.sigma()
    assert at_20 is not None
    np.testing.assert_allclose(at_20, 3.0 * sigma)
    assert len(body.drawn) == len(of_shape.drawn) + 4
    assert session.truth_path is not None
    pose, truth = session.start_pose(), read_trc(session.truth_path)
    again, error = pose_from_markers(body, truth.names, truth.positions[0], pose)
    assert error < 1e-3
    assert again.shape == pose.shape


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"girth": 3.0}, "girth is 3"),
        ({"room": "cellar"}, "room is 'cellar'"),
        ({"wardrobe": "armour"}, "wardrobe is 'armour'"),
    ],
)
def test_wrong_entries_are_refused_with_a_remedy(
    tmp_path: Path, entry: dict[str, object], words: str
) -> None:
    with pytest.raises(StudioError, match=words):
        read_recipe(small(tmp_path, "stand", **entry))


def test_a_sigma_file_that_is_too_short_is_refused(tmp_path: Path) -> None:
    (tmp_path / "steps.txt").write_text("0.1 0.2")
    with pytest.raises(BodyError, match="31"):
        synthesize(small(tmp_path, "stand", sigma="steps.txt"), tmp_path / "made")
