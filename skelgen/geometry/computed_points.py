"""Points that a model computed from markers, known by their names: centres of joints and of mass, axes of segments.

Vicon's Plug-in Gait, Visual3D, OpenSim and their like write them beside the markers. Only names that no marker has
count: a marker may well be called ``LHIP`` or ``RKNE``, but none ``LHJC``.
"""

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from skelgen.model.arrays import Bools

_BONE = re.compile(r"(PEL|HED|TRX|SPI|[LR](?:FE|TI|FO|TO|HU|RA|HN|CL))([OALP])")
_POINTS_OF_BONE = 4  # its origin, and a point on each of its axes

_APART = re.compile(r"[\s_.-]")
_SIDE, _JOINT = "left|right|l|r", "hip|knee|ankle|shoulder|elbow|wrist|[hkasew]"
_CENTRE = re.compile(rf"(?:{_SIDE})?(?:{_JOINT})(?:jc|jointcent(?:er|re))(?:{_SIDE})?")
_HOW = re.compile(r"_[a-z]+$")  # behind a centre: R_HJC_reg is by regression
_SEGMENT = "(?:left|right)(?:femur|tibia|foot|toes?|humerus|radius|hand)|pelvis|thorax|head|(?:whole)?body"
_MASS = re.compile(rf"cent(?:er|re)of(?:mass|gravity)(?:floor)?|(?:{_SEGMENT})?com")


def are_axes(names: Sequence[str]) -> Bools:
    """Return which points are origin and axes of segments of Plug-in Gait, shape (n_points,).

    Parameters
    ----------
    names : sequence of str
        Their labels; ``PELO`` counts if ``PELA``, ``PELL`` and ``PELP`` are there, too.
    """
    short = _short(names)
    n_points = Counter(bone[1] for name in set(short) if (bone := _BONE.fullmatch(name)))
    bones = [_BONE.fullmatch(name) for name in short]
    return np.array([bone is not None and n_points[bone[1]] == _POINTS_OF_BONE for bone in bones], dtype=np.bool_)


def are_computed(names: Sequence[str]) -> Bools:
    """Return which points a model computed from the others, shape (n_points,).

    Parameters
    ----------
    names : sequence of str
        Their labels. Centres of joints (``LHJC``, ``R.KJC``, ``RKneeJC``, ``R_HJC_reg``, ``left hip joint centre``),
        centres of mass (``COM``, ``CentreOfMass``, ``LeftFemurCOM``) and axes of segments count. Centres of joints are
        computed from as many markers at least: where fewer other points are there, none counts.
    """
    lower = [name.lower() for name in _short(names)]
    plain, stem = ([_APART.sub("", name) for name in some] for some in (lower, [_HOW.sub("", name) for name in lower]))
    centres = _matches(_CENTRE, plain) | _matches(_CENTRE, stem)
    computed = centres | _matches(_MASS, plain) | are_axes(names)
    n_others = len(computed) - computed.sum()
    return computed if n_others >= max(centres.sum(), 1) else np.zeros_like(computed)


def _matches(pattern: re.Pattern[str], names: Sequence[str]) -> Bools:
    return np.array([pattern.fullmatch(name) is not None for name in names], dtype=np.bool_)


def _short(names: Sequence[str]) -> list[str]:
    """Labels without the subject before them."""
    return [name.rpartition(":")[2].strip() for name in names]
