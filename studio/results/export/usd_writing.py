# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# usd-core has no types.
"""USD: the skeleton as UsdSkel, the cones as meshes that hang on it, the motion as its animation.

Metres and Y up, as the GLB has it, one time code a frame. Needs the extra `usd`. Every vertex hangs on one joint, so
the cones stay stiff; frames without a pose are interpolated.
"""

from typing import Any

import numpy as np

from studio.body.motion_files.recorded_motion import followed
from studio.foundations.arrays import Array
from studio.foundations.extras import load_extra
from studio.results.export.glb_writing import smooth_quaternions
from studio.results.export.naming import joint_names
from studio.results.export.options import Axes
from studio.results.export.skeleton import Skeleton, skeleton_of
from studio.results.export.skinned_cones import SkinnedPart, cones_at_rest, standing_at_rest
from studio.results.export.task import INTERPOLATED, ExportTask, Written, agreed, apart, turned_apart
from studio.runs.drawing.colour_tokens import colour_tokens

EXTRA = "usd"
AXES = Axes("m", "y")
BODY, SKELETON, MOTION = "/body", "/body/skeleton", "/body/skeleton/motion"


def write_usd(task: ExportTask) -> Written:
    """Write the motion as USD and read it back. Raises StudioError without the extra, ExportError where it differs."""
    usd = load_extra("pxr.Usd", EXTRA)
    motion = task.motion
    skeleton = skeleton_of(motion.body, task.options.rest)
    names, note = joint_names(skeleton.names, task.options.names)
    moves, turns = skeleton.animated(motion.poses)
    task.step("building", 0, 3)
    stage = usd.Stage.CreateNew(str(task.place))
    _set_up(stage, task)
    standing = standing_at_rest(skeleton)
    _add_skeleton(stage, skeleton, names, standing)
    _add_motion(stage, skeleton, names, AXES.points(moves), smooth_quaternions(AXES.turns(turns)))
    for part in cones_at_rest(skeleton, standing):
        _add_mesh(stage, part)
    task.step("writing", 1, 3)
    stage.GetRootLayer().Save()
    task.step("reading back", 2, 3)
    wanted = followed(skeleton.tree.parents, moves, turns)
    places, turned = _read_back(task, len(names))
    checked = agreed(task.place, apart(places, wanted[0]), turned_apart(turned, wanted[1]))
    notes = [f"Rest pose: {skeleton.kind}; metres, Y up."]
    return Written((task.place,), checked, (*notes, *task.gaps_in_words(INTERPOLATED), *filter(None, [note])))


def joint_paths(parents: tuple[int, ...], names: tuple[str, ...]) -> list[str]:
    """Of each joint the names from the root down, as UsdSkel orders joints ("pelvis/left_thigh")."""
    valid = load_extra("pxr.Tf", EXTRA).MakeValidIdentifier
    paths: list[str] = []
    for parent, name in zip(parents, names, strict=True):
        paths.append(valid(name) if parent < 0 else f"{paths[parent]}/{valid(name)}")
    return paths


def _set_up(stage: Any, task: ExportTask) -> None:  # noqa: ANN401
    geometry, skeletons = load_extra("pxr.UsdGeom", EXTRA), load_extra("pxr.UsdSkel", EXTRA)
    geometry.SetStageUpAxis(stage, geometry.Tokens.y)
    geometry.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(task.motion.fps)
    stage.SetFramesPerSecond(task.motion.fps)
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(float(len(task.motion.poses) - 1))
    root = skeletons.Root.Define(stage, BODY).GetPrim()
    stage.SetDefaultPrim(root)
    root.SetCustomDataByKey("source", task.source)
    root.SetCustomDataByKey("first_frame", float(task.motion.frames[0]))
    root.SetCustomDataByKey("gaps", "; ".join(f"{first} to {last - 1}" for first, last in task.motion.gaps))


def _translation(place: Array) -> Any:  # noqa: ANN401 - Gf.Matrix4d
    gf = load_extra("pxr.Gf", EXTRA)
    return gf.Matrix4d(1.0).SetTranslate(gf.Vec3d(*map(float, place)))


