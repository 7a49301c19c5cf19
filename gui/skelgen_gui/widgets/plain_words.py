"""Parameters and their choices as a person says them; what has no entry here is plain already.

Files, command line and documentation keep the names: they stand in the tool tip.
"""

from PySide6.QtCore import QCoreApplication

from skelgen.parameters import Declaration

_TITLES = {  # as short as the column of names: two or three words
    "absolute_tolerance": "Least step of cost",
    "add_random": "Jitter, for tests",
    "alignment": "Markers aligned",
    "alpha": "Pull to markers",
    "alpha_final": "Pull at last",
    "anneal": "Shake joints",
    "assignment": "Points are matched",
    "clustering": "Tracks are grouped",
    "count": "Limbs are counted",
    "fit": "Way of fitting",
    "flatness": "Flat as a line",
    "flexibility": "Limbs may bend by",
    "hinge_wobble": "Hinges may wobble",
    "kind_doubt": "Doubt about types",
    "kinds": "Known joint types",
    "kmeans": "Groups improved",
    "link_evidence": "Evidence for a cut",
    "local_scaling": "Scale by neighbour",
    "max_gap": "Longest gap bridged",
    "max_jump": "Farthest jump",
    "measure": "Distances compared",
    "method": "Way of working",
    "misfit_weight": "Weight of misfit",
    "mute": "Ignored after jump",
    "n_bodies": "Bodies, 0 to find",
    "n_nearest": "Nearest limbs tried",
    "n_neighbours": "Neighbours aligned",
    "outlier": "Left out on a limb",
    "outlier_limit": "Left out beyond",
    "robust": "Left out of the fit",
    "parted": "No joints between",
    "joined": "Joints between",
    "prediction": "Next place expected",
    "rotation": "Points are aligned",
    "sampling": "Frames between",
    "separate": "Separate bodies",
    "slips": "Find slipped markers",
    "repair": "Repair labels",
    "solver": "Joints computed",
    "sigma_squared": "Scale squared",
}

_CHOICES = {
    "average": "mean distance",
    "complete": "largest distance",
    "spectral": "spectral",
    "global-spectral": "spectral, one scale",
    "closed-form": "directly",
    "conjugate-gradient": "step by step",
    "deviation": "standard deviation",
    "distances": "by distances alone",
    "double_exponential": "smoothed trend",
    "constant_velocity": "as it moved last",
    "none": "where it was",
    "eigengap": "by eigenvalues",
    "fletcher-reeves": "Fletcher and Reeves",
    "polak-ribiere": "Polak and Ribière",
    "greedy": "nearest first",
    "optimal": "all together",
    "horn": "quaternions (Horn)",
    "umeyama": "SVD (Umeyama)",
    "local": "neighbours only",
    "whole": "all markers",
    "rigidity": "what stays rigid",
    "rising": "one more each time",
    "root-outward": "limb after limb",
    "whole-chain": "all limbs together",
    "rotation": "by rotations",
    "sets": "sets of tracks (classic)",
}
_OF_STAGES = frozenset(_TITLES)  # other forms use some of these words otherwise


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
