"""What formats of bones share: poses relative to the parent, names, tips, units, and what they cannot hold.

Quaternions are x y z w, as most files store them; they rotate actively, v' = q v q*, Hamilton's product; q and -q are
the same rotation, and either may be in a file.
"""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError, ParameterError, WriteError
from skelgen.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix
from skelgen.model import Joint, Project, Skeleton
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import listed
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


_STILL_MM = 1e-3  # rounding of places in a parent's frame far from the origin


def free_limbs(skeleton: Skeleton, poses: Floats) -> tuple[int, ...]:
    """Return the limbs that no joint holds in place: the roots, and those that move along on a root that stays still.

    Parameters
    ----------
    skeleton : Skeleton
        The limbs.
    poses : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        world_from_limb in every frame.
    """
    roots = skeleton.roots.tolist()
    carried = [limb for limb in range(skeleton.n_limbs) if int(skeleton.parents[limb]) in roots]
    places = {limb: bone_transforms(poses, int(skeleton.parents[limb]), limb)[0] for limb in carried}
    return (*roots, *(limb for limb, place in places.items() if np.ptp(place, axis=0).max(initial=0.0) > _STILL_MM))


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


COLON = ":"
"""Between space of names and name, as in `mixamorig:Hips`."""

_NOT_PLAIN = re.compile(r"[^A-Za-z0-9_.-]")
_LARGEST = float(np.finfo(np.float32).max)
_SHORTEST_TIP = 1.0  # mm: importers turn a bone of no length into none, or into one of a metre
_NEARLY_ALONG = 0.9  # cosine
_CLEAR = 0.5  # of the way to one joint: nearer, the middle of several says no direction


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


def bone_names(skeleton: Skeleton, also: str = "") -> tuple[str, ...]:
    """Return the names of the limbs' bones: letters, digits and ``_``, each otherwise.

    Parameters
    ----------
    skeleton : Skeleton
        The limbs.
    also : str
        Characters that the format takes beside these.
    """
    wanted = [re.sub(rf"[^A-Za-z0-9_{also}]", "_", name) for name in skeleton.limb_names]
    return tuple(wanted) if len(set(wanted)) == len(wanted) else plain_names(wanted)


