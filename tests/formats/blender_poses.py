"""Run by a Python that has Blender (bpy), as `blender_poses.py FILE SECONDS,... RESULT.json`: what Blender makes of it.

The scene's rate and range; of each bone head and tail at rest, and its pose at each time; all in the world, in metres.
"""

import json
import sys
from pathlib import Path

import bpy


def imported(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.endswith(".glb"):
        bpy.ops.import_scene.gltf(filepath=path)
    elif path.endswith(".bvh"):
        bpy.context.scene.render.fps = 50
        options = {"use_fps_scale": True, "axis_forward": "Y", "axis_up": "Z"}
        bpy.ops.import_anim.bvh(filepath=path, global_scale=0.001, **options)
    else:
        bpy.ops.wm.usd_import(filepath=path)
    return next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")


def numbers(matrix):
    return [list(row) for row in matrix]


path, times, result = sys.argv[1:4]
armature, scene = imported(path), bpy.context.scene
rate = scene.render.fps / scene.render.fps_base
action = next(iter(bpy.data.actions))
first = action.frame_range[0]  # a BVH's is 1
poses = []
for seconds in times.split(","):
    whole, part = divmod(first + float(seconds) * rate, 1.0)
    scene.frame_set(int(whole), subframe=part)
    world = armature.matrix_world
    poses.append({bone.name: numbers(world @ bone.matrix) for bone in armature.pose.bones})
world = armature.matrix_world
rest = {bone.name: [list(world @ bone.head_local), list(world @ bone.tail_local)] for bone in armature.data.bones}
facts = {"range": [scene.frame_start, scene.frame_end], "keys": list(action.frame_range), "rate": rate}
Path(result).write_text(json.dumps({"rest": rest, "poses": poses, **facts}))