def _add_skeleton(stage: Any, skeleton: Skeleton, names: tuple[str, ...], standing: Array) -> None:  # noqa: ANN401
    skeletons = load_extra("pxr.UsdSkel", EXTRA)
    parents = skeleton.tree.parents
    prim = skeletons.Skeleton.Define(stage, SKELETON)
    prim.CreateJointsAttr(joint_paths(parents, names))
    prim.CreateJointNamesAttr(list(names))
    prim.CreateBindTransformsAttr([_translation(place) for place in AXES.points(standing)])
    rest = [
        standing[joint] if parent < 0 else skeleton.offsets[joint] for joint, parent in enumerate(parents)
    ]
    prim.CreateRestTransformsAttr([_translation(place) for place in AXES.points(np.array(rest))])
    binding = skeletons.BindingAPI.Apply(prim.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([MOTION])


def _add_motion(
    stage: Any,  # noqa: ANN401
    skeleton: Skeleton,
    names: tuple[str, ...],
    moves: Array,
    quaternions: Array,
) -> None:
    """moves (K, J, 3) m and quaternions (K, J, 4) xyzw, in the parents' frames."""
    skeletons, vt = load_extra("pxr.UsdSkel", EXTRA), load_extra("pxr.Vt", EXTRA)
    gf = load_extra("pxr.Gf", EXTRA)
    animation = skeletons.Animation.Define(stage, MOTION)
    animation.CreateJointsAttr(joint_paths(skeleton.tree.parents, names))
    animation.CreateScalesAttr([gf.Vec3h(1.0, 1.0, 1.0)] * len(names))
    translations, rotations = animation.CreateTranslationsAttr(), animation.CreateRotationsAttr()
    for time, (places, turned) in enumerate(zip(moves, quaternions, strict=True)):
        translations.Set(vt.Vec3fArray.FromNumpy(np.ascontiguousarray(places, np.float32)), time)
        rotations.Set([gf.Quatf(float(w), float(x), float(y), float(z)) for x, y, z, w in turned], time)


def _add_mesh(stage: Any, part: SkinnedPart) -> None:  # noqa: ANN401
    geometry, skeletons = load_extra("pxr.UsdGeom", EXTRA), load_extra("pxr.UsdSkel", EXTRA)
    gf, vt = load_extra("pxr.Gf", EXTRA), load_extra("pxr.Vt", EXTRA)
    mesh = geometry.Mesh.Define(stage, f"{BODY}/cones_{part.side}")
    points = AXES.points(part.points).astype(np.float32)
    mesh.CreatePointsAttr(vt.Vec3fArray.FromNumpy(points))
    mesh.CreateExtentAttr(vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)])))
    mesh.CreateFaceVertexCountsAttr([3] * len(part.faces))
    mesh.CreateFaceVertexIndicesAttr(part.faces.reshape(-1).tolist())
    mesh.CreateNormalsAttr(vt.Vec3fArray.FromNumpy((part.normals @ AXES.turn.T).astype(np.float32)))
    mesh.SetNormalsInterpolation(geometry.Tokens.vertex)
    mesh.CreateSubdivisionSchemeAttr(geometry.Tokens.none)
    colour = [(channel / 255.0) ** 2.2 for channel in colour_tokens(dark=True)[f"limb-{part.side}"]]
    mesh.CreateDisplayColorAttr([gf.Vec3f(*colour)])
    binding = skeletons.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([SKELETON])
    binding.CreateGeomBindTransformAttr(gf.Matrix4d(1.0))
    binding.CreateJointIndicesPrimvar(False, 1).Set(part.joints.tolist())
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * len(part.joints))


def _read_back(task: ExportTask, count: int) -> tuple[Array, Array]:
    """(K, J, 3) mm and (K, J, 3, 3) of the joints in the world, as a reader of UsdSkel gets them."""
    usd, skeletons = load_extra("pxr.Usd", EXTRA), load_extra("pxr.UsdSkel", EXTRA)
    stage = usd.Stage.Open(str(task.place))
    query = skeletons.Cache().GetSkelQuery(skeletons.Skeleton(stage.GetPrimAtPath(SKELETON)))
    matrices = np.array(
        [query.ComputeJointSkelTransforms(time) for time in range(len(task.motion.poses))]
    ).reshape(-1, count, 4, 4)
    # USD's matrices stand before what they move: transposed, with the move in the last row.
    turns = AXES.turns_back(matrices[..., :3, :3].swapaxes(-1, -2))
    return AXES.points_back(matrices[..., 3, :3]), turns
