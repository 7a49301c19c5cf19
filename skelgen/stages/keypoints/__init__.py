"""Keypoints, which sit on joints: bones between points stand for limbs, and the stages 2 to 4 are closed forms.

`bones` finds which points a bone joins, and the tree; `stage` makes of it what stages 2 to 4 make of markers.
"""

from skelgen.stages.keypoints.stage import find_keypoint_joints, find_keypoint_limbs, fit_keypoint_skeleton

__all__ = ["find_keypoint_joints", "find_keypoint_limbs", "fit_keypoint_skeleton"]