def plain_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return names with nothing but letters, digits, ``_``, ``.`` and ``-``, still distinct."""
    plain = [_NOT_PLAIN.sub("_", name) for name in names]
    counts = Counter(plain)
    taken = {name for name, count in counts.items() if count == 1}
    distinct = []
    for number, name in enumerate(plain):
        new = name if counts[name] == 1 else f"{name}_{number}"
        while counts[name] > 1 and new in taken:
            new += "_"
        taken.add(new)
        distinct.append(new)
    return tuple(distinct)


def end_names(skeleton: Skeleton, also: str = "") -> tuple[str, ...]:
    """Return the names of the joints that end the bones of limbs which carry no other.

    Parameters
    ----------
    skeleton, also
        See `bone_names`.
    """
    return tuple(f"{name}_end" for name in bone_names(skeleton, also))


def bone_tip(skeleton: Skeleton, limb: int) -> Floats:
    """Return where a limb that carries no other ends, in its frame [mm], shape (3,): as far as its markers reach.

    The direction is that of the markers' centroid, or where that is the origin, of the farthest marker; a limb without
    markers ends a millimetre from its joint.

    Parameters
    ----------
    skeleton : Skeleton
        The limbs.
    limb : int
        One without further joints.
    """
    markers = skeleton.marker_offsets[skeleton.markers_of(limb)]
    distances = np.linalg.norm(markers, axis=1)
    if not len(markers) or distances.max() < _SHORTEST_TIP:
        return np.array([0.0, 0.0, _SHORTEST_TIP])
    centre = markers.mean(axis=0)
    if np.linalg.norm(centre) < _SHORTEST_TIP:
        centre = markers[distances.argmax()]
    direction = centre / np.linalg.norm(centre)
    return np.asarray(direction * float((markers @ direction).max()))


def bone_end(skeleton: Skeleton, limb: int) -> Floats:
    """Return where the bone of a limb ends, in its frame [mm], shape (3,).

    That is the joint of the limb it carries, or of several the one with most limbs behind it, of equals their middle;
    without such a joint, or where it lies in the limb's origin, the tip.

    Parameters
    ----------
    skeleton : Skeleton
        The limbs.
    limb : int
        Any limb.
    """
    behind = _limbs_behind(skeleton)
    carried = [joint for joint in skeleton.joints if joint.parent == limb]
    if carried:
        most = max(behind[joint.child] for joint in carried)
        ends = np.array([joint.position_in_parent for joint in carried if behind[joint.child] == most])
        far = ends[np.linalg.norm(ends, axis=1).argmax()]
        for end in (ends.mean(axis=0), far):
            if np.linalg.norm(end) > max(_SHORTEST_TIP, _CLEAR * float(np.linalg.norm(far))):
                return np.asarray(end)
    return bone_tip(skeleton, limb)


def limb_from_bone(skeleton: Skeleton) -> Floats:
    """Return rotations whose y axis points along the bones, as animation programs have it, shape (n_limbs, 3, 3).

    The x axis is as near to that of the limb as can be, for a bone along that axis to the limb's z axis.
    """
    along = np.array([bone_end(skeleton, limb) for limb in range(skeleton.n_limbs)])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    aside = np.where(np.abs(along[:, :1]) < _NEARLY_ALONG, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    aside -= (aside * along).sum(axis=1, keepdims=True) * along
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    return np.stack([aside, along, np.cross(aside, along)], axis=2)


def bone_facts(skeleton: Skeleton, turns: Floats) -> dict[int, tuple[Joint, Floats | None, Floats | None, Floats]]:
    """Return joint, axis in the parent, second axis in the child, and deviations [mm] by child, in the bones' frames.

    Parameters
    ----------
    skeleton : Skeleton
        The limbs.
    turns : ndarray, shape (n_limbs, 3, 3)
        From `limb_from_bone`.
    """
    facts = {}
    for joint in skeleton.joints:
        above, below = turns[joint.parent], turns[joint.child]
        axis = None if joint.axis is None else joint.axis @ above
        second = None if joint.second_axis is None else joint.second_axis @ below
        variances = np.diag(above.T @ joint.place_covariance @ above)
        facts[joint.child] = joint, axis, second, np.sqrt(np.maximum(variances, 0.0))
    return facts


def turned_bones(poses: Floats, turns: Floats) -> Floats:
    """Return the poses of bones, shape (..., n_limbs, 4, 4).

    Parameters
    ----------
    poses : ndarray, shape (..., n_limbs, 4, 4)
        World from limb.
    turns : ndarray, shape (n_limbs, 3, 3)
        Limb from bone.
    """
    bones = poses.copy()
    bones[..., :3, :3] = poses[..., :3, :3] @ turns
    return bones


def along_bones(lengths: Sequence[float]) -> Floats:
    """Return the poses of joints at the ends of bones of these lengths, in the bones, shape (n, 4, 4)."""
    ends = np.tile(np.eye(4), (len(lengths), 1, 1))
    ends[:, 1, 3] = lengths
    return ends


def _limbs_behind(skeleton: Skeleton) -> Ints:
    behind = np.ones(skeleton.n_limbs, dtype=np.intp)
    for limb in skeleton.outward[::-1].tolist():
        if skeleton.parents[limb] >= 0:
            behind[skeleton.parents[limb]] += behind[limb]
    return behind


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
    interpolated = int(project.motion.interpolated.any(axis=1).sum())
    if interpolated:
        frames = f"{interpolated} of {project.motion.n_frames} frames"
        remarks.append(f"{title} cannot say that in {frames} some limb is not seen but interpolated.")
    return (*remarks, *never_seen_remarks(project))


def never_seen_remarks(project: Project) -> tuple[str, ...]:
    """Say of which limbs no frame tells how they turn, in a sentence or none."""
    names = [project.skeleton.limb_names[limb] for limb in project.motion.never_seen]
    return (f"No frame tells all turns of {listed(names)}: too few markers.",) if names else ()
