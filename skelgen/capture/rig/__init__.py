"""The simulated rig: what two cameras would see of moving balls, with sub-pixel truth."""

from skelgen.capture.rig.arm import seed_arm
from skelgen.capture.rig.board import BoardTruth, SimulatedBoard, board_places, draw_board
from skelgen.capture.rig.parameters import RenderParameters
from skelgen.capture.rig.projected import projected_balls
from skelgen.capture.rig.render import PairTruth, render_pair, render_view
from skelgen.capture.rig.scene import Scene, scene_of_bodies, scene_of_structure, view_centre, wandering_poses
from skelgen.capture.rig.source import SimulatedRig, simulated_rig, suited_parameters
from skelgen.capture.rig.target import hand_held_target
from skelgen.capture.rig.view import ViewTruth

__all__ = [
    "BoardTruth",
    "PairTruth",
    "RenderParameters",
    "Scene",
    "SimulatedBoard",
    "SimulatedRig",
    "ViewTruth",
    "board_places",
    "draw_board",
    "hand_held_target",
    "projected_balls",
    "render_pair",
    "render_view",
    "scene_of_bodies",
    "scene_of_structure",
    "seed_arm",
    "simulated_rig",
    "suited_parameters",
    "view_centre",
    "wandering_poses",
]
