"""Parameters and their choices as a person says them; what has no entry here is plain already.

Files, command line and documentation keep the names: they stand in the tool tip.
"""

from PySide6.QtCore import QCoreApplication

from skelgen.parameters import Declaration

_TITLES = {
    "absolute_tolerance": "Smallest step of the cost",
    "add_random": "Add jitter for tests",
    "alignment": "Markers compared when tracks are aligned",
    "alpha": "Pull of joints towards their markers, for the tree",
    "alpha_final": "Pull of joints towards their markers, at last",
    "anneal": "Shake joints while they are sought",
    "clustering": "How tracks are grouped",
    "count": "How the number of limbs is found",
    "fit": "How the skeleton is fitted",
    "flatness": "Points count as a line when flatter than",
    "flexibility": "A limb may bend by",
    "kind_doubt": "Doubt allowed about the type of a joint",
    "kinds": "Known types of joints",
    "kmeans": "How groups are improved",
    "link_evidence": "Evidence that cuts a track",
    "local_scaling": "Scale each marker by its neighbour",
    "max_gap": "Longest gap that is bridged",
    "max_jump": "Farthest jump of a marker",
    "measure": "What distances are compared by",
    "mute": "Frames ignored after a jump",
    "n_nearest": "Nearest limbs that are tried",
    "n_neighbours": "Neighbours in the alignment",
    "outlier_limit": "Positions left out beyond",
    "parted": "No joints between",
    "joined": "Joints between",
    "prediction": "Where a marker is expected next",
    "rotation": "How two groups of points are aligned",
    "sampling": "Interval of sampled frames",
    "separate": "Several bodies may be there",
    "slips": "Look for markers that slip",
    "solver": "How joints are computed",
    "sigma_squared": "Scale of distances, squared",
}

_CHOICES = {
    "average": "by their mean distance",
    "complete": "by their largest distance",
    "spectral": "by spectral clustering",
    "global-spectral": "by spectral clustering, one scale",
    "k-means": "by k-means",
    "closed-form": "directly, where limbs have poses",
    "conjugate-gradient": "step by step (conjugate gradients)",
    "deviation": "standard deviation",
    "distances": "by distances alone",
    "double_exponential": "by its smoothed trend",
    "constant_velocity": "as it moved last",
    "none": "where it was",
    "eigengap": "by the gap of eigenvalues",
    "fletcher-reeves": "Fletcher and Reeves",
    "polak-ribiere": "Polak and Ribière",
    "greedy": "nearest first",
    "optimal": "all together",
    "horn": "by unit quaternions (Horn)",
    "umeyama": "by singular values (Umeyama)",
    "local": "neighbours only",
    "whole": "all markers",
    "rigidity": "by what stays rigid",
    "rising": "one more until all are rigid",
    "root-outward": "limb after limb",
    "whole-chain": "all limbs together",
    "rotation": "by rotations",
    "sets": "by sets of tracks (classic)",
}
_OF_STAGES = frozenset(_TITLES) | {"method", "assignment"}  # other forms use some of these words otherwise


def title_of(declaration: Declaration) -> str:
    """Return what a parameter is called in a form."""
    title = _TITLES.get(declaration.name, declaration.name.replace("_", " ").capitalize())
    return QCoreApplication.translate("Parameters", title)


def choice_of(declaration: Declaration, choice: str) -> str:
    """Return what a choice is called in a form.

    Parameters
    ----------
    declaration : Declaration
        Whose choice it is.
    choice : str
        Its name in files.
    """
    words = _CHOICES.get(choice, choice) if declaration.name in _OF_STAGES else choice
    return QCoreApplication.translate("Parameters", words)
