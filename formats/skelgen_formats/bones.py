"""What formats of bones share: poses relative to the parent, names, tips, units, and what they cannot hold.

Quaternions are x y z w, as most files store them; they rotate actively, v' = q v q*, Hamilton's product; q and -q are
the same rotation, and either may be in a file.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError, ParameterError, WriteError
from skelgen.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix
from skelgen.model import Project, Skeleton
from skelgen.model.arrays import Floats, Ints
from skelgen_formats.options import AUTO, MM_PER_UNIT


def xyzw_from_matrix(rotations: Floats) -> Floats:
    """Return unit quaternions with w >= 0, shape (..., 4), of rotation matrices, shape (..., 3, 3)."""
    return np.roll(quaternion_from_matrix(rotations), -1, axis=-1)


def matrix_from_xyzw(quaternions: Floats) -> Floats:
    """Return rotation matrices, shape (..., 3, 3), of quaternions of any length but zero, shape (..., 4)."""
    units = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    return matrix_from_quaternion(np.roll(units, 1, axis=-1))


def parent_from_child(world_from_parent: Floats, world_from_child: Floats) -> tuple[Floats, Floats]:
    """Return a child's pose relative to its parent.

    Parameters
    ----------
    world_from_parent, world_from_child : ndarray, shape (..., 4, 4), translations in mm
        Rigid transforms.

    Returns
    -------
    translation : ndarray, shape (..., 3), mm
    rotation : ndarray, shape (..., 3, 3)
    """
    parent_from_world = world_from_parent[..., :3, :3].swapaxes(-1, -2)
    apart = world_from_child[..., :3, 3] - world_from_parent[..., :3, 3]
    translation = (parent_from_world @ apart[..., np.newaxis])[..., 0]
    return translation, parent_from_world @ world_from_child[..., :3, :3]


def scaled_poses(poses: Floats, scale: float) -> Floats:
    """Return poses, shape (..., 4, 4), with their translations multiplied by a factor.

    Parameters
    ----------
    poses : ndarray, shape (..., 4, 4)
        Rigid transforms.
    scale : float
        The factor.
    """
    scaled = poses.copy()
    scaled[..., :3, 3] *= scale
    return scaled


def bone_transforms(poses: Floats, parent: int, limb: int) -> tuple[Floats, Floats]:
    """Return one limb's translation [mm], shape (..., 3), and rotation, shape (..., 3, 3), relative to its parent.

    Parameters
    ----------
    poses : ndarray, shape (..., n_limbs, 4, 4)
        world_from_limb of all limbs.
    parent, limb : int
        Limb indices; a parent of -1 is the world.
    """
    if parent < 0:
        return poses[..., limb, :3, 3], poses[..., limb, :3, :3]
    return parent_from_child(poses[..., parent, :, :], poses[..., limb, :, :])


LARGEST_MM = 1e9
"""No place of a motion lies farther from the origin: a thousand kilometres; what does is a damaged number."""

_USUAL_MM = 1000.0  # from the root of a body to its farthest tip: a human's hands and feet, within a factor of three
_CANDIDATES = ("mm", "cm", "m")


def bone_unit(
    path: Path, unit: str, parents: Ints, offsets: Floats, tips: Sequence[Floats]
) -> tuple[float, tuple[str, ...]]:
    """Return the mm per unit of a file, and what the user should know of it.

    Parameters
    ----------
    path : Path
        The file.
    unit : str
        A unit's name, a number of mm, or `AUTO`: that of mm, cm, m which brings the longest way along the bones from
        the root nearest to a metre, in proportion.
    parents : ndarray of intp, shape (n_bones,)
        Parents, -1 for roots.
    offsets : ndarray, shape (n_bones, 3)
        Each bone in its parent, in the file's unit.
    tips : sequence of ndarray, shape (n_tips, 3)
        Ends of each bone.

    Raises
    ------
    ParameterError
        If there is no such unit.
    FormatError
        If the unit is to be found from a body without size.
    """
    if unit != AUTO:
        return _stated(unit), ()
    reach = np.zeros(len(parents))
    with np.errstate(over="ignore"):  # what is infinite is refused below
        for bone, parent in enumerate(parents.tolist()):
            if parent >= 0:
                reach[bone] = reach[parent] + np.linalg.norm(offsets[bone])
        longest = max(reach[bone] + np.linalg.norm(ends, axis=1).max(initial=0.0) for bone, ends in enumerate(tips))
    if not 0 < longest < LARGEST_MM:
        raise FormatError(path, "", "no bone has a length, so that the unit cannot be found; give --motion-unit")
    best = min(_CANDIDATES, key=lambda name: abs(np.log(longest * MM_PER_UNIT[name] / _USUAL_MM)))
    size = longest * MM_PER_UNIT[best]
    notice = f"the file states no unit; taken as {best}, which makes its longest row of bones {size:.0f} mm"
    return MM_PER_UNIT[best], (f"{notice}; --motion-unit says otherwise",)


def _stated(unit: str) -> float:
    try:
        scale = MM_PER_UNIT[unit.lower()] if unit.lower() in MM_PER_UNIT else float(unit)
    except ValueError:
        scale = np.nan
    if not 0 < scale < LARGEST_MM:
        raise ParameterError(f"motion-unit is {unit!r}; it must be auto, mm, cm, m, in, or a number of mm")
    return scale


_LARGEST = float(np.finfo(np.float32).max)
_SHORTEST_TIP = 1.0  # mm: importers turn a bone of no length into none, or into one of a metre


def check_single_precision(project: Project, title: str) -> None:
    """Raise `WriteError` if a coordinate of a project is beyond the numbers of a format with single precision.

    Parameters
    ----------
    project : Project
        Finished.
    title : str
        Of the format, for the error.
    """
    poses = (project.motion.world_from_limb, project.skeleton.reference_pose)
    if not all(float(np.abs(pose).max()) < _LARGEST for pose in poses):
        raise WriteError(f"a coordinate is beyond what {title}'s single precision can hold")


def bone_name(limb: int) -> str:
    """Return the name of a limb's bone, as all formats of animations have it."""
    return f"limb{limb}"


