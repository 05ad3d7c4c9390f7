"""Labels of other programs, skin markers, and the errors where they do not suffice."""

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.person import MARKERS
from studio.foundations.errors import StudioError
from studio.runs.learning.marker_labels import person_markers

BODY = load_body("human25")
POINTS = {
    marker.name: place
    for marker, place in zip(BODY.markers, marker_points(BODY, BODY.neutral)[0], strict=True)
}


def of(labels: dict[str, str]) -> tuple[list[str], np.ndarray]:
    """Labels and points (2, P, 3) of a mapping from label to the body's marker."""
    return list(labels), np.repeat(np.array([POINTS[name] for name in labels.values()])[None], 2, axis=0)


@pytest.mark.parametrize(
    "style",
    ["{side}{joint}", "Jane:{side}_{joint}", "{long} {low}", "{low}_{letter}", "mixamorig:{Long}{bone}"],
)
def test_joints_have_many_names(style: str) -> None:
    bones = {
        "Hip": "UpLeg",
        "Knee": "Leg",
        "Ankle": "Foot",
        "Shoulder": "Arm",
        "Elbow": "ForeArm",
        "Wrist": "Hand",
    }
    labels = {"Hips": "Hip", "Neck": "Neck", "Head_End": "Head", "Marker 17": "Neck"}
    for side, long in (("R", "right"), ("L", "left")):
        for joint, bone in bones.items():
            label = style.format(
                side=side,
                joint=joint,
                long=long,
                low=joint.lower(),
                letter=side.lower(),
                Long=long.title(),
                bone=bone,
            )
            labels[label] = f"{side}{joint}"
    names, points = person_markers(*of(labels), "some.c3d")
    assert set(names) == set(MARKERS)
    for place, name in enumerate(names):
        np.testing.assert_allclose(points[:, place], np.repeat(POINTS[name][None], 2, axis=0))


def test_the_shoulder_joint_is_preferred_to_the_collar_bone() -> None:
    labels = {
        f"{side}{joint}": f"{side}{joint}"
        for side in "RL"
        for joint in ("Hip", "Knee", "Ankle", "Elbow", "Wrist")
    }
    labels |= {
        "LeftShoulder": "Neck",
        "RightShoulder": "Neck",
        "LeftArm": "LShoulder",
        "RightArm": "RShoulder",
    }
    names, points = person_markers(*of(labels), "some.bvh")
    np.testing.assert_allclose(points[0, names.index("LShoulder")], POINTS["LShoulder"])


def test_head_and_neck_may_be_missing_and_hips_give_their_middle() -> None:
    labels = {name: name for name in MARKERS if name not in ("Hip", "Neck", "Head")}
    names, points = person_markers(*of(labels), "some.c3d")
    assert set(names) == set(MARKERS) - {"Neck", "Head"}
    middle = 0.5 * (POINTS["LHip"] + POINTS["RHip"])
    np.testing.assert_allclose(points[0, names.index("Hip")], middle)


def test_joints_follow_from_skin_markers() -> None:
    """A pelvis 260 mm wide and 160 deep: hip joints at Bell's shares of its width."""
    width, depth = 260.0, 160.0
    skin = {
        "S1:LASI": [depth, width / 2, 0],
        "S1:RASI": [depth, -width / 2, 0],
        "S1:LPSI": [0, 50, 0],
        "S1:RPSI": [0, -50, 0],
    }
    for side, sign in (("L", 1.0), ("R", -1.0)):
        for label, height in (("KNE", -400.0), ("ANK", -800.0), ("SHO", 500.0), ("ELB", 200.0)):
            skin[f"S1:{side}{label}"] = [100.0, sign * 120.0, height]
        skin[f"S1:{side}WRA"] = [100.0, sign * 200.0, 0.0]
        skin[f"S1:{side}WRB"] = [120.0, sign * 200.0, 0.0]
    skin |= {"S1:C7": [60, 0, 560], "S1:CLAV": [140, 0, 520]}
    points = np.repeat(np.array(list(skin.values()), dtype=float)[None], 3, axis=0)
    names, found = person_markers(list(skin), points, "vicon.c3d")
    at = dict(zip(names, found[0], strict=True))
    np.testing.assert_allclose(at["LHip"], [depth - 0.19 * width, 0.36 * width, -0.30 * width], atol=1e-9)
    np.testing.assert_allclose(at["RHip"], [depth - 0.19 * width, -0.36 * width, -0.30 * width], atol=1e-9)
    np.testing.assert_allclose(at["RWrist"], [110.0, -200.0, 0.0])
    np.testing.assert_allclose(at["Neck"], [100.0, 0.0, 540.0])


def test_the_error_lists_missing_and_present_labels() -> None:
    labels = {name: name for name in MARKERS if name != "LKnee"} | {"*17": "LKnee"}
    with pytest.raises(
        StudioError, match=r"'x.c3d' has no points for LKnee; its points are: .*\*17"
    ) as refusal:
        person_markers(*of(labels), "x.c3d")
    assert "RKnee" in refusal.value.hint


@pytest.mark.parametrize(
    ("shared", "parts"),
    [
        ("Bip01 ", ("Thigh", "Calf", "Foot", "UpperArm", "Forearm", "Hand")),
        ("Character1_", ("UpLeg", "Leg", "Foot", "Arm", "ForeArm", "Hand")),
    ],
)
def test_a_word_that_all_labels_begin_with_does_not_count(shared: str, parts: tuple[str, ...]) -> None:
    sides = ("L ", "R ") if shared == "Bip01 " else ("Left", "Right")
    labels = [shared.strip(" _"), *(f"{shared}{side}{part}" for side in sides for part in parts)]
    points = np.arange(3.0 * len(labels)).reshape(1, -1, 3)
    names, found = person_markers(labels, points, "take.bvh")
    at = {
        name: labels[int(place[0] // 3)] for name, place in zip(names, found[0], strict=True) if name != "Hip"
    }
    joints = ("Hip", "Knee", "Ankle", "Shoulder", "Elbow", "Wrist")
    wanted = {
        f"{side[0]}{joint}": f"{shared}{side}{part}"
        for side in sides
        for joint, part in zip(joints, parts, strict=True)
    }
    assert at == wanted
