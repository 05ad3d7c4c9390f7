"""GLB (binary glTF 2.0): the skeleton as nodes, the cones as one skinned mesh, the motion as an animation.

glTF fixes metres and Y up. Every vertex hangs on one joint, so the cones stay stiff. Rotations are quaternions xyzw
whose signs do not jump, read by linear interpolation; frames without a pose are interpolated, and the animation's
extras list these.
"""

from typing import Any

import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studio.body.motion_files.recorded_motion import followed
from studio.foundations.arrays import Array
from studio.results.export.glb_reading import Packing, read_glb
from studio.results.export.naming import joint_names
from studio.results.export.options import Axes
from studio.results.export.skeleton import Skeleton, skeleton_of
from studio.results.export.skinned_cones import cones_at_rest, standing_at_rest
from studio.results.export.task import INTERPOLATED, ExportTask, Written, agreed, apart, turned_apart
from studio.runs.drawing.colour_tokens import colour_tokens

AXES = Axes("m", "y")
ROUGH = 0.8


def write_glb(task: ExportTask) -> Written:
    """Write the motion as GLB and read it back. Raises ExportError where it differs."""
    motion = task.motion
    skeleton = skeleton_of(motion.body, task.options.rest)
    names, note = joint_names(skeleton.names, task.options.names)
    moves, turns = skeleton.animated(motion.poses)
    task.step("building", 0, 3)
    packing = Packing()
    document = gltf.GLTF2(
        asset=gltf.Asset(generator="capture studio", version="2.0", extras=task.source),
        scene=0,
        scenes=[gltf.Scene(nodes=[0])],
    )
    standing = standing_at_rest(skeleton)
    _add_nodes(document, skeleton, names, standing)
    _add_skin(document, packing, skeleton, standing)
    _add_mesh(document, packing, skeleton, standing)
    _add_animation(document, packing, task, skeleton, moves, turns)
    task.step("writing", 1, 3)
    document.accessors, document.bufferViews = packing.accessors, packing.views
    document.buffers = [gltf.Buffer(byteLength=len(packing.content))]
    document.set_binary_blob(bytes(packing.content))
    document.save_binary(str(task.place))
    task.step("reading back", 2, 3)
    checked = _read_back(task, skeleton, followed(skeleton.tree.parents, moves, turns))
    notes = [f"Rest pose: {skeleton.kind}; metres, Y up."]
    return Written((task.place,), checked, (*notes, *task.gaps_in_words(INTERPOLATED), *filter(None, [note])))


def smooth_quaternions(turns: Array) -> Array:
    """(K, J, 4) quaternions xyzw of rotations (K, J, 3, 3), each on the side of the one before."""
    quaternions = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_quat().reshape(*turns.shape[:2], 4)
    same = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) >= 0.0
    signs = np.cumprod(np.where(same, 1.0, -1.0), axis=0)
    return np.concatenate([quaternions[:1], quaternions[1:] * signs[..., None]])


def _add_nodes(document: gltf.GLTF2, skeleton: Skeleton, names: tuple[str, ...], standing: Array) -> None:
    """Node 0 holds all; nodes 1 … J are the joints."""
    parents = skeleton.tree.parents
    document.nodes.append(gltf.Node(name=skeleton.body.name, children=[1]))
    for joint, name in enumerate(names):
        place = standing[joint] if parents[joint] < 0 else skeleton.offsets[joint]
        children = [1 + child for child, parent in enumerate(parents) if parent == joint]
        document.nodes.append(
            gltf.Node(name=name, translation=AXES.points(place).tolist(), children=children or None)
        )


def _add_skin(document: gltf.GLTF2, packing: Packing, skeleton: Skeleton, standing: Array) -> None:
    """From rest in the world to each joint: rest turns nothing, so a move back is all."""
    inverse = np.tile(np.eye(4), (len(standing), 1, 1))
    inverse[:, :3, 3] = -AXES.points(standing)
    # glTF stores matrices by columns.
    matrices = packing.add(inverse.transpose(0, 2, 1).reshape(-1, 16), gltf.MAT4)
    joints = list(range(1, 1 + len(standing)))
    document.skins.append(gltf.Skin(name="cones", inverseBindMatrices=matrices, skeleton=1, joints=joints))