def bone_tip(skeleton: Skeleton, limb: int) -> Floats:
    """Return where a limb that carries no other ends, in its frame [mm], shape (3,): as far as its markers reach.

    The direction is that of the markers' centroid; a limb without markers ends a millimetre from its joint.

    Parameters
    ----------
    skeleton : Skeleton
        The limbs.
    limb : int
        One without further joints.
    """
    markers = skeleton.marker_offsets[skeleton.markers_of(limb)]
    centre = markers.mean(axis=0) if len(markers) else np.zeros(3)
    distance = float(np.linalg.norm(centre))
    if distance < _SHORTEST_TIP:
        return np.array([0.0, 0.0, _SHORTEST_TIP])
    return np.asarray(centre / distance * float((markers @ centre).max()) / distance)


def lost_in_animations(project: Project, title: str) -> tuple[str, ...]:
    """Say what of this project's skeleton no tree of bones holds: closed loops, and which frames are interpolated.

    Parameters
    ----------
    project : Project
        Finished.
    title : str
        Of the format.
    """
    remarks = []
    if project.skeleton.loops:
        joints = f"{len(project.skeleton.loops)} joint{'s' if len(project.skeleton.loops) > 1 else ''}"
        remarks.append(f"{title} holds trees only: {joints} closing loops are left out.")
    interpolated = int((~project.motion.limb_seen).any(axis=1).sum())
    if interpolated:
        frames = f"{interpolated} of {project.motion.n_frames} frames"
        remarks.append(f"{title} cannot say that in {frames} some limb is not seen but interpolated.")
    return tuple(remarks)
