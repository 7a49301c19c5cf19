"""Run by a Python that has Blender (bpy) as `blender_human_bones.py FILE RESULT.json`: what its VRM add-on makes of it.

Its mapper for humanoid rigs says which bone of a person each bone is: by the names of known rigs, or by the structure.
"""

import json
import sys
from pathlib import Path

import bpy
from io_scene_vrm.common.human_bone_mapper.human_bone_mapper import create_human_bone_mapping

path, result = sys.argv[1:3]
bpy.ops.wm.read_factory_settings(use_empty=True)
if path.endswith(".glb"):
    bpy.ops.import_scene.gltf(filepath=path)
else:
    bpy.ops.import_anim.bvh(filepath=path, global_scale=0.001, axis_forward="Y", axis_up="Z")
armature = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
found = {bone: human.name.value for bone, human in create_human_bone_mapping(armature).items()}
Path(result).write_text(json.dumps({"human": found, "bones": [bone.name for bone in armature.data.bones]}))
