"""GLB read by two other readers: trimesh, and one of this file that knows glTF from its specification alone."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from export_runs import FRAMES, MADE, moving_poses, track_of

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_frames
from studio.body.motion_files.recorded_motion import followed
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.results.export.skeleton import skeleton_of

GLB = FORMATS["glb"]
LEAST_MM, LEAST_DEGREES = 0.1, 0.01
VERTICES = 4 * 24 + 2
FROM_Y_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
TYPES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
STORED = {5126: "<f4", 5123: "<u2", 5125: "<u4"}


class Gltf:
    """A GLB taken apart by hand."""

    def __init__(self, path: Path) -> None:
        content = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", content)
        assert (magic, version, length) == (b"glTF", 2, len(content))
        size, kind = struct.unpack_from("<I4s", content, 12)
        assert kind == b"JSON"
        assert size % 4 == 0
        self.document = json.loads(content[20 : 20 + size])
        binary, kind = struct.unpack_from("<I4s", content, 20 + size)
        assert kind == b"BIN\0"
        self.blob = content[28 + size : 28 + size + binary]

    def rows(self, index: int) -> np.ndarray:
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        assert start % 4 == 0
        width = TYPES[accessor["type"]]
        stored = np.dtype(STORED[accessor["componentType"]])
        assert accessor["count"] * width * stored.itemsize <= view["byteLength"]
        assert view.get("byteOffset", 0) + view["byteLength"] <= self.document["buffers"][0]["byteLength"]
        values = np.frombuffer(self.blob, stored, accessor["count"] * width, start).reshape(-1, width)
        if "min" in accessor:
            np.testing.assert_array_equal(values.min(axis=0), np.array(accessor["min"], dtype=stored))
            np.testing.assert_array_equal(values.max(axis=0), np.array(accessor["max"], dtype=stored))
        return values.astype(np.float64)

    def sampled(self, time: float) -> dict[int, np.ndarray]:
        """World matrices (4, 4) of all nodes at a time, each channel by linear or spherical interpolation."""
        nodes, moved = self.document["nodes"], {}
        animation = self.document["animations"][0]
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            times, values = self.rows(sampler["input"])[:, 0], self.rows(sampler["output"])
            assert np.all(np.diff(times) > 0.0)
            at = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2))
            share = float(np.clip((time - times[at]) / (times[at + 1] - times[at]), 0.0, 1.0))
            path = channel["target"]["path"]
            one, two = values[at], values[at + 1]
            moved[channel["target"]["node"], path] = (
                slerp(one, two, share) if path == "rotation" else (1.0 - share) * one + share * two
            )
        worlds: dict[int, np.ndarray] = {}

        def walk(node: int, above: np.ndarray) -> None:
            local = np.eye(4)
            local[:3, :3] = matrix(moved.get((node, "rotation"), np.array([0.0, 0.0, 0.0, 1.0])))
            local[:3, 3] = moved.get((node, "translation"), nodes[node].get("translation", [0.0, 0.0, 0.0]))
            worlds[node] = above @ local
            for child in nodes[node].get("children") or ():
                walk(child, worlds[node])

        for root in self.document["scenes"][0]["nodes"]:
            walk(root, np.eye(4))
        return worlds


def slerp(one: np.ndarray, two: np.ndarray, share: float) -> np.ndarray:
    cosine = float(one @ two)
    assert cosine >= 0.0, "quaternions jump to the other side"
    angle = np.arccos(min(cosine, 1.0))
    if angle < 1e-7:
        return one
    return (np.sin((1.0 - share) * angle) * one + np.sin(share * angle) * two) / np.sin(angle)


def matrix(quaternion: np.ndarray) -> np.ndarray:
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.parametrize("name", ["human31", "human29", "branched_arms6"])
def test_the_joints_are_where_they_are_meant_in_every_ninth_frame(
    make_run, tmp_path: Path, name: str
) -> None:
    session, run = make_run(name, lambda body: track_of(moving_poses(body)))
    report = export_run(session, run, GLB, {"track": MADE}, tmp_path / "walk.glb")
    read = Gltf(report.files[0])
    body = load_body(name)
    skeleton = skeleton_of(body)
    places, turns = followed(skeleton.tree.parents, *skeleton.animated(moving_poses(body)))
    index = {node["name"]: at for at, node in enumerate(read.document["nodes"])}
    far = turned = 0.0
    for row in range(0, FRAMES, 9):
        worlds = read.sampled(np.float32(row / 60.0))
        for joint, joint_name in enumerate(skeleton.names):
            world = worlds[index[joint_name]]
            far = max(far, np.linalg.norm(1000.0 * FROM_Y_UP @ world[:3, 3] - places[row, joint]))
            apart = turns[row, joint].T @ (FROM_Y_UP @ world[:3, :3] @ FROM_Y_UP.T)
            turned = max(turned, np.degrees(np.linalg.norm(apart - apart.T) / np.sqrt(8.0)))
    assert far < LEAST_MM
    assert turned < LEAST_DEGREES


def test_the_skin_carries_the_cones(make_run, tmp_path: Path) -> None:
    """Linear blend skinning by hand: in any frame the vertices lie on the cones of that frame."""
    session, run = make_run("human29", lambda body: track_of(moving_poses(body)))
    report = export_run(session, run, GLB, {"track": MADE}, tmp_path / "walk.glb")
    read, body = Gltf(report.files[0]), load_body("human29")
    document = read.document
    skin = document["skins"][0]
    inverse = read.rows(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    row = 200
    worlds = read.sampled(row / 60.0)
    frames = limb_frames(body, moving_poses(body)[row])[0]
    middle = {limb.name: at for at, limb in enumerate(body.drawn)}
    sides = [document["materials"][part["material"]]["name"] for part in document["meshes"][0]["primitives"]]
    assert sides == ["left", "right", "middle"]
    for side, part in zip(sides, document["meshes"][0]["primitives"], strict=True):
        points, normals = (read.rows(part["attributes"][name]) for name in ("POSITION", "NORMAL"))
        joints, weights = (read.rows(part["attributes"][name]) for name in ("JOINTS_0", "WEIGHTS_0"))
        np.testing.assert_array_equal(weights.sum(axis=1), 1.0)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
        assert read.rows(part["indices"]).max() < len(points)
        carried = np.stack(
            [worlds[skin["joints"][int(joint)]] @ inverse[int(joint)] for joint in joints[:, 0]]
        )
        placed = (carried @ np.column_stack([points, np.ones(len(points))])[..., None])[:, :3, 0]
        world = 1000.0 * placed @ FROM_Y_UP.T
        at = 0
        for limb in (limb for limb in body.drawn if limb.side == side):
            frame = frames[middle[limb.name]]
            count = VERTICES
            local = (world[at : at + count] - frame[:, 3]) @ frame[:, :3]
            at += count
            share = local[:, 2] / limb.length
            assert np.minimum(np.abs(share), np.abs(share - 1.0)).max() < 1e-4
            reach = np.hypot(local[:48, 0] / limb.scale_x, local[:48, 1] / limb.scale_y)
            radius = np.where(share[:48] > 0.5, limb.radius_end, limb.radius_start)
            np.testing.assert_allclose(reach, radius, atol=0.05)
        assert at == len(points)


def test_trimesh_opens_it_and_finds_closed_limbs(make_run, tmp_path: Path) -> None:
    session, run = make_run("human29", lambda body: track_of(moving_poses(body, 60)))
    report = export_run(session, run, GLB, {"track": MADE, "names": "mixamo"}, tmp_path / "walk.glb")
    scene = trimesh.load(report.files[0], process=False)
    assert {"Hips", "LeftArm", "RightUpLeg"} <= set(scene.graph.nodes)
    body = load_body("human29")
    limbs = [limb for side in ("left", "right", "middle") for limb in body.drawn if limb.side == side]
    for mesh in scene.geometry.values():
        for first in range(0, len(mesh.vertices), VERTICES):
            faces = mesh.faces[
                (mesh.faces >= first).all(axis=1) & (mesh.faces < first + VERTICES).all(axis=1)
            ]
            part = trimesh.Trimesh(mesh.vertices[first : first + VERTICES], faces - first, process=False)
            part.merge_vertices(merge_norm=True)
            limb = limbs.pop(0)
            one, two = limb.radius_start / 1000.0, limb.radius_end / 1000.0
            area = np.pi * limb.scale_x * limb.scale_y * (one * one + one * two + two * two) / 3.0
            assert part.is_watertight, limb.name
            # A polygon of 24 corners holds 1.1 % less than its circle.
            assert part.volume == pytest.approx(area * abs(limb.length) / 1000.0, rel=0.015), limb.name
    assert not limbs
    low, high = np.array([mesh.bounds for mesh in scene.geometry.values()]).transpose(1, 0, 2)
    # It stands on the floor in its T-pose, arms out along x, facing z.
    assert low.min(axis=0)[1] == pytest.approx(0.0, abs=0.06)
    spans = high.max(axis=0) - low.min(axis=0)
    assert 1.6 < spans[0] < 2.2
    assert 1.6 < spans[1] < 2.0
    assert spans[2] < 0.5


@pytest.mark.slow
def test_an_hour_is_long_for_32_bit_times_and_yet_reads_back(make_run, tmp_path: Path) -> None:
    count = 100_000
    session, run = make_run("planar_arm4", lambda body: track_of(moving_poses(body, count)))
    report = export_run(session, run, GLB, {"track": MADE}, tmp_path / "arm.glb")
    read = Gltf(report.files[0])
    times = read.rows(read.document["animations"][0]["samplers"][0]["input"])[:, 0]
    assert len(times) == count
    assert np.all(np.diff(times) > 0.0)


def test_gaps_are_reported(make_run, tmp_path: Path) -> None:
    track = np.arange(FRAMES)
    kept = (track < 10) | (track >= 30)
    session, run = make_run(
        "planar_arm4", lambda body: track_of(moving_poses(body)[kept], frames=track[kept])
    )
    report = export_run(session, run, GLB, {"track": MADE}, tmp_path / "arm.glb")
    animation = Gltf(report.files[0]).document["animations"][0]
    assert animation["extras"]["gaps"] == [[10, 30]]
    assert report.frames == FRAMES
    assert any("20 of 450 frames are interpolated" in note for note in report.notes)
