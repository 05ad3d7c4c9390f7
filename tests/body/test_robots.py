"""Robots as bodies, against MuJoCo's own kinematics and a chain of matrices made of the URDF's text."""

import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import studio.body.robots as robots
import studio.results.drawing_footage
from studio.body.catalogue import body_file_text, list_bodies, load_body
from studio.body.forward_kinematics import limb_ends, limb_frames, marker_points
from studio.body.model import BodyModel
from studio.body.reader import parse_body
from studio.body.robots import THIN, _about, _pointing, _rotation, _to_z, _turns, fitted_cone
from studio.foundations.errors import BodyError

ARM = Path(studio.results.drawing_footage.__file__).parent / "recipe_files" / "robot_arm.urdf"

GRIPPER = """<robot name="gripper">
<link name="world_link"/>
<link name="base-link"><collision><origin xyz="0 0 0.05" rpy="0.2 0.1 0"/>
  <geometry><cylinder radius="0.04" length="0.1"/></geometry></collision></link>
<link name="lift"/>
<link name="left_finger"><visual><geometry><mesh filename="package://nowhere/finger.dae"/></geometry></visual></link>
<link name="right_finger"><visual><origin xyz="0 0 0.05"/><geometry><sphere radius="0.02"/></geometry></visual></link>
<link name="tip"/>
<joint name="weld" type="fixed"><parent link="world_link"/><child link="base-link"/>
  <origin xyz="0.1 -0.2 0.3" rpy="0.4 -0.3 1.2"/></joint>
<joint name="rise" type="prismatic"><parent link="base-link"/><child link="lift"/><origin xyz="0 0 0.1" rpy="0.3 0 0"/>
  <axis xyz="0.6 0 0.8"/><limit lower="-0.05" upper="0.3" velocity="0.25" effort="1"/></joint>
<joint name="turn" type="continuous"><parent link="lift"/><child link="left_finger"/>
  <origin xyz="0.05 0.02 0.2" rpy="0 1.5707963267948966 0.7"/><axis xyz="1 -2 2"/></joint>
<joint name="follow" type="revolute"><parent link="lift"/><child link="right_finger"/><origin xyz="-0.05 0 0.2"/>
  <axis xyz="-1 0 0"/><limit lower="-3" upper="3" velocity="1" effort="1"/>
  <mimic joint="turn" multiplier="-1" offset="0.25"/></joint>
<joint name="end" type="fixed"><parent link="left_finger"/><child link="tip"/><origin xyz="0 0 0.1"/></joint>
</robot>"""

WALKER = """<mujoco model="walker">
<compiler angle="degree" eulerseq="zyx"/>
<default><geom contype="1"/><default class="shin"><geom type="capsule" size="0.03"/></default></default>
<asset><mesh name="foot" vertex="0 0 0
  0.2 0 0  0 0.08 0  0.2 0.08 0  0 0 0.05  0.1 0 0.05  0 0.08 0.05  0.1 0.08 0.05"/></asset>
<worldbody>
  <geom type="plane" size="1 1 1"/>
  <body name="table"><geom type="box" size="1 1 0.1"/></body>
  <body name="cup" pos="0 0 1"><freejoint/><geom type="sphere" size="0.1"/></body>
  <body name="trunk" pos="0.1 0.2 0.9" euler="10 20 30">
    <freejoint name="root"/>
    <geom type="ellipsoid" size="0.1 0.3 0.2"/>
    <body name="thigh" pos="0.1 0 -0.1" quat="0.5 0.5 0.5 0.5">
      <joint name="hip_x" axis="1 0 0" range="-40 60" pos="0.01 0.02 0.03"/>
      <joint name="hip_y" axis="0 -1 0" range="-90 30"/>
      <joint name="stretch" type="slide" axis="0 1 1" range="0 0.1" ref="0.02"/>
      <geom type="cylinder" fromto="0 0 0 0.1 0.1 -0.4" size="0.05"/>
      <site name="scar" pos="0.01 0.02 -0.2"/>
      <body name="shin" pos="0 0 -0.4" euler="0 90 0">
        <joint name="knee" axis="1 1 1" range="-120 5" ref="15"/>
        <geom class="shin" fromto="0 0 0 0 0 -0.4"/>
        <body pos="0 0 -0.4">
          <joint name="ankle" type="ball" range="0 60" pos="0 0 0.02"/>
          <geom type="mesh" mesh="foot"/>
        </body>
      </body>
    </body>
    <body name="arm" pos="-0.1 0 0.2">
      <joint name="swing" axis="0 1 0" limited="false"/>
      <geom type="box" size="0.02 0.2 0.03" euler="0 0 45"/>
    </body>
  </body>
</worldbody>
<equality><joint joint1="swing" joint2="knee" polycoef="0.1 -1 0 0 0"/></equality>
</mujoco>"""


