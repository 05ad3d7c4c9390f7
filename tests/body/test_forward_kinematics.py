"""Forward kinematics against MuJoCo: the tree is built a second time, from the TOML text alone."""

import tomllib
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np
import pytest

import studio.body
from studio.body.catalogue import list_bodies, load_body
from studio.body.forward_kinematics import joint_frames, limb_ends, limb_frames, marker_points
from studio.body.model import BodyModel
from studio.foundations.errors import BodyError

MODELS = Path(studio.body.__file__).parent / "models"
AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


class _MujocoBody:
    """A MuJoCo model of a body file, one nested body a step."""

    def __init__(self, name: str) -> None:
        self.file = tomllib.loads((MODELS / f"{name}.toml").read_text())
        self.parameters = {entry["name"]: place for place, entry in enumerate(self.file["parameters"])}
        root = ElementTree.Element("mujoco")
        ElementTree.SubElement(root, "compiler", angle="degree")
        self.worldbody = ElementTree.SubElement(root, "worldbody")
        self.last = {"world": self.worldbody}
        self.drives: list[tuple[str, int, float]] = []
        for joint in self.file["joints"]:
            self._add_joint(joint)
        for place, limb in enumerate(self.file["limbs"]):
            self._add_site(limb["joint"], f"start {place}", [0.0, 0.0, 0.0])
            self._add_site(limb["joint"], f"end {place}", [0.0, 0.0, self._amount(limb["length"])])
        for marker in self.file["markers"]:
            self._add_site(marker["joint"], marker["name"], [self._amount(value) for value in marker["at"]])
        self.model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
        self.data = mujoco.MjData(self.model)

    def _amount(self, value: float | str) -> float:
        if not isinstance(value, str):
            return float(value)
        entry = self.file["dimensions"][value.lstrip("-")]
        return (-1.0 if value.startswith("-") else 1.0) * float(entry["mm"])

    def _add_joint(self, joint: dict) -> None:
        body = self.last[joint["parent"]]
        for place, step in enumerate(joint["sequence"]):
            name, axis = f"{joint['name']} {place}", step.get("move") or step["turn"]
            by, moves = step["by"], "move" in step
            driven = isinstance(by, str) and by.lstrip("-") in self.parameters
            attributes = {}
            if not driven and moves:
                vector = np.array([float(number) for number in AXES[axis].split()]) * self._amount(by)
                attributes["pos"] = " ".join(repr(float(number)) for number in vector)
            if not driven and not moves:
                attributes["axisangle"] = f"{AXES[axis]} {by!r}"
            body = ElementTree.SubElement(body, "body", name=name, **attributes)
            ElementTree.SubElement(body, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
            if driven:
                kind = "slide" if moves else "hinge"
                ElementTree.SubElement(body, "joint", name=name, type=kind, axis=AXES[axis])
                sign = -1.0 if by.startswith("-") else 1.0
                self.drives.append((name, self.parameters[by.lstrip("-")], sign))
        self.last[joint["name"]] = body

    def _add_site(self, joint: str, name: str, at: list[float]) -> None:
        text = " ".join(repr(number) for number in at)
        ElementTree.SubElement(self.last[joint], "site", name=name, pos=text)

    def points(self, pose: np.ndarray, names: list[str]) -> np.ndarray:
        for joint, parameter, sign in self.drives:
            self.data.qpos[self.model.joint(joint).qposadr[0]] = sign * pose[parameter]
        mujoco.mj_kinematics(self.model, self.data)
        return np.array([self.data.site(name).xpos for name in names])


def _random_poses(body: BodyModel, seed: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    spread = [np.pi if entry.kind == "angle" else 3000.0 for entry in body.parameters]
    return rng.uniform(-1.0, 1.0, (count, len(spread))) * spread


@pytest.mark.parametrize("name", list_bodies())
def test_limbs_and_markers_are_where_mujoco_puts_them(name: str) -> None:
    body, other = load_body(name), _MujocoBody(name)
    poses = _random_poses(body, 11, 8)
    ends, markers = limb_ends(body, poses), marker_points(body, poses)
    drawn = [place for place, limb in enumerate(body.limbs) if limb.length != 0.0]
    end_names = [f"{end} {place}" for place in drawn for end in ("start", "end")]
    marker_names = [marker["name"] for marker in other.file["markers"]]
    for pose, pose_ends, pose_markers in zip(poses, ends, markers, strict=True):
        np.testing.assert_allclose(pose_ends.reshape(-1, 3), other.points(pose, end_names), atol=1e-7)
        np.testing.assert_allclose(pose_markers, other.points(pose, marker_names), atol=1e-7)


def test_a_pose_is_the_same_alone_and_among_two_thousand() -> None:
    body = load_body("human34")
    poses = _random_poses(body, 5, 2000)
    frames = joint_frames(body, poses)
    assert frames.shape == (2000, len(body.joints), 3, 4)
    np.testing.assert_array_equal(frames[1234], joint_frames(body, poses[1234])[0])
    rotations = frames[..., :3]
    np.testing.assert_allclose(
        rotations @ np.swapaxes(rotations, -1, -2), np.eye(3)[None, None] + 0 * rotations, atol=1e-12
    )


def test_limb_ends_lie_on_the_limb_frames_axis() -> None:
    body = load_body("human31")
    poses = _random_poses(body, 6, 3)
    frames, ends = limb_frames(body, poses), limb_ends(body, poses)
    assert frames.shape == (3, 10, 3, 4)
    lengths = np.array([limb.length for limb in body.drawn])
    np.testing.assert_allclose(
        ((ends[:, :, 1] - ends[:, :, 0]) * frames[..., 2]).sum(-1), lengths[None] + 0 * poses[:, :1]
    )


@pytest.mark.parametrize("shape", [(30,), (4, 32), (2, 3, 31)])
def test_poses_of_another_body_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(BodyError, match="has 31 parameters"):
        joint_frames(load_body("human31"), np.zeros(shape))
