"""What the stages are called, apart from their work: the list of commands is printed without loading any of it."""

from __future__ import annotations

from typing import NamedTuple


class StageName(NamedTuple):
    """How one stage is called.

    Attributes
    ----------
    name : str
        Key in a project's reports and in the parameters.
    command : str
        Name on the command line.
    summary : str
        One sentence.
    """

    name: str
    command: str
    summary: str


LABELS = StageName("labels", "label", "Follow unlabelled points over time and tell which belong to the same marker.")
LIMBS = StageName("limbs", "cluster", "Group the markers whose distances stay constant into rigid limbs.")
JOINTS = StageName("joints", "joints", "Find the joints between limbs and the tree that they form.")
SKELETON = StageName("skeleton", "fit", "Fit a skeleton of rigid limbs and its motion to every frame.")

STAGE_NAMES = (LABELS, LIMBS, JOINTS, SKELETON)
"""In the order in which the stages run."""