CRANE = """<mujoco model="2 cranes!">
<compiler angle="radian" autolimits="true" boundmass="1" boundinertia="1"/>
<worldbody>
  <geom type="plane" size="1 1 1"/>
  <body name="bin"><geom type="box" size="1 1 1"/></body>
  <body name="base" pos="1 2 0.5" quat="0.8 0 0 0.6">
    <geom type="plane" size="1 1 1"/>
    <geom name="g0" type="cylinder" size="0.1 0.2" pos="0.01 0.02 0.03" quat="0.5 0.5 -0.5 0.5"/>
    <geom name="g1" type="sphere" size="0.07" pos="0.3 0 0"/>
    <geom type="sphere" size="2e-5"/>
    <geom type="cylinder" size="2e-5 0.3"/>
    <body name="left column" pos="0 0 0.2">
      <joint name="spin" axis="0 0 -2" range="-1 2" ref="0.5" pos="0.02 0 0"/>
      <geom name="g2" type="capsule" size="0.05" fromto="0 0 0 0.1 0 0.6"/>
      <site name="lamp" pos="0.1 -0.2 0.3"/>
      <site pos="0 0 0"/>
      <body name="mast" pos="0 0 0.6" quat="0.6 0 0.8 0">
        <body name="boom" pos="0.1 0 0.1">
          <joint name="lift" axis="0 -1 0.5" range="-0.5 1.5" ref="0.1"/>
          <joint name="reach" type="slide" axis="0 0 1" range="0.1 1.5" ref="0.25"/>
          <geom name="g3" type="ellipsoid" size="0.05 0.3 0.02" pos="0 0.3 0"/>
          <body name="Right-claw" pos="0 0.6 0">
            <joint name="claw" type="slide" axis="1 0 0" range="0 0.1" ref="0.03"/>
            <geom name="g4" type="box" size="0.03 0.02 0.1"/>
          </body>
          <body name="Right+claw" pos="0 0.6 0">
            <joint name="claw 2" type="slide" axis="-1 0 0" range="0 0.1" ref="0.02"/>
            <joint name="idle" axis="1 0 0" ref="0.3"/>
            <geom name="g5" type="box" size="0.03 0.1 0.02"/>
          </body>
          <body name="Right claw" pos="0 0.6 0.1">
            <joint name="wrist" type="ball" range="0 0.8" pos="0.01 0.02 0.03"/>
            <geom name="g6" type="box" size="0.1 0.02 0.03"/>
            <body name="odd" pos="0.1 0 0">
              <joint name="odd" axis="0 1 0"/>
              <body pos="0.2 0 0"><joint/><joint axis="1 0 0" name="tip"/></body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </body>
</worldbody>
<equality>
  <joint joint1="claw 2" joint2="claw" polycoef="0.01 -1 0 0 0"/>
  <joint joint1="idle" polycoef="0.2 0 0 0 0"/>
  <joint joint1="odd" joint2="lift" polycoef="0 1 0.1 0 0"/>
  <joint joint1="tip" joint2="lift" polycoef="0 1 0 0 0" active="false"/>
  <weld body1="bin" body2="base" active="false"/>
</equality>
<keyframe><key qpos="2.5 -0.7 0.5 0.03 0.03 0.3 0.8 0 0.6 0 0.2 0.1 0.1"/></keyframe>
</mujoco>"""


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def random_poses(body: BodyModel, count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    low = [entry.lower if np.isfinite(entry.lower) else -2.0 for entry in body.parameters]
    high = [entry.upper if np.isfinite(entry.upper) else 2.0 for entry in body.parameters]
    # So that the middle one of three turns is no quarter turn, at which they are not unique.
    return rng.uniform(0.9 * np.array(low), 0.9 * np.array(high), (count, len(low)))


def places(text: str, body: BodyModel, poses: np.ndarray, links: dict[str, str]) -> np.ndarray:
    """(N, K, 3) mm: the origins of links as MuJoCo has them. links : marker to MuJoCo's name."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    index = {entry.name: place for place, entry in enumerate(body.parameters)}
    found = []
    for pose in poses:
        for number in range(model.njnt):
            joint = model.joint(number)
            at, name = int(model.jnt_qposadr[number]), joint.name.replace("-", "_")
            kind = int(model.jnt_type[number])
            if kind in (0, 1) and name and f"{name}_yaw" in index:
                data.qpos[at : at + 3] = 1e-3 * pose[[index[f"{name}_{axis}"] for axis in "xyz"]]
                turns = pose[[index[f"{name}_{word}"] for word in ("yaw", "pitch", "roll")]]
                data.qpos[at + 3 : at + 7] = np.roll(Rotation.from_euler("ZYX", turns).as_quat(), 1)
            elif kind == 1:
                turns = pose[[index[f"{name}_turn_{axis}"] for axis in "zyx"]]
                data.qpos[at : at + 4] = np.roll(Rotation.from_euler("ZYX", turns).as_quat(), 1)
            elif name in index:
                data.qpos[at] = pose[index[name]] * (1e-3 if kind == 2 else 1.0)
        for number in range(model.neq):
            if not model.eq_active0[number] or model.eq_data[number][2:5].any():
                continue
            one, two = (int(model.eq_obj1id[number]), int(model.eq_obj2id[number]))
            first, second = int(model.jnt_qposadr[one]), int(model.jnt_qposadr[two])
            moved = data.qpos[second] - model.qpos0[second] if two >= 0 else 0.0
            data.qpos[first] = (
                model.qpos0[first] + model.eq_data[number][0] + model.eq_data[number][1] * moved
            )
        mujoco.mj_kinematics(model, data)
        seen = [data.site(name[1:]) if name[0] == "@" else data.body(name) for name in links.values()]
        found.append(np.array([one.xpos for one in seen]))
    return 1e3 * np.array(found)


def markers(body: BodyModel, poses: np.ndarray, names: list[str]) -> np.ndarray:
    order = [marker.name for marker in body.markers]
    return marker_points(body, poses)[:, [order.index(name) for name in names]]


def with_masses(urdf: str) -> str:
    """The URDF as MuJoCo itself reads it: links with masses, nothing fused, no meshes."""
    root = ElementTree.fromstring(urdf)
    settings = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(settings, "compiler", fusestatic="false", boundmass="1", boundinertia="1")
    for link in root.findall("link"):
        for part in link.findall("visual"):
            link.remove(part)
    return ElementTree.tostring(root, encoding="unicode")


def test_an_arm_out_of_a_urdf_is_where_mujoco_puts_it() -> None:
    body = load_body(str(ARM))
    assert [entry.name for entry in body.parameters] == [f"axis_{number}" for number in range(1, 7)]
    assert body.parameters[1].lower == pytest.approx(-1.6)
    assert body.parameters[1].max_step == pytest.approx(2.2, rel=1e-4)
    assert {entry.limb for entry in body.parameters} == {"column"}
    poses = random_poses(body, 20, seed=1)
    links = {
        name: name for name in ("base", "column", "upper_arm", "elbow", "forearm", "wrist", "flange", "tool")
    }
    truth = places(with_masses(ARM.read_text()), body, poses, links)
    np.testing.assert_allclose(markers(body, poses, list(links)), truth, atol=1e-5)


def test_a_urdf_is_where_its_own_matrices_put_it(tmp_path: Path) -> None:
    path = written(tmp_path, "gripper.urdf", GRIPPER)
    body = load_body(str(path))
    assert [entry.name for entry in body.parameters] == ["rise", "turn"]
    rise, turn = body.parameters
    assert (rise.kind, rise.lower, rise.upper, rise.max_step) == ("length", -50.0, 300.0, 250.0)
    assert not np.isfinite(turn.lower)
    poses = random_poses(body, 20, seed=2)
    joints = {joint.get("name"): joint for joint in ElementTree.fromstring(GRIPPER).findall("joint")}

    def motion(name: str, value: float) -> np.ndarray:
        joint, matrix, moved = joints[name], np.eye(4), np.eye(4)
        origin = joint.find("origin")
        matrix[:3, 3] = [float(word) for word in origin.get("xyz").split()]
        matrix[:3, :3] = Rotation.from_euler(
            "xyz", [float(w) for w in origin.get("rpy", "0 0 0").split()]
        ).as_matrix()
        if joint.get("type") != "fixed":
            axis = np.array([float(word) for word in joint.find("axis").get("xyz").split()])
            axis /= np.linalg.norm(axis)
            if joint.get("type") == "prismatic":
                moved[:3, 3] = value * axis
            else:
                moved[:3, :3] = Rotation.from_rotvec(value * axis).as_matrix()
        return matrix @ moved

    for pose in poses:
        lift = motion("weld", 0.0) @ motion("rise", 1e-3 * pose[0])
        left = lift @ motion("turn", pose[1])
        right = lift @ motion("follow", 0.25 - pose[1])
        tip = left @ motion("end", 0.0)
        wanted = 1e3 * np.array([one[:3, 3] for one in (motion("weld", 0.0), lift, left, right, tip)])
        names = ["base_link", "lift", "left_finger", "right_finger", "tip"]
        np.testing.assert_allclose(markers(body, pose[None], names)[0], wanted, atol=1e-5)
        # The sphere's cone has its middle 50 mm along the finger's z.
        ends = limb_ends(body, pose[None])[0]
        ball = [limb.name for limb in body.drawn].index("right_finger")
        np.testing.assert_allclose(
            ends[ball].mean(axis=0), 1e3 * (right @ [0.0, 0.0, 0.05, 1.0])[:3], atol=1e-5
        )


def test_masses_that_mujoco_refuses_do_not_matter(tmp_path: Path) -> None:
    heavy = '<link name="lift"><inertial><mass value="-1"/><inertia ixx="-1" ixy="0" ixz="0" iyy="1" iyz="0" izz="9"/>'
    text = GRIPPER.replace('<link name="lift"/>', f"{heavy}</inertial></link>")
    plain, odd = (
        load_body(str(written(tmp_path, f"{n}.urdf", one))) for n, one in enumerate((GRIPPER, text))
    )
    assert [limb.length for limb in odd.limbs] == [limb.length for limb in plain.limbs]


def test_links_without_geometry_get_the_stated_radius(tmp_path: Path) -> None:
    body = load_body(str(written(tmp_path, "gripper.urdf", GRIPPER)))
    lift = [limb for limb in body.limbs if limb.name.startswith("lift")]
    assert [limb.length for limb in lift] == pytest.approx(
        [np.hypot(np.hypot(50, 20), 200), np.hypot(50, 200)]
    )
    for limb in lift:
        assert limb.radius_start == pytest.approx(THIN * limb.length, abs=1e-3)
    ends = limb_ends(body, body.neutral)[0]
    places = markers(body, body.neutral[None], ["lift", "left_finger", "right_finger"])[0]
    for limb, place in zip(lift, places[1:], strict=True):
        np.testing.assert_allclose(ends[body.drawn.index(limb)], [places[0], place], atol=1e-5)
    source = body.definition.source
    assert "nowhere/finger.dae" in source
    assert "without geometry" in source
    # What was guessed can be fitted, what the file says cannot.
    assert "lift_1_radius_start" in body.dimensions
    assert not any(name.startswith("base") for name in body.dimensions)


def test_an_mjcf_is_where_mujoco_puts_it(tmp_path: Path) -> None:
    body = load_body(str(written(tmp_path, "walker.xml", WALKER)))
    names = [entry.name for entry in body.parameters]
    assert names == [
        *(f"root_{word}" for word in ("x", "y", "z", "yaw", "pitch", "roll")),
        "hip_x", "hip_y", "stretch", "knee", "ankle_turn_z", "ankle_turn_y", "ankle_turn_x",
    ]  # fmt: skip
    assert {entry.limb for entry in body.parameters} == {"trunk", "thigh"}
    assert "table" in body.definition.source
    assert "cup" in body.definition.source
    poses = random_poses(body, 20, seed=3)
    links = {name: name for name in ("trunk", "thigh", "shin", "arm")} | {"scar": "@scar"}
    truth = places(WALKER, body, poses, links)
    np.testing.assert_allclose(markers(body, poses, list(links)), truth, atol=1e-5)
    knee = body.parameters[names.index("knee")]
    assert (np.degrees(knee.lower), np.degrees(knee.upper)) == pytest.approx((-120.0, 5.0))


def test_shapes_have_the_sizes_of_the_geometry(tmp_path: Path) -> None:
    body = load_body(str(written(tmp_path, "walker.xml", WALKER)))
    limbs = {limb.name: limb for limb in body.limbs}
    assert limbs["thigh"].length == pytest.approx(1e3 * np.sqrt(0.1**2 + 0.1**2 + 0.4**2))
    assert limbs["thigh"].radius_start == pytest.approx(50.0)
    assert limbs["shin"].length == pytest.approx(400.0 + 4.0 * 30.0 / 3.0)

    def volume(limb) -> float:
        area = np.pi * limb.scale_x * limb.scale_y
        mean = (limb.radius_start**2 + limb.radius_start * limb.radius_end + limb.radius_end**2) / 3.0
        return area * mean * limb.length

    assert limbs["trunk"].length == pytest.approx(600.0)
    assert volume(limbs["trunk"]) == pytest.approx(4.0 / 3.0 * np.pi * 100.0 * 300.0 * 200.0, rel=1e-4)
    assert limbs["arm"].length == pytest.approx(400.0)
    assert volume(limbs["arm"]) == pytest.approx(40.0 * 400.0 * 60.0, rel=1e-4)


@pytest.fixture
def crane(tmp_path: Path) -> BodyModel:
    return load_body(str(written(tmp_path, "crane.xml", CRANE)))


def test_everything_that_a_joint_may_do_is_as_in_mujoco(crane: BodyModel) -> None:
    links = {
        "base": "base", "left column": "left column", "mast": "mast", "boom": "boom", "lamp": "@lamp",
        "Right_claw": "Right-claw", "Right_claw_2": "Right+claw", "Right claw": "Right claw", "odd": "odd",
    }  # fmt: skip
    poses = random_poses(crane, 20, seed=5)
    np.testing.assert_allclose(
        markers(crane, poses, list(links)), places(CRANE, crane, poses, links), atol=1e-5
    )
    assert [marker.name for marker in crane.markers] == [
        *list(links)[:2],
        "lamp",
        "mast",
        "boom",
        *list(links)[5:],
        "body 10",
    ]


def test_parameters_have_the_files_limits_its_keyframe_and_the_limb_of_their_chain(crane: BodyModel) -> None:
    wanted = {
        "spin": ("left column", -1.0, 2.0, 2.0),
        "lift": ("left column", -0.5, 1.5, -0.5),
        "reach": ("left column", 100.0, 1500.0, 500.0),
        "claw": ("Right_claw", 0.0, 100.0, 30.0),
        "wrist_turn_z": ("Right claw", -0.8, 0.8, 0.0),
        "wrist_turn_y": ("Right claw", -0.8, 0.8, 0.8),
        "wrist_turn_x": ("Right claw", -0.8, 0.8, 0.0),
        "odd": ("Right claw", -np.inf, np.inf, 0.2),
        "body_10_joint_9": ("Right claw", -np.inf, np.inf, 0.1),
        "tip": ("Right claw", -np.inf, np.inf, 0.1),
    }
    assert [(one.name, one.limb) for one in crane.parameters] == [
        (name, one[0]) for name, one in wanted.items()
    ]
    for entry in crane.parameters:
        _, lower, upper, neutral = wanted[entry.name]
        assert (entry.lower, entry.upper) == pytest.approx((lower, upper)), entry.name
        assert entry.neutral == pytest.approx(neutral), entry.name
        assert entry.max_step == pytest.approx(500.0 if entry.kind == "length" else np.pi), entry.name
    assert [entry.name for entry in crane.parameters if entry.kind == "length"] == ["reach", "claw"]
    # About an axis of the frame, or against it, nothing else is turned.
    spin = next(joint for joint in crane.definition.joints if joint.name == "left column").sequence
    assert [(step.turn, step.by) for step in spin if step.turn] == [
        ("z", pytest.approx(np.degrees(0.5))),
        ("z", "-spin"),
    ]


def test_every_part_lies_where_its_geometry_does_and_is_as_large(crane: BodyModel) -> None:
    """Half the length and both radii about their axes as one matrix, beside the geometry's own."""
    model = mujoco.MjModel.from_xml_string(CRANE)
    data = mujoco.MjData(model)
    data.qpos[[0, 1, 2, 3, 4, 5]] = 0.4, 0.3, 0.9, 0.05, 0.02 + 0.01 - (0.05 - 0.03), 0.3 + 0.2
    mujoco.mj_kinematics(model, data)
    pose = np.array([0.4, 0.3, 900.0, 50.0, *np.zeros(6)])
    box, ball = 2.0 / np.sqrt(np.pi), np.sqrt(2.0 / 3.0)
    sizes = {
        "base 1": [100.0, 100.0, 200.0],
        "base 2": [70.0, 70.0 * ball, 70.0 * ball],
        "left column": [50.0, 50.0, 500.0 * np.hypot(0.1, 0.6) + 100.0 / 3.0],
        "boom": [50.0 * ball, 300.0, 20.0 * ball],
        "Right_claw": [30.0 * box, 20.0 * box, 100.0],
        "Right_claw_2": [30.0 * box, 100.0, 20.0 * box],
        "Right claw": [100.0, 20.0 * box, 30.0 * box],
    }
    drawn = [limb for limb in crane.drawn if limb.name in sizes]
    assert [limb.name for limb in drawn] == list(sizes)
    frames, ends = limb_frames(crane, pose)[0], limb_ends(crane, pose)[0]
    for number, (name, size) in enumerate(sizes.items()):
        limb, geom = drawn[number], data.geom(f"g{number}")
        place = crane.drawn.index(limb)
        turn, own = frames[place][:, :3], geom.xmat.reshape(3, 3)
        radius = limb.radius_start
        assert limb.radius_end == radius
        ours = turn @ np.diag([radius * limb.scale_x, radius * limb.scale_y, limb.length / 2.0]) @ turn.T
        np.testing.assert_allclose(ours, own @ np.diag(size) @ own.T, atol=1e-3, err_msg=name)
        np.testing.assert_allclose(ends[place].mean(axis=0), 1e3 * geom.xpos, atol=1e-4, err_msg=name)
    assert [limb.side for limb in crane.limbs if limb.name in sizes] == [
        "middle",
        "middle",
        "left",
        "middle",
        *["right"] * 3,
    ]
    assert [limb.name for limb in crane.limbs if limb.name not in sizes] == ["mast", "odd"]
    mast = next(limb for limb in crane.drawn if limb.name == "mast")
    assert (mast.length, mast.radius_start, mast.radius_end) == pytest.approx((141.4213562, 16.971, 16.971))
    assert sorted(crane.dimensions) == [
        f"{name}_{end}" for name in ("mast", "odd") for end in ("radius_end", "radius_start")
    ]


def test_what_was_changed_of_a_file_is_said(crane: BodyModel) -> None:
    assert crane.title == "link 2 cranes, 10 parameters"
    assert crane.definition.source == (
        "Made of crane.xml, metres as mm. Left out: bin; "
        "joint 'odd' follows 'lift' in the file and moves by itself here; "
        "a part of 'base' that no cone can be was left out; "
        "links without geometry (mast, odd) have a radius of 0.12 of their length."
    )


FOLLOWERS = """<mujoco><worldbody>
<body name="a"><joint name="one" type="slide" axis="1 0 0"/><geom type="sphere" size="1"/>
  <body name="b"><joint name="two" type="slide" axis="1 0 0"/><geom type="sphere" size="1"/>
    <body name="c">
      <joint name="three" type="slide" axis="1 0 0"/><joint name="four"/><joint name="five" axis="0 1 0"/>
      <geom type="sphere" size="1"/>
      <body name="d">
        <joint name="six" axis="0 0 1" range="10 10.00000000001" ref="2"/><joint name="seven" axis="0 1 0"/>
        <geom type="sphere" size="1"/>
      </body>
    </body>
  </body>
</body></worldbody>
<equality>
  <joint joint1="two" joint2="one" polycoef="0 1 0 0 0"/><joint joint1="three" joint2="two" polycoef="0 1 0 0 0"/>
  <joint joint1="four" joint2="one" polycoef="0 1 0 0 0"/><joint joint1="five" joint2="four" polycoef="0 -1 0 0 0.1"/>
  <joint joint1="seven" joint2="six" polycoef="0 1 0 0 0"/>
</equality>
<keyframe><key qpos="0 0 0 0 0 0.2 0"/></keyframe></mujoco>"""


def test_what_follows_a_follower_another_kind_or_what_cannot_move_moves_by_itself(tmp_path: Path) -> None:
    body = load_body(str(written(tmp_path, "followers.xml", FOLLOWERS)))
    assert [entry.name for entry in body.parameters] == ["one", "three", "four", "five", "seven"]
    for name, other in (("three", "two"), ("four", "one"), ("five", "four"), ("seven", "six")):
        assert f"'{name}' follows '{other}' in the file and moves by itself here" in body.definition.source
    assert "'six' has no room between its limits and is fixed" in body.definition.source
    fixed = next(joint for joint in body.definition.joints if joint.name == "d six")
    assert (fixed.type, [(step.turn, step.by) for step in fixed.sequence]) == (
        "fixed",
        [("z", pytest.approx(np.degrees(0.2) - 2.0))],
    )


BLOCK = [(x, y, z) for x in (0, 100) for y in (0, 100) for z in (0, 400)]
FACES = ["1 3 7 5", "2 6 8 4", "1 5 6 2", "3 4 8 7", "1 2 4 3", "5 7 8 6"]


def test_of_an_mjcfs_meshes_those_that_are_there_are_read(tmp_path: Path) -> None:
    """Beside a mass that MuJoCo would refuse."""
    (tmp_path / "parts").mkdir()
    lines = [f"v {x} {y} {z}" for x, y, z in BLOCK] + [f"f {face}" for face in FACES]
    (tmp_path / "parts" / "block.obj").write_text("\n".join(lines))
    (tmp_path / "parts" / "shape.dae").write_text("of another kind")
    text = """<mujoco><compiler meshdir="parts"/><asset><mesh name="whole" file="block.obj" scale="0.001 0.001 0.001"/>
        <mesh file="lost.stl"/><mesh name="odd" file="shape.dae"/></asset><worldbody><body name="a">
        <joint name="j"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 9"/><geom type="mesh" mesh="whole"/>
        <geom type="mesh" mesh="lost"/><geom type="mesh" mesh="odd"/></body></worldbody></mujoco>"""
    body = load_body(str(written(tmp_path, "parts.xml", text)))
    assert [limb.length for limb in body.limbs] == pytest.approx([400.0])
    assert "Mesh 'lost.stl' was left out; mesh 'shape.dae' was left out." in body.definition.source


@pytest.mark.parametrize("word", ["fast", "inf", "-1", "0"])
def test_without_a_velocity_the_usual_one_counts(tmp_path: Path, word: str) -> None:
    text = GRIPPER.replace('velocity="0.25"', f'velocity="{word}"').replace("continuous", "revolute")
    text = text.replace(
        '<axis xyz="1 -2 2"/>', '<axis xyz="1 -2 2"/><limit lower="-1" upper="1" velocity="2"/>'
    )
    rise, turn = load_body(str(written(tmp_path, "slow.urdf", text))).parameters
    assert (rise.max_step, turn.max_step) == (500.0, pytest.approx(2.0, rel=1e-4))


def test_of_things_that_lie_about_the_first_is_the_body(tmp_path: Path) -> None:
    thing = '<body name="{}"><freejoint/><geom type="sphere" size="0.1"/></body>'
    text = f"<mujoco><worldbody>{''.join(thing.format(name) for name in 'abc')}</worldbody></mujoco>"
    body = load_body(str(written(tmp_path, "things.xml", text)))
    assert [marker.name for marker in body.markers] == ["a"]
    assert "Left out: b, c." in body.definition.source


def test_rotations_are_turns_about_z_then_y_then_x() -> None:
    turns = [
        *Rotation.random(20, rng=np.random.default_rng(0)),
        *Rotation.from_euler("ZYX", [[20, 90, 0], [30, -90, 0]], degrees=True),
    ]
    for turn in turns:
        again = Rotation.from_euler("ZYX", _turns(turn.as_matrix()), degrees=True)
        np.testing.assert_allclose(again.as_matrix(), turn.as_matrix(), atol=1e-9)
    for axis, name in enumerate("xyz"):
        np.testing.assert_allclose(_about(axis, 0.3), Rotation.from_euler(name, 0.3).as_matrix(), atol=1e-12)
        np.testing.assert_array_equal(_to_z(axis)[:, 2], np.eye(3)[axis])
        assert np.linalg.det(_to_z(axis)) == pytest.approx(1.0)
    for axis in Rotation.random(5, rng=np.random.default_rng(1)).as_matrix()[:, 0]:
        azimuth, polar = _pointing(axis)
        np.testing.assert_allclose(_about(2, azimuth) @ _about(1, polar) @ [0, 0, 1], axis, atol=1e-12)


@pytest.mark.parametrize(("metres", "is_read"), [(99.9, True), (100.1, False)])
@pytest.mark.parametrize("what", ['xyz="-0.05 0 0.2"', 'length="0.1"'])
def test_what_is_longer_than_a_hundred_metres_is_taken_for_millimetres(
    tmp_path: Path, what: str, metres: float, is_read: bool
) -> None:
    odd = f'xyz="0 0 -{metres}"' if what.startswith("xyz") else f'length="{metres}"'
    path = written(tmp_path, "long.urdf", GRIPPER.replace(what, odd))
    if is_read:
        load_body(str(path))
        return
    with pytest.raises(BodyError, match="length of 100 m"):
        load_body(str(path))


def test_what_is_only_shown_goes_before_what_only_collides(tmp_path: Path) -> None:
    """A geometry collides by either of two numbers; that of both zero is what the robot looks like."""
    shown = '<geom type="box" size="0.02 0.2 0.03" euler="0 0 45" contype="0" conaffinity="0"/>'
    text = WALKER.replace(
        '<geom type="box" size="0.02 0.2 0.03" euler="0 0 45"/>',
        f'<geom type="sphere" size="0.3" contype="0" conaffinity="1"/>{shown}'
        '<geom type="sphere" size="0.3" contype="1" conaffinity="0"/>',
    )
    body = load_body(str(written(tmp_path, "walker.xml", text)))
    assert [limb.length for limb in body.limbs if limb.name.startswith("arm")] == pytest.approx([400.0])


def test_a_free_body_rests_where_its_file_has_it(tmp_path: Path) -> None:
    body = load_body(str(written(tmp_path, "walker.xml", WALKER)))
    rest = {one.name: value for one, value in zip(body.parameters, body.neutral, strict=True)}
    assert [rest[f"root_{axis}"] for axis in "xyz"] == pytest.approx([100.0, 200.0, 900.0])


def test_a_quaternion_is_the_rotation_that_it_means() -> None:
    for w, x, y, z in np.random.default_rng(0).normal(size=(5, 4)):
        np.testing.assert_allclose(_rotation([w, x, y, z]), Rotation.from_quat([x, y, z, w]).as_matrix())


def test_a_meshs_cone_is_that_of_a_cone() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    ring = np.stack([0.6 * np.cos(angle), np.sin(angle)], axis=1)
    low = np.column_stack([np.full(60, -100.0), 40.0 * ring])
    high = np.column_stack([np.full(60, 200.0), 20.0 * ring])
    part = fitted_cone(np.vstack([low, high]))
    np.testing.assert_allclose(part.start, [-100.0, 0.0, 0.0], atol=2.0)
    np.testing.assert_allclose(part.turn[:, 2], [1.0, 0.0, 0.0])
    assert part.length == pytest.approx(300.0)
    wide = [radius * scale for radius in part.radii for scale in sorted(part.scales)]
    assert wide == pytest.approx([24.0, 40.0, 12.0, 20.0], rel=0.06)


def corners(low: float, high: float, wide: float, flat: float, length: float) -> np.ndarray:
    """Of a block along y, `low` times as wide and thick at its beginning and `high` times at its end."""
    return np.array(
        [
            (x * wide * end, y, z * flat * end)
            for y, end in ((7.0, low), (7.0 + length, high))
            for x in (3.0, 4.0)
            for z in (-2.0, -1.0)
        ]
    )


def test_a_blocks_cone_has_its_area_everywhere() -> None:
    part = fitted_cone(corners(1.0, 1.0, 20.0, 5.0, 100.0))
    np.testing.assert_allclose(part.start, [70.0, 7.0, -7.5])
    np.testing.assert_allclose(part.turn, np.roll(np.eye(3), -2, axis=1))
    assert part.length == pytest.approx(100.0)
    assert part.radii == pytest.approx([np.sqrt(100.0 / np.pi)] * 2)
    assert part.scales == pytest.approx([0.5, 2.0])
    assert part.guessed


def test_a_mesh_that_grows_along_its_axis_has_a_cone_that_does() -> None:
    part = fitted_cone(corners(1.0, 2.0, 20.0, 20.0, 300.0))
    assert part.radii == pytest.approx(np.array([1.0, 2.0]) * 20.0 / np.sqrt(np.pi), rel=0.03)
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    base = np.column_stack([30.0 * np.cos(angles), 30.0 * np.sin(angles), np.full(60, 300.0)])
    pointed = fitted_cone(np.vstack([base, np.zeros((1, 3))]))
    assert pointed.radii == pytest.approx([1.5, 30.0], rel=0.01)
    assert pointed.radii[0] == pytest.approx(0.05 * pointed.radii[1])


@pytest.mark.parametrize(
    "points", [np.eye(3), np.c_[np.random.default_rng(0).normal(size=(9, 2)), np.zeros(9)]]
)
def test_what_is_flat_has_no_cone(points: np.ndarray) -> None:
    assert fitted_cone(points) is None


def test_a_mesh_beside_the_file_is_found(tmp_path: Path) -> None:
    """Whatever the file itself would have MuJoCo do."""
    (tmp_path / "robot" / "meshes").mkdir(parents=True)
    (tmp_path / "robot" / "urdf").mkdir()
    lines = [f"v {x} {y} {z}" for x, y, z in BLOCK] + [f"f {face}" for face in FACES]
    (tmp_path / "robot" / "meshes" / "part.obj").write_text("\n".join(lines))
    mesh = '<mesh filename="package://robot/meshes/part.obj" scale="0.001 0.001 0.001"/>'
    text = GRIPPER.replace('<sphere radius="0.02"/>', mesh)
    text = text.replace('name="gripper">', 'name="gripper"><mujoco><compiler strippath="true"/></mujoco>')
    body = load_body(str(written(tmp_path / "robot" / "urdf", "gripper.urdf", text)))
    limb = next(limb for limb in body.limbs if limb.name == "right_finger")
    mesh = next(one for one in body.meshes if body.joints[one.joint].name == "right_finger")
    assert sorted(np.ptp(mesh.points, axis=0)) == pytest.approx([100.0, 100.0, 400.0], abs=1e-3)
    assert len(mesh.triangles) == 12
    np.testing.assert_allclose(
        0.5 * (mesh.points.min(axis=0) + mesh.points.max(axis=0)), [50.0, 50.0, 250.0], atol=1e-3
    )
    # A cylinder of 100 mm, in the middle of which the link's origin is 50 mm down its own turned frame.
    cylinder = next(one for one in body.meshes if body.joints[one.joint].name == "base_link")
    along = Rotation.from_euler("xyz", [0.2, 0.1, 0.0]).as_matrix()[:, 2]
    np.testing.assert_allclose(
        cylinder.points[-2:], [[0, 0, 50] - 50 * along, [0, 0, 50] + 50 * along], atol=1e-3
    )
    assert {body.joints[one.joint].name for one in body.meshes} >= {
        "base-link".replace("-", "_"),
        "right_finger",
    }
    assert not load_body(str(written(tmp_path, "without.urdf", GRIPPER))).meshes
    assert limb.length == pytest.approx(400.0, rel=1e-3)
    assert limb.radius_start == pytest.approx(100.0 / np.sqrt(np.pi), rel=0.05)
    ends = limb_ends(body, np.array([[0.0, 0.25]]))[0]
    place = [one.name for one in body.drawn].index("right_finger")
    joint = markers(body, np.array([[0.0, 0.25]]), ["right_finger"])[0, 0]
    middle = np.linalg.norm(ends[place].mean(axis=0) - joint)
    assert middle == pytest.approx(np.linalg.norm([50.0, 50.0, 250.0]), abs=3.0)


def test_a_mesh_that_is_nowhere_is_left_out_wherever_it_stands_in_its_link(tmp_path: Path) -> None:
    lost = '<visual><geometry><mesh filename="lost.stl"/></geometry></visual>'
    ball = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'
    bodies = [
        load_body(str(written(tmp_path, f"{n}.urdf", GRIPPER.replace('<link name="lift"/>', link))))
        for n, link in enumerate(
            f'<link name="lift">{parts}</link>' for parts in (ball, ball + lost, lost + ball)
        )
    ]
    assert len({tuple(limb.length for limb in body.limbs) for body in bodies}) == 1
    assert ["'lost.stl' of 'lift'" in body.definition.source for body in bodies] == [False, True, True]


def test_it_can_be_saved_as_a_body_file(tmp_path: Path) -> None:
    path = written(tmp_path, "walker.xml", WALKER)
    body = load_body(str(path))
    again = parse_body(body_file_text(str(path)), "walker", "walker.toml")
    assert again.definition == body.definition
    poses = random_poses(body, 3, seed=4)
    np.testing.assert_array_equal(limb_ends(again, poses), limb_ends(body, poses))


def test_a_robot_in_a_folder_of_bodies_has_its_name(tmp_path: Path) -> None:
    written(tmp_path, "walker.xml", WALKER)
    assert "walker" in list_bodies((tmp_path,))
    assert load_body("walker", (tmp_path,)).name == "walker"
    written(tmp_path, "walker.toml", body_file_text(str(ARM)))
    assert len(load_body("walker", (tmp_path,)).parameters) == 6


def test_a_urdf_may_float_in_its_root(tmp_path: Path) -> None:
    text = GRIPPER.replace('name="weld" type="fixed"', 'name="sway" type="floating"')
    body = load_body(str(written(tmp_path, "floating.urdf", text)))
    names = [entry.name for entry in body.parameters]
    assert names[:6] == [f"sway_{word}" for word in ("x", "y", "z", "yaw", "pitch", "roll")]
    assert body.definition.joints[0].type == "free"
    pose = np.array([10.0, 20.0, 30.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(markers(body, pose[None], ["base_link"])[0, 0], pose[:3], atol=1e-9)
    planar = GRIPPER.replace('name="weld" type="fixed"', 'name="cart" type="planar"')
    cart = load_body(str(written(tmp_path, "planar.urdf", planar)))
    assert [entry.kind for entry in cart.parameters][:3] == ["length", "length", "angle"]


LOOP = WALKER.replace("<equality>", '<equality><connect body1="shin" body2="arm" anchor="0 0 0"/>')
WELD = '<weld name="shut" body1="shin" body2="arm"/>'
STILL = """<robot name="r"><link name="a"/><link name="b"/>
<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>"""
MILLIMETRES = GRIPPER.replace('<origin xyz="-0.05 0 0.2"/>', '<origin xyz="-50 0 200"/>')


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("loop.xml", LOOP, "closes a chain"),
        (
            "welded.xml",
            LOOP.replace('<connect body1="shin" body2="arm" anchor="0 0 0"/>', WELD),
            "constraint 'shut'",
        ),
        ("still.urdf", STILL, "no joint that moves"),
        ("large.urdf", MILLIMETRES, "length of 206 m"),
        ("odd.urdf", "<robot", "cannot be read"),
        ("odd.xml", "<scene/>", "holds <scene>"),
        ("two.urdf", GRIPPER.replace('<child link="tip"/>', '<child link="lift"/>'), "cannot be read"),
        ("nan.urdf", GRIPPER.replace('xyz="0.1 -0.2 0.3"', 'xyz="nan -0.2 0.3"'), "cannot be read|finite"),
        ("words.urdf", GRIPPER.replace('lower="-0.05"', 'lower="low"'), "cannot be read"),
        ("empty.xml", "", "cannot be read"),
        ("inside.urdf", GRIPPER.replace("continuous", "floating"), "floating joint 'turn' inside"),
    ],
)
def test_what_is_no_body_is_refused_in_words(tmp_path: Path, name: str, text: str, words: str) -> None:
    with pytest.raises(BodyError, match=words) as refused:
        load_body(str(written(tmp_path, name, text)))
    assert name in refused.value.message
    assert refused.value.hint


def test_a_joint_that_follows_otherwise_moves_by_itself(tmp_path: Path) -> None:
    body = load_body(str(written(tmp_path, "g.urdf", GRIPPER.replace('multiplier="-1"', 'multiplier="0.5"'))))
    assert [entry.name for entry in body.parameters] == ["rise", "turn", "follow"]
    assert "'follow' follows 'turn'" in body.definition.source


def test_without_its_extra_the_error_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robots.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(BodyError, match="MuJoCo") as refused:
        load_body(str(written(tmp_path, "g.urdf", GRIPPER)))
    assert "capture-studio[robots]" in refused.value.hint


def test_mujoco_never_enters_this_process(tmp_path: Path) -> None:
    path = written(tmp_path, "g.urdf", GRIPPER)
    code = (
        "import sys; from studio.body.catalogue import load_body; "
        f"load_body({str(path)!r}); assert 'mujoco' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_reading_leaves_no_file_where_the_studio_was_started(tmp_path: Path) -> None:
    """MuJoCo appends its warnings to a file in the working directory unless they are taken from it."""
    path = written(tmp_path, "nan.urdf", GRIPPER.replace('xyz="0.1 -0.2 0.3"', 'xyz="nan -0.2 0.3"'))
    started = tmp_path / "started"
    started.mkdir()
    code = f"from studio.body.catalogue import load_body; load_body({str(path)!r})"
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=started, capture_output=True, text=True, check=False
    )
    assert "BodyError" in ended.stderr
    assert not list(started.iterdir())
