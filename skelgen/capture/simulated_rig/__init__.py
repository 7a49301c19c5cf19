"""The simulated rig: what two cameras would see of moving balls, with sub-pixel truth."""

from skelgen.capture.reference_rig import reference_arm
from skelgen.capture.simulated_rig.board import SimulatedBoard, board_image, board_places
from skelgen.capture.simulated_rig.scene import (
    Scene,
    Wandering,
    hand_held_target,
    scene_of_bodies,
    scene_of_structure,
    wandering_poses,
)
from skelgen.capture.simulated_rig.source import (
    SimulatedRig,
    render_pair,
    render_view,
    simulated_rig,
    suited_parameters,
)
from skelgen.capture.simulated_rig.view import RenderParameters

__all__ = [
    "RenderParameters",
    "Scene",
    "SimulatedBoard",
    "SimulatedRig",
    "Wandering",
    "board_image",
    "board_places",
    "hand_held_target",
    "reference_arm",
    "render_pair",
    "render_view",
    "scene_of_bodies",
    "scene_of_structure",
    "simulated_rig",
    "suited_parameters",
    "wandering_poses",
]
