"""The rigid skeleton and its motion."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import InputError, MissingResultError
from skelgen.model.arrays import Bools, Floats, Ints, check_bools, check_fields, check_floats, check_ints, set_fields
from skelgen.model.limbs import BODY_END, body_and_limb, check_limb_names
from skelgen.model.topology import joint_children, limbs_of_bodies, outward_order

_JOINTS = {
    ("chest", "head"): "neck",
    ("pelvis", "chest"): "waist",
    ("pelvis", "abdomen"): "waist",
    ("chest", "upper arm"): "shoulder",
    ("upper arm", "forearm"): "elbow",
    ("forearm", "hand"): "wrist",
    ("pelvis", "thigh"): "hip",
    ("thigh", "shank"): "knee",
    ("shank", "foot"): "ankle",
    ("foot", "toes"): "toe joint",
}
"""What joints of a body are called by the segments that they join, without their sides."""

_SIDED = re.compile("(?:(left|right) )?(.*?)(?: ([AB]))?")
"""A limb with its side; A and B are sides of which nobody knows which is left."""

JOINT_TYPES = ("ball", "universal", "hinge", "rigid", "undetermined")


def joint_between(first: str, second: str) -> str:
    """Return the name of the joint between two limbs, by their names.

    Parameters
    ----------
    first, second : str
        The limbs, the parent first; the body that both names begin with is said once.

    Examples
    --------
    >>> joint_between("left upper arm", "left forearm"), joint_between("limb0", "limb1")
    ('left elbow', 'limb0-limb1')
    """
    (body, inner), (other_body, outer) = body_and_limb(first), body_and_limb(second)
    if body and body == other_body:
        return f"{body}{BODY_END}{joint_between(inner, outer)}"
    found = [_SIDED.fullmatch(name) for name in (first, second)]
    (before, one, after), (other_before, other, other_after) = (
        match.groups("") if match else ("",) * 3 for match in found
    )
    sides = {before, other_before} - {""}, {after, other_after} - {""}
    joint = _JOINTS.get((one, other)) or _JOINTS.get((other, one))
    if joint is None or len(sides[0]) + len(sides[1]) > 1:
        return f"{first}-{second}"
    return " ".join((*sides[0], joint, *sides[1]))


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint between a limb and its parent.

    Attributes
    ----------
    parent, child : int
        Limb indices.
    position_in_parent, position_in_child : ndarray, shape (3,), mm
        The joint in both limbs' frames. The child's frame has its origin here, so `position_in_child` is zero for a
        skeleton made by this program.
    kind : str
        ``ball``, ``universal``, ``hinge``, ``rigid``, or ``undetermined`` where the limbs rotate too little.
    axis : ndarray, shape (3,), or None
        Unit axis of a hinge, or that of a universal joint which is fixed in the parent, in the parent's frame; None for
        other types.
    std : ndarray, shape (3,), mm
        Standard deviation of the position along the axes of the parent's frame. Along the axis of a hinge the position
        is not determined, and the deviation is as large as the limb.
    second_axis : ndarray, shape (3,), or None
        Unit axis of a universal joint that is fixed in the child, in the child's frame; None for other types.
    covariance, covariance_in_child : ndarray, shape (3, 3), mm^2, or None
        Of the position in the parent, against the parent's markers (`std` is the root of the diagonal), and of that in
        the child, against the child's markers.
    axis_std, second_axis_std : ndarray, shape (3,), or None
        Standard deviations of the components of a hinge's axis in the parent and in the child, or of the two axes of a
        universal joint; the root of their sum of squares is the angle [rad] by which the axis typically errs.
    turn_covariance : ndarray, shape (3, 3), rad^2, or None
        Of the child's rotation against the parent, in the parent's axes, by errors of the skeleton: it adds to the
        covariance by the noise of a frame.
    open_directions : int
        In how many of three directions the motion alone does not determine the position in the parent. The axis of a
        hinge is the first of them.
    usual_directions : int
        In how many of these what is usual of bodies tells the position, and `std` says how well; where it is drawn
        along the others is a choice. `placed_joints.place_of` says it in words.
    is_placed_by_marker_set : bool
        Whether the place rests on the marker set that a person wears, whose joints are known, because the motion alone
        does not determine it.
    name : str
        What the user calls it; empty: by the limbs that it joins.

    Notes
    -----
    What is None was not estimated: by older versions, or by other programs.
    """

    parent: int
    child: int
    position_in_parent: Floats
    position_in_child: Floats
    kind: str
    axis: Floats | None
    std: Floats
    second_axis: Floats | None = None
    covariance: Floats | None = None
    covariance_in_child: Floats | None = None
    axis_std: Floats | None = None
    second_axis_std: Floats | None = None
    turn_covariance: Floats | None = None
    open_directions: int = 0
    name: str = ""
    is_placed_by_marker_set: bool = False
    usual_directions: int = 0

    def __post_init__(self) -> None:
        if self.kind not in JOINT_TYPES:
            raise InputError(f"a joint of type {self.kind!r}; types are {', '.join(JOINT_TYPES)}")
        if self.open_directions not in range(4):
            raise InputError(f"a joint whose place is open in {self.open_directions} of 3 directions")
        if self.usual_directions not in range(self.open_directions + 1):
            numbers = f"{self.usual_directions} of {self.open_directions} open directions"
            raise InputError(f"a joint whose place is usual in {numbers}")
        vectors = ["position_in_parent", "position_in_child", "std", "second_axis", "axis_std", "second_axis_std"]
        vectors += [] if self.axis is None else ["axis"]
        squares = ("covariance", "covariance_in_child", "turn_covariance")
        check_fields(self, dict.fromkeys(vectors, (3,)), "a joint's {}", finite=True)
        check_fields(self, dict.fromkeys(squares, (3, 3)), "a joint's {}", finite=True)

    @property
    def is_determined(self) -> bool:
        """Whether motion determines the position, but for the place of a hinge along its axis."""
        return not self.is_placed_by_marker_set and self.open_directions <= (self.kind == "hinge")

    @property
    def is_fully_determined(self) -> bool:
        """Whether motion determines the position, that of a hinge along its axis, too."""
        return not self.is_placed_by_marker_set and self.open_directions == 0

    @property
    def std_in_child(self) -> Floats | None:
        """Standard deviation of the position along the axes of the child's frame [mm], shape (3,), if estimated."""
        if self.covariance_in_child is None:
            return None
        return np.sqrt(np.maximum(np.diag(self.covariance_in_child), 0.0))

    @property
    def place_covariance(self) -> Floats:
        """Covariance of the position in the parent [mm^2], (3, 3); of its deviations if no other is known."""
        return np.diag(self.std**2) if self.covariance is None else self.covariance

    def free_axis(self) -> Floats:
        """Return the axis along which a hinge's place is open, in both limbs; zero for other types, shape (3,)."""
        return self.axis if self.kind == "hinge" and self.axis is not None else np.zeros(3)


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Rigid limbs, joined in a tree.

    Each limb has a frame of its own, with the orientation of the world in the reference pose. Its origin is the joint
    to the parent; a root's origin is the centroid of its markers.

    Attributes
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent limb of each limb, -1 for a root.
    joints : tuple of Joint
        From the roots outward, in the order of the topology's children.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker, -1 = left out.
    marker_offsets : ndarray, shape (n_markers, 3), mm
        Each marker in its limb's frame; NaN for markers that are left out.
    marker_std : ndarray, shape (n_markers,), mm
        Root mean square over frames and coordinates of each marker's deviation from its place on the limb.
    reference_pose : ndarray, shape (n_limbs, 4, 4)
        world_from_limb in the reference pose (rotations are the identity).
    offset_std : ndarray, shape (n_markers, 3), mm, or None
        Standard deviations of the markers' places along the axes of their limbs, against the limb's other markers.
    length_std : ndarray, shape (n_lengths,), mm, or None
        Standard deviations of `lengths`, in their order. The position of a hinge along its axis is a choice, no error.
    marker_noise : ndarray, shape (n_markers,), mm, or None
        Standard deviation of each marker's coordinates, freedoms of the fit taken off.
    loops : tuple of Joint
        Joints beyond the tree, between any two limbs, that close kinematic loops; the motion keeps them closed.
    limb_names : tuple of str, length n_limbs
        What the limbs are called, each otherwise; ``limb0``, ``limb1`` and so on if nobody says.
    """

    parents: Ints
    joints: tuple[Joint, ...]
    limb_of_marker: Ints
    marker_offsets: Floats
    marker_std: Floats
    reference_pose: Floats
    offset_std: Floats | None = None
    length_std: Floats | None = None
    marker_noise: Floats | None = None
    loops: tuple[Joint, ...] = ()
    limb_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        parents = check_ints(self.parents, (None,), "parents")
        limb_of_marker = check_ints(self.limb_of_marker, (None,), "limb_of_marker")
        n_markers = len(limb_of_marker)
        of_markers = dict.fromkeys(("marker_offsets", "offset_std"), (n_markers, 3))
        check_fields(self, of_markers | dict.fromkeys(("marker_std", "marker_noise"), (n_markers,)))
        check_fields(self, {"reference_pose": (len(parents), 4, 4)}, finite=True)
        set_fields(self, parents=parents, joints=tuple(self.joints), loops=tuple(self.loops))
        set_fields(self, limb_of_marker=limb_of_marker)
        set_fields(self, limb_names=check_limb_names(self.limb_names, len(parents)))
        if [joint.child for joint in self.joints] != joint_children(parents).tolist():
            raise InputError("joints must be listed from the root outward, one per child limb")
        if not np.isfinite(self.marker_offsets[limb_of_marker >= 0]).all():
            raise InputError("marker_offsets of markers on limbs must be finite numbers")
        check_fields(self, {"length_std": (len(self.lengths),)})

    @property
    def n_limbs(self) -> int:
        """Number of limbs."""
        return len(self.parents)

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """A name for each joint, such as ``left elbow``, or ``limb0-limb1`` (parent, child)."""
        return tuple(self.joint_name(joint) for joint in self.joints)

    def joint_name(self, joint: Joint) -> str:
        """Return the name of a joint of the tree, or of one that closes a loop."""
        return joint.name or joint_between(self.limb_names[joint.parent], self.limb_names[joint.child])

    @property
    def roots(self) -> Ints:
        """Limbs without a parent."""
        return np.flatnonzero(self.parents < 0)

    @property
    def bodies(self) -> tuple[Ints, ...]:
        """The limbs of each body, that is of each tree, rising; the body with most limbs first."""
        return limbs_of_bodies(self.parents)

    @property
    def outward(self) -> Ints:
        """Limbs from the roots outward, shape (n_limbs,)."""
        return outward_order(self.parents)

    @property
    def lengths(self) -> dict[tuple[int, int], float]:
        """Distances [mm] between each two joints of one limb: keys are pairs of joint indices."""
        found = {}
        for limb in range(self.n_limbs):
            for (first, at_first), (second, at_second) in combinations(self.joints_of(limb), 2):
                found[first, second] = float(np.linalg.norm(at_first - at_second))
        return found

    def markers_of(self, limb: int) -> Ints:
        """Indices of the markers on one limb, rising."""
        return np.flatnonzero(self.limb_of_marker == limb)

    def joints_of(self, limb: int) -> list[tuple[int, Floats]]:
        """Joints of one limb: index into `joints`, and position in the limb's frame [mm]."""
        found = []
        for index, joint in enumerate(self.joints):
            if joint.parent == limb:
                found.append((index, joint.position_in_parent))
            elif joint.child == limb:
                found.append((index, joint.position_in_child))
        return found

    def limb_of_length(self, pair: tuple[int, int]) -> int:
        """The limb that a pair of joint indices from `lengths` shares."""
        first, second = (self.joints[index] for index in pair)
        shared = {first.parent, first.child} & {second.parent, second.child}
        return shared.pop()