def _add_mesh(document: gltf.GLTF2, packing: Packing, skeleton: Skeleton, standing: Array) -> None:
    """The cones in the rest pose, a primitive for each side's colour."""
    tokens = colour_tokens(dark=True)
    primitives: list[gltf.Primitive] = []
    for part in cones_at_rest(skeleton, standing):
        attributes = gltf.Attributes(
            POSITION=packing.add(AXES.points(part.points), gltf.VEC3, gltf.ARRAY_BUFFER, bounds=True),
            NORMAL=packing.add(part.normals @ AXES.turn.T, gltf.VEC3, gltf.ARRAY_BUFFER),
            JOINTS_0=packing.add(_first_of_four(part.joints), gltf.VEC4, gltf.ARRAY_BUFFER, "u2"),
            WEIGHTS_0=packing.add(_first_of_four(np.ones(len(part.points))), gltf.VEC4, gltf.ARRAY_BUFFER),
        )
        indices = packing.add(part.faces.reshape(-1, 1), gltf.SCALAR, gltf.ELEMENT_ARRAY_BUFFER, "u4")
        primitives.append(
            gltf.Primitive(attributes=attributes, indices=indices, material=len(document.materials))
        )
        document.materials.append(_material(part.side, tokens[f"limb-{part.side}"]))
    document.meshes.append(gltf.Mesh(name="cones", primitives=primitives))
    document.nodes.append(gltf.Node(name="cones", mesh=0, skin=0))
    document.scenes[0].nodes.append(len(document.nodes) - 1)  # pyright: ignore[reportOptionalMemberAccess]


def _first_of_four(values: NDArray[Any]) -> NDArray[Any]:
    filled = np.zeros((len(values), 4), dtype=values.dtype)
    filled[:, 0] = values
    return filled


def _material(side: str, colour: tuple[int, int, int]) -> gltf.Material:
    linear = [(channel / 255.0) ** 2.2 for channel in colour]
    surface = gltf.PbrMetallicRoughness(
        baseColorFactor=[*linear, 1.0], metallicFactor=0.0, roughnessFactor=ROUGH
    )
    return gltf.Material(name=side, pbrMetallicRoughness=surface)


def _add_animation(
    document: gltf.GLTF2, packing: Packing, task: ExportTask, skeleton: Skeleton, moves: Array, turns: Array
) -> None:
    """Turns of every joint, moves of those that move, over the times of the frames."""
    motion = task.motion
    times = packing.add(motion.times[:, None], gltf.SCALAR, bounds=True)
    quaternions = smooth_quaternions(AXES.turns(turns))
    samplers: list[gltf.AnimationSampler] = []
    channels: list[gltf.AnimationChannel] = []

    def add(joint: int, path: str, values: Array, kind: str) -> None:
        target = gltf.AnimationChannelTarget(node=1 + joint, path=path)
        channels.append(gltf.AnimationChannel(sampler=len(samplers), target=target))
        samplers.append(
            gltf.AnimationSampler(input=times, output=packing.add(values, kind), interpolation="LINEAR")
        )

    for joint in range(len(skeleton.names)):
        add(joint, "rotation", quaternions[:, joint], gltf.VEC4)
        if skeleton.tree.moving[joint]:
            add(joint, "translation", AXES.points(moves[:, joint]), gltf.VEC3)
    animation_extras = {
        "fps": motion.fps,
        "first_frame": float(motion.frames[0]),
        "gaps": [list(gap) for gap in motion.gaps],
    }
    name = f"{task.run.session_name} {task.run.name}"
    document.animations.append(
        gltf.Animation(name=name, channels=channels, samplers=samplers, extras=animation_extras)
    )


def _read_back(task: ExportTask, skeleton: Skeleton, wanted: tuple[Array, Array]) -> str:
    read = read_glb(task.place)
    # glTF's times are 32-bit: in a long motion a key lies a little beside its frame's exact time.
    places, turns = read.followed(task.motion.times.astype(np.float32).astype(np.float64))
    joints = slice(1, 1 + len(skeleton.names))
    points = AXES.points_back(places[:, joints])
    turned = AXES.turns_back(turns[:, joints])
    return agreed(task.place, apart(points, wanted[0]), turned_apart(turned, wanted[1]))
