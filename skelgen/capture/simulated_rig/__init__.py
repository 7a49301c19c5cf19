"""The simulated rig: what two cameras would see of moving balls, with sub-pixel truth."""

from skelgen.capture.simulated_rig.board import SimulatedBoard, board_image
from skelgen.capture.simulated_rig.scene import hand_held_target, scene_of_bodies
from skelgen.capture.simulated_rig.source import SimulatedRig, render_view, simulated_rig
from skelgen.capture.simulated_rig.view import RenderParameters

__all__ = [
    "RenderParameters",
    "SimulatedBoard",
    "SimulatedRig",
    "board_image",
    "hand_held_target",
    "render_view",
    "scene_of_bodies",
    "simulated_rig",
]