@dataclass(frozen=True, eq=False)
class JointAngles:
    """The angles of one joint over time, 0 in the reference pose.

    Attributes
    ----------
    names : tuple of str
        ``turn`` for the angle of a hinge about its axis; ``first`` and ``second`` for those of a universal joint about
        its axis in the parent and its axis in the child; ``x``, ``y``, ``z`` for the rotation vector of a ball joint in
        the parent's axes; empty for a rigid joint.
    values, std : ndarray, shape (n_frames, n_angles), rad
        The angles, those about axes without jumps of a full turn, and their standard deviations.
    """

    names: tuple[str, ...]
    values: Floats
    std: Floats


@dataclass(frozen=True, eq=False)
class Motion:
    """The skeleton's pose in every frame, always complete: what could not be seen is interpolated and marked.

    Attributes
    ----------
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Pose of every limb's frame.
    joint_positions : ndarray, shape (n_frames, n_joints, 3), mm
        World positions, columns in the order of the skeleton's joints.
    marker_positions : ndarray, shape (n_frames, n_markers, 3), mm
        Markers reconstructed from the skeleton; NaN for markers that are left out.
    residuals : ndarray, shape (n_frames, n_markers), mm
        Distance between measured and reconstructed position; NaN where unseen or left out.
    limb_seen : ndarray of bool, shape (n_frames, n_limbs)
        Whether markers seen in the frame fix the limb's rotation; False where it is interpolated in time.
    rate : float, Hz
        Frame rate.
    joint_std : ndarray, shape (n_frames, n_joints, 3), mm, or None
        Standard deviations of the joints' positions along the world's axes; of hinges across their axes, unless what is
        known of any body tells their places along them; None where nothing was estimated.
    compute_angles : callable (motion) -> tuple of JointAngles, or None
        Computes `joint_angles` when they are first asked for. It is not stored in project files.
    """

    world_from_limb: Floats
    joint_positions: Floats
    marker_positions: Floats
    residuals: Floats
    limb_seen: Bools
    rate: float
    joint_std: Floats | None = None
    compute_angles: Callable[[Motion], tuple[JointAngles, ...]] | None = field(
        default=None, repr=False, metadata={"is_stored": False}
    )

    def __post_init__(self) -> None:
        poses = check_floats(self.world_from_limb, (None, None, 4, 4), "world_from_limb", finite=True)
        n_frames, n_limbs = poses.shape[:2]
        check_fields(self, {"joint_positions": (n_frames, None, 3)}, finite=True)
        check_fields(self, {"marker_positions": (n_frames, None, 3)})
        check_fields(self, {"residuals": (n_frames, self.marker_positions.shape[1])})
        check_fields(self, {"joint_std": self.joint_positions.shape}, finite=True)
        seen = check_bools(self.limb_seen, (n_frames, n_limbs), "limb_seen")
        set_fields(self, world_from_limb=poses, limb_seen=seen, rate=float(self.rate))

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.limb_seen)

    @property
    def interpolated(self) -> Bools:
        """Whether a limb's rotation is interpolated in a frame, as others show it, shape (n_frames, n_limbs)."""
        return ~self.limb_seen & self.limb_seen.any(axis=0)

    @property
    def never_seen(self) -> Ints:
        """Indices of the limbs whose markers tell all of their rotation in no frame."""
        return np.flatnonzero(~self.limb_seen.any(axis=0))

    @property
    def times(self) -> Floats:
        """Time of each frame [s] from the first, shape (n_frames,)."""
        return np.arange(self.n_frames) / self.rate

    @cached_property
    def joint_angles(self) -> tuple[JointAngles, ...]:
        """Angles of every joint with standard deviations, in the order of the skeleton's joints.

        Raises
        ------
        MissingResultError
            If the motion does not come from a skeleton that was fitted or read.
        """
        if self.compute_angles is None:
            raise MissingResultError("this motion has no joint angles; take the motion of a project with a skeleton")
        return self.compute_angles(self)

    @property
    def rotations(self) -> NDArray[np.float64]:
        """Rotation matrices world from limb, shape (n_frames, n_limbs, 3, 3)."""
        return self.world_from_limb[:, :, :3, :3]
