"""Run inside Blender (`blender --background --python`) or with its module `bpy`: what it sees of a file, as JSON.

Arguments after "--": the file (BVH, GLB or USD), the JSON to write, the frames a second, and, where the scene is to be
exported as FBX and opened again first, that file. Blender turns files that are Y up into its own world, z up; what is
written here is Blender's world, in metres.
"""

import builtins
import json
import sys

import bpy

# Debian's Blender 3.4 opens BVH files in mode "rU", which its own Python 3.11 no longer knows; nothing else is mended.
_open = builtins.open
builtins.open = lambda path, mode="r", *rest, **named: _open(path, mode.replace("U", ""), *rest, **named)

source, target, fps, *through = sys.argv[sys.argv.index("--") + 1 :]


def begin() -> None:
    """An empty scene with as many frames a second."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = round(float(fps))


begin()
if source.endswith(".bvh"):
    bpy.ops.import_anim.bvh(filepath=source, use_fps_scale=False, update_scene_duration=True)
elif source.endswith(".usd"):
    bpy.ops.wm.usd_import(filepath=source)
else:
    # Its default shading fails there on any mesh (numpy dropped "np.bool"); this is another of the importer's choices.
    bpy.ops.import_scene.gltf(filepath=source, import_shading="SMOOTH")
if through:
    animated = next(entry for entry in bpy.data.objects if entry.type == "ARMATURE").animation_data.action
    # The exporter bakes the scene's frames, whatever lies in the action.
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = map(round, animated.frame_range)
    bpy.ops.export_scene.fbx(filepath=through[0], add_leaf_bones=False, bake_anim_simplify_factor=0.0)
    begin()
    bpy.ops.import_scene.fbx(filepath=through[0])
armature = next(entry for entry in bpy.data.objects if entry.type == "ARMATURE")
action = armature.animation_data.action
first, last = (round(value) for value in action.frame_range)
heads, turns = [], []
for frame in range(first, last + 1):
    bpy.context.scene.frame_set(frame)
    world = armature.matrix_world
    heads.append({bone.name: list(world @ bone.head) for bone in armature.pose.bones})
    turns.append(
        {
            bone.name: [
                list(row)
                for row in (world @ bone.matrix).to_3x3()
                @ (world @ bone.bone.matrix_local).to_3x3().inverted()
            ]
            for bone in armature.pose.bones
        }
    )
meshes = [entry for entry in bpy.data.objects if entry.type == "MESH"]
answer = {
    "version": bpy.app.version_string,
    "bones": [bone.name for bone in armature.data.bones],
    "first": first,
    "heads": heads,
    "turns": turns,
    "vertices": sum(len(entry.data.vertices) for entry in meshes),
    "skinned": any(modifier.type == "ARMATURE" for entry in meshes for modifier in entry.modifiers),
}
with open(target, "w", encoding="utf-8") as stream:
    json.dump(answer, stream)
