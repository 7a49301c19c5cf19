"""The application layer that the command line and the window share: from an input file to results, reports and exports.

`stages` names the stages in their order, `pipeline` runs them, `face` holds what scripts call. Not for users: scripts
need only ``import skelgen``.
"""

STAGE_SUMMARIES = {
    "labels": "Follow unlabelled points over time and find which of them belong to the same marker.",
    "limbs": "Group the markers whose distances stay constant into rigid limbs.",
    "joints": "Find the joints between limbs and the tree that they form.",
    "skeleton": "Fit a skeleton of rigid limbs and its motion to every frame.",
}
"""What each stage does, in the order in which they run; it stands here because ``skelgen --help`` loads no more."""
