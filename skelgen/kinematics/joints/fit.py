"""Joints between two bodies with poses, fitted: of a given type, or of the simplest type that explains the motion.

A closed form gives the first estimate, maximum likelihood refines it, and every estimate has a covariance.
"""

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import transform_from, vector_from_matrix
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.kinematics.chain.schur_complement import effective_frames, solve_bordered
from skelgen.kinematics.joints.closed_form import nearest_constrained
from skelgen.kinematics.joints.joint_model import (
    JointModel,
    conventional,
    covariance_of_constants,
    fit_joint_model,
    linearised,
)
from skelgen.kinematics.joints.joint_type import DETERMINED_TYPES, ROUNDING, JointType, TypeLimits, find_joint_type
from skelgen.kinematics.joints.relative_poses import MIN_FRAMES, RelativePoses, relative_poses, whitener
from skelgen.kinematics.joints.rotations import BallRotation, axis_covariance
from skelgen.model import Poses
from skelgen.model.arrays import Floats, Ints

UNKNOWN = 1000.0
"""mm; standard deviation of a position along directions that no frame determines: longer than any limb."""


FREEDOMS_OF_GAP = 3.0
"""Per frame: poses alone show their noise only by the gap between a ball joint's two images."""

VARIANCE_OF_THIRD = 20.0
"""Variance of third differences of independent numbers of variance 1: 1 + 9 + 9 + 1."""


@dataclass(frozen=True, eq=False)
class JointFit:
    """A joint of one type between two bodies.

    Attributes
    ----------
    kind : str
        ``ball``, ``hinge``, ``universal`` or ``rigid``.
    parent_from_joint, child_from_joint : ndarray, shape (4, 4)
        Frames of the joint in both bodies, translations in mm. Their z is the axis of a hinge, or the axis of a
        universal joint that is fixed in that body; their x points from the body's origin to the axis. Other types
        keep the bodies' directions.
    angles : ndarray, shape (n_frames, n_angles), rad
        Rotation of the child's joint frame in the parent's: about z of a hinge; about the parent's and the child's axis
        of a universal joint; the rotation vector (Rodrigues) of a ball; NaN where a body is unseen.
    angle_std : ndarray, shape (n_frames, n_angles), rad
        Their standard deviations; for a ball those of small rotations about the parent's axes.
    between : float, rad
        Angle between the axes of a universal joint; 0 for other types.
    covariance : ndarray, shape (6, 6), mm^2
        Of the joint's position in the parent, then in the child. Along the axis of a hinge the position is a choice
        (nearest to both bodies' origins) without variance, and so is the position of a rigid joint in the child.
    axis_covariance : ndarray, shape (6, 6)
        Of the axis in the parent, then of that in the child, unit vectors; 0 for types without axes.
    singular_values : ndarray, shape (6,)
        Of the stacked equations of the position, falling, per root of the number of frames; near 0 without rotation.
    noise : float
        Root mean square of the residuals in units of the given covariances, or in mm without any; freedoms taken off.
    gap : float, mm
        Root mean square distance of the two images of the joint.
    frames : ndarray of intp, shape (n,)
        Frames that show both bodies.
    n_effective : float
        Number of independent frames, by which the covariances count.
    """

    kind: str
    parent_from_joint: Floats
    child_from_joint: Floats
    angles: Floats
    angle_std: Floats
    between: float
    covariance: Floats
    axis_covariance: Floats
    singular_values: Floats
    noise: float
    gap: float
    frames: Ints
    n_effective: float

    @property
    def in_parent(self) -> Floats:
        """The joint in the parent's frame [mm], shape (3,)."""
        return self.parent_from_joint[:3, 3]

    @property
    def in_child(self) -> Floats:
        """The joint in the child's frame [mm], shape (3,)."""
        return self.child_from_joint[:3, 3]

    @property
    def axis_in_parent(self) -> Floats | None:
        """Axis that is fixed in the parent, shape (3,); None for types without axes."""
        return self.parent_from_joint[:3, 2] if self.kind in {"hinge", "universal"} else None

    @property
    def axis_in_child(self) -> Floats | None:
        """Axis that is fixed in the child, shape (3,); that of a hinge is the parent's, seen from the child."""
        return self.child_from_joint[:3, 2] if self.kind in {"hinge", "universal"} else None

    @property
    def std(self) -> Floats:
        """Standard deviation [mm] of the joint in the parent's and in the child's frame, shape (2, 3)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).reshape(2, 3)


def fit_joint(
    kind: str,
    poses: Poses,
    parent: int | str,
    child: int | str,
    covariances: Floats | None = None,
    size: float | None = None,
) -> JointFit:
    """Fit a joint of one type between two bodies.

    A ball joint is the point that is fixed in both: linear least squares by singular value decomposition (O'Brien 2000,
    eq. 8-13), then maximum likelihood with a free rotation in every frame (Gaschler 2011, eq. 5.5). A hinge has an axis
    and angles beside, from the solution of rank 5 and the null vector; a universal joint two axes that meet, one fixed
    in each body; a rigid connection one relative pose for all frames.

    Parameters
    ----------
    kind : str
        ``ball``, ``hinge``, ``universal`` or ``rigid``.
    poses : Poses
        Bodies with orientation.
    parent, child : int or str
        Two of them, by index or name.
    covariances : ndarray, shape (n_bodies, 6, 6) or (n_frames, n_bodies, 6, 6), optional
        Of translation [mm] and rotation [rad] of every body in its own frame, e.g. from `pose_covariance`.
    size : float, mm, optional
        Without covariances: distance of the points that represent a body, which weighs errors of its rotation against
        those of its position; by default from the changes between neighbouring frames.

    Raises
    ------
    InputError
        If there is no such type or body, or too few frames show both.
    """
    _check_type(kind)
    return fit_joint_type(kind, relative_poses(poses, parent, child, covariances, size))


def _check_type(kind: str) -> None:
    if kind not in DETERMINED_TYPES:
        raise InputError(f"there is no joint of type {kind!r}; types are {', '.join(DETERMINED_TYPES)}")


def fit_joint_type(kind: str, measured: RelativePoses, start: Floats | None = None) -> JointFit:
    """Fit a joint of one type to relative poses.

    Parameters
    ----------
    kind : str
        One of `JOINT_TYPES`.
    measured : RelativePoses
        From `relative_poses`.
    start : ndarray, shape (6,), mm, optional
        Where the search for the joint's position in the parent and in the child begins; by default at the closed form.
        Along directions that the motion does not determine the joint stays there.
    """
    singular, place = linear_place(measured, rank=5 if kind == "hinge" else 6)
    found = fit_joint_model(_start(kind, measured, place if start is None else start), measured)
    joint = conventional(found.state)
    weight, n_frames = whitener(measured.covariances), len(measured.frames)
    solution = solve_bordered(linearised(joint, measured, weight))
    freedoms = 6 * n_frames - solution.rank - joint.rotation.n_angles * n_frames
    variance = found.squares / max(freedoms, 1)
    n_effective = effective_frames(solution.residuals)
    scale = max(variance, 1.0) if measured.is_scaled else variance
    covariance, gain = covariance_of_constants(joint, measured, weight, solution, scale)
    constants = scale * covariance
    if not measured.is_scaled:  # without covariances of the poses, by the frames' gradients (White 1980)
        steps = solution.scores @ gain
        constants = steps.T @ steps * n_frames / max(n_frames - 1, 1)
    constants = constants * n_frames / n_effective + UNKNOWN**2 * solution.unknown @ solution.unknown.T
    free = joint.free_places()
    n_places = free.shape[1]
    images = measured.shifts + measured.rotations @ joint.in_child - joint.in_parent
    angles, angle_std = _spread_over_take(joint, scale * solution.angle_covariance, measured)
    return JointFit(
        kind=kind,
        parent_from_joint=_frame(joint, "in_parent"),
        child_from_joint=_frame(joint, "in_child"),
        angles=angles,
        angle_std=angle_std,
        between=joint.rotation.between,
        covariance=free @ constants[:n_places, :n_places] @ free.T,
        axis_covariance=axis_covariance(joint.rotation, constants[n_places:, n_places:]),
        singular_values=singular,
        noise=float(np.sqrt(variance)),
        gap=float(np.sqrt((images**2).sum(axis=1).mean())),
        frames=measured.frames,
        n_effective=n_effective,
    )


def linear_place(measured: RelativePoses, rank: int = 6) -> tuple[Floats, Floats]:
    """Solve the stacked equations of the position by singular value decomposition (O'Brien 2000, eq. 13).

    Parameters
    ----------
    measured : RelativePoses
        Relative poses.
    rank : int
        Largest rank: 5 for a hinge. Directions that never rotated are left out in any case, so that the position stays
        near the origins of both bodies.

    Returns
    -------
    tuple of ndarray, shape (6,)
        Singular values per root of the number of frames, and the position in parent and child [mm].
    """
    n_frames = len(measured.frames)
    rows = np.concatenate([np.tile(np.eye(3), (n_frames, 1, 1)), -measured.rotations], axis=2).reshape(-1, 6)
    u, singular, vt = np.linalg.svd(rows, full_matrices=False)
    kept = singular > np.sqrt(np.finfo(np.float64).eps) * singular[0]
    kept[rank:] = False
    place = vt[kept].T @ ((u[:, kept].T @ measured.shifts.ravel()) / singular[kept])
    return singular / np.sqrt(n_frames), place


def _start(kind: str, measured: RelativePoses, place: Floats) -> JointModel:
    if kind == "ball":
        return JointModel(BallRotation(measured.rotations), place[:3], place[3:])
    rotation = nearest_constrained(kind, measured.rotations)
    if kind == "rigid":
        half = measured.shifts.mean(axis=0) / 2
        return JointModel(rotation, half, -rotation.in_parent.T @ half)
    return JointModel(rotation, place[:3], place[3:])


def _spread_over_take(joint: JointModel, covariance: Floats, measured: RelativePoses) -> tuple[Floats, Floats]:
    """Angles and their deviations in all frames of the take, NaN where not known."""
    angles, std = np.full((2, measured.n_frames, joint.rotation.n_angles), np.nan)
    angles[measured.frames] = joint.rotation.angles
    std[measured.frames] = np.sqrt(np.einsum("fii->fi", covariance))
    return angles, std


def _frame(joint: JointModel, where: str) -> Floats:
    turn = np.eye(3) if joint.rotation.axes() is None else getattr(joint.rotation, where)
    return transform_from(turn, getattr(joint, where))


@dataclass(frozen=True, eq=False)
class TypeChoice:
    """The type of a joint, and the evidence for it.

    Attributes
    ----------
    kind : str
        ``ball``, ``hinge``, ``universal``, ``rigid``, or ``undetermined``.
    fit : JointFit
        Fit of that type; of an undetermined joint, of the simplest type that explains what is seen.
    evidence : JointType
        How well each type that was tried explains the rotations.
    """

    kind: str
    fit: JointFit
    evidence: JointType

    @property
    def sentence(self) -> str:
        """What was found, in words."""
        turn = f"turns by {np.rad2deg(self.evidence.main_turn):.3g} deg"
        if self.kind == "undetermined":
            last = list(self.evidence.type_fits.values())[-1]
            hidden = f"noise could hide {np.rad2deg(last.hidden):.2g} deg"
            return f"not enough motion to tell the type of joint: it {turn}, and {hidden}"
        values = " ".join(f"{value:.2g}" for value in self.fit.singular_values)
        tried = ", ".join(
            f"{name} leaves {left.ratio:.3g} times the noise (limit {left.limit:.3g})"
            for name, left in self.evidence.type_fits.items()
        )
        return f"{self.kind}: {turn}" + (f"; {tried}" if tried else "") + f"; singular values {values}"


def choose_joint_type(
    poses: Poses,
    parent: int | str,
    child: int | str,
    covariances: Floats | None = None,
    size: float | None = None,
    *,
    wanted: str | None = None,
) -> TypeChoice:
    """Find the type of the joint between two bodies, and fit it.

    Parameters
    ----------
    poses, parent, child, covariances, size
        As for `fit_joint`.
    wanted : str, optional
        A type that is stated; it is fitted without question.

    Raises
    ------
    InputError
        If `wanted` is no type, there is no such body, or too few frames show both.

    Examples
    --------
    >>> import skelgen
    >>> truth = skelgen.simulate("human", n_frames=200).truth
    >>> poses = skelgen.Poses(truth.world_from_limb, truth.limb_names, truth.rate)
    >>> choose_joint_type(poses, "left thigh", "left shank").kind
    'hinge'
    """
    return choose_type(relative_poses(poses, parent, child, covariances, size), wanted)


def choose_type(
    measured: RelativePoses, wanted: str | None = None, limits: TypeLimits | None = None, start: Floats | None = None
) -> TypeChoice:
    """Find the type of the joint behind relative poses, and fit it.

    Parameters
    ----------
    measured : RelativePoses
        From `relative_poses`.
    wanted, limits
        As for `find_joint_type`.
    start : ndarray, shape (6,), mm, optional
        As for `fit_joint_type`.
    """
    if wanted is not None:
        _check_type(wanted)
    rotations, covariances = _refined_rotations(measured)
    evidence = find_joint_type(rotations, covariances, FREEDOMS_OF_GAP, limits, wanted)
    simplest = next(reversed(evidence.type_fits)) if evidence.kind == "undetermined" else evidence.kind
    return TypeChoice(evidence.kind, fit_joint_type(simplest, measured, start), evidence)


def _refined_rotations(measured: RelativePoses) -> tuple[Floats, Floats]:
    """Rotations refined by the positions, which a ball joint ties to them, with their covariances."""
    _, place = linear_place(measured)
    ball = fit_joint_model(JointModel(BallRotation(measured.rotations), place[:3], place[3:]), measured)
    solution = solve_bordered(linearised(ball.state, measured, whitener(measured.covariances)))
    n_frames = len(measured.frames)
    variance = ball.squares / max(3 * n_frames - solution.rank, 1)
    rotations = ball.state.rotation.rotations()
    if measured.is_scaled:
        return rotations, max(variance, 1.0) * solution.angle_covariance
    covariances = variance * solution.angle_covariance + ROUNDING**2 * np.eye(3)
    ratio = _frame_noise(measured) / np.einsum("fii->f", covariances).mean()
    return rotations, max(float(ratio), 1.0) * covariances


def _frame_noise(measured: RelativePoses) -> float:
    """Variance [rad^2] of errors that are independent between frames, all axes together.

    Third differences of smooth motion are almost 0; those of independent errors have 20 times their variance.
    """
    steps = vector_from_matrix(measured.rotations[:-1].swapaxes(1, 2) @ measured.rotations[1:])
    third = np.diff(steps[np.diff(measured.frames) == 1], n=2, axis=0)
    if len(third) < MIN_FRAMES:
        return 0.0
    return float(((SIGMA_OF_MEDIAN * np.median(np.abs(third), axis=0)) ** 2).sum() / VARIANCE_OF_THIRD)
