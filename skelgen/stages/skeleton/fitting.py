"""One body, from mean limbs to a calibrated chain with its poses in all frames.

A fit with free joints of some frames tells the types of the joints. With joints held to these, limbs, joints and poses
are fitted together, outliers left out; soft tissue and closed loops are fitted where the take or the user has them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import nearest_rotation
from skelgen.kinematics.calibration.calibrate import Calibration, calibrate
from skelgen.kinematics.calibration.closed_loops import ClosedCalibration
from skelgen.kinematics.calibration.joint_places import out_of_reach
from skelgen.kinematics.calibration.joint_prior import wants_joint_prior, with_joint_prior
from skelgen.kinematics.calibration.known_body import KnownBody, joints_of_limbs, known_limbs
from skelgen.kinematics.calibration.limb_errors import LimbErrors
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, observed
from skelgen.kinematics.inverse.root_outward import pose_outward
from skelgen.kinematics.joints.joint_type import JointType, TypeLimits
from skelgen.kinematics.soft_tissue.fit import calibrate_soft_tissue, fit_soft_tissue
from skelgen.kinematics.soft_tissue.model import SoftTissue
from skelgen.model.arrays import Bools, Floats, Ints, evenly_spread
from skelgen.stages.limbs import worn_body
from skelgen.stages.names import segments_by_shape
from skelgen.stages.skeleton import joints as body_joints
from skelgen.stages.skeleton.assembly import BodyOfTake, assemble
from skelgen.stages.skeleton.loops import FOUND, ClosedLoops, closed_body
from skelgen.stages.skeleton.parameters import SkeletonParameters
from skelgen.stages.skeleton.posing import ConstrainedChain, out_of_line, without_outliers

FIRST_ROUNDS = 3
"""Rounds of the fit with free joints: it need only be near enough to tell the types of the joints."""

ROUGH_ROUNDS = 6
"""Rounds of the fit that tells outliers from the others: the fit without them goes on from there."""

OVERLAPPING = 4.0
"""Frames that are worth an independent one: where it takes more of them, frames between would say the same again."""

LEAST_FRAMES = 30
"""Limbs and joints are estimated from the best quarter of all frames, and from no fewer than these."""

ROTATION_FRAMES = 20
"""Frames over which the skeleton's part in the errors of rotations is averaged: it hardly changes with the pose."""


@dataclass(frozen=True, eq=False)
class FittedBody:
    """A fitted body.

    Attributes
    ----------
    body : BodyOfTake
        What was fitted.
    chain : Chain
        Rigid limbs; their frames have the world's axes in the reference frame.
    poses : ChainPoses
        All frames.
    seen : ndarray of bool, shape (n_frames, n_limbs)
        Whether rotations rest on markers of the frame.
    outliers : ndarray of bool, shape (n_frames, n_markers)
        Positions that were left out because they cannot belong to their marker.
    types : list of JointType
        Of the joints above limbs 1, 2, ...
    errors : LimbErrors
        Errors of limbs and joints, in frames of the limbs that `chain_from_errors` brings to those of the chain.
    chain_from_errors : ndarray, shape (n_limbs, 3, 3)
        Rotations.
    rotation_covariances : ndarray, shape (n_limbs, 3, 3), rad^2
        Of limbs against their parents, in the parents' axes: what the errors make in every frame.
    reference : int
        Reference frame.
    deviations : ndarray, shape (n_frames, n_limbs, 3), mm
        Of the joints in the world, of hinges across their axes.
    noise : float, mm
        Standard deviation of a coordinate.
    loops : ClosedLoops, optional
        Loops that were closed.
    tissue : SoftTissue, optional
        How markers slide on the limbs, if they do.
    n_open : ndarray of intp, shape (n_limbs,), optional
        In how many directions motion alone leaves the joint above each limb open, see `joints.places_left_open`.
    by_marker_set : tuple of int
        Limbs below joints that the marker set places because motion alone does not determine them.
    """

    body: BodyOfTake
    chain: Chain
    poses: ChainPoses
    seen: Bools
    outliers: Bools
    types: list[JointType]
    errors: LimbErrors
    chain_from_errors: Floats
    rotation_covariances: Floats
    reference: int
    deviations: Floats
    noise: float
    loops: ClosedLoops | None = None
    tissue: SoftTissue | None = None
    n_open: Ints | None = None
    by_marker_set: tuple[int, ...] = ()

    @property
    def constrained(self) -> ConstrainedChain:
        """The chain with its joints and loops."""
        articulation = self.errors.articulation.turned(self.chain.parents, self.chain_from_errors)
        return ConstrainedChain(self.chain, articulation, None if self.loops is None else self.loops.joints)


def fit_body(body: BodyOfTake, parameters: SkeletonParameters, loops: Ints, are_poses: bool = False) -> FittedBody:
    """Fit one tree of limbs to its markers.

    Parameters
    ----------
    body : BodyOfTake
        The tree with its markers and raw joints.
    parameters : SkeletonParameters
        How.
    loops : ndarray of intp, shape (n_loops, 2)
        Limbs that meet beyond the tree, by position in the body; the whole chain is fitted with these loops closed.
    are_poses : bool
        Whether the markers stand for bodies with orientation.
    """
    # Evenly spread frames among those that show at least as many markers as half of all frames do
    count = (~np.isnan(body.positions[:, :, 0])).sum(axis=1)
    good = np.flatnonzero(count >= max(np.median(count), 1))
    chain, reference = assemble(body, parameters, evenly_spread(good, parameters.samples))
    found, seen, lasts = _fitted_chain(body, parameters, chain, loops, are_poses)
    last, types, poses = found.last, found.types, found.poses
    # What is known of joints places hinges along their axes, too, and its information says how well
    freedom = np.zeros(len(types) + 1) if lasts else body_joints.axis_freedom(types, last.noise)
    shifts = {} if lasts else body_joints.shifts_along_axes(last.chain, types, freedom)
    shifts = body_joints.harmless(shifts, last, types)
    chain, closed = body_joints.shifted(last.chain, types, shifts), found.loops
    if parameters.fit == "whole-chain":
        closed = None if closed is None else closed.shifted(types, shifts)
        held = ConstrainedChain(chain, last.articulation, None if closed is None else closed.joints)
        poses = held.fit_in_time(poses, found.inliers, seen)
    errors = found.errors or body_joints.errors_of_limbs(last, types, shifts, freedom, found.correlated)
    if closed is not None and isinstance(last, ClosedCalibration):
        closed = closed.with_errors(errors, last, last.noise * np.sqrt(found.correlated))
    shared = evenly_spread(found.used, ROTATION_FRAMES)
    covariances = errors.turns(poses[shared], found.inliers[shared])
    everywhere = observed(chain, last.articulation, poses, found.inliers)
    deviations = body_joints.joint_deviations(last, everywhere, np.asarray(~seen.all(axis=1)), found.correlated, lasts)
    chain, poses, rotation = _with_reference_axes(chain, poses, reference)
    above = rotation[np.maximum(chain.parents, 0)]
    return FittedBody(
        body=body,
        chain=chain,
        poses=poses,
        seen=seen,
        outliers=np.isnan(found.inliers[:, :, 0]) & ~np.isnan(body.positions[:, :, 0]),
        types=_in_other_frames(types, chain.parents, rotation),
        errors=errors,
        chain_from_errors=rotation,
        rotation_covariances=above @ covariances @ above.swapaxes(1, 2),
        reference=reference,
        deviations=deviations,
        noise=last.noise,
        loops=None if closed is None else closed.turned(rotation),
        tissue=None if found.tissue is None else found.tissue.turned(chain, rotation),
        n_open=found.n_open,
        by_marker_set=found.by_marker_set,
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """A body while it is fitted.

    Attributes
    ----------
    last : Calibration
        The last fit.
    types : list of JointType
        Of the joints above limbs 1, 2, ...
    poses : ChainPoses
        All frames.
    inliers : ndarray, shape (n_frames, n_markers, 3), mm
        Positions without outliers and slides.
    used : ndarray of intp
        Frames of the last fit.
    correlated : float
        How many of these are worth one independent frame.
    loops : ClosedLoops, optional
        Loops that were closed.
    tissue : SoftTissue, optional
        The slides.
    errors : LimbErrors, optional
        Errors of the last fit where no hinge is moved along its axis, if they are known.
    n_open : ndarray of intp, shape (n_limbs,), optional
        As in `FittedBody`.
    by_marker_set : tuple of int
        As in `FittedBody`.
    """

    last: Calibration
    types: list[JointType]
    poses: ChainPoses
    inliers: Floats
    used: Ints
    correlated: float
    loops: ClosedLoops | None = None
    tissue: SoftTissue | None = None
    errors: LimbErrors | None = None
    n_open: Ints | None = None
    by_marker_set: tuple[int, ...] = ()


def _fitted_chain(
    body: BodyOfTake, parameters: SkeletonParameters, chain: Chain, loops: Ints, are_poses: bool
) -> tuple[_Fit, Bools, bool]:
    """Fit a chain from assembled limbs; also return which rotations are fixed, and whether residuals last."""
    fitter = _Fitter(body, parameters, are_poses)
    found, seen = fitter.first(chain)
    if parameters.fit != "whole-chain":
        return found, seen, False
    found = fitter.whole(found)
    lasts = not are_poses and wants_joint_prior(found.last, found.correlated)
    astray = out_of_reach(found.last) if lasts else []
    if astray:
        found, astray = _within_reach(found, astray, others=False)
    found = fitter.without_slides(found)
    if lasts:
        worn = worn_body(body.positions, body.limb_of_marker) if parameters.known_build else None
        segments = segments_by_shape(found.last) if parameters.known_build else {}
        astray = sorted({*astray, *out_of_reach(found.last)})
        by_motion = found.last.known_information
        found, astray = _within_reach(found, astray, worn=worn, segments=segments)
        last = found.last
        placed = joints_of_limbs(last.chain, known_limbs(last.chain, worn)) if worn and worn.marker_set else set()
        still, fits = np.zeros(last.chain.n_limbs), (replace(last, known_information=by_motion), last)
        alone, errors = (body_joints.errors_of_limbs(fit, found.types, {}, still, found.correlated) for fit in fits)
        n_open, by_set = body_joints.places_left_open((alone, errors), found.types, astray, placed)
        found = replace(found, errors=errors, n_open=n_open, by_marker_set=by_set)
    return fitter.closed(found, loops), seen, lasts


class _Fitter:
    """The steps of the fit of one body, each from the result of the one before."""

    def __init__(self, body: BodyOfTake, parameters: SkeletonParameters, are_poses: bool) -> None:
        self._body, self._parameters, self._are_poses = body, parameters, are_poses
        stated = ((place, parameters.stated_type(limb)) for place, limb in enumerate(body.limbs.tolist()))
        self._stated = {place: kind for place, kind in stated if kind}

    def first(self, chain: Chain) -> tuple[_Fit, Bools]:
        """Fit some frames with free joints, and find their types; also return which rotations are fixed."""
        parameters = self._parameters
        inliers, start, fixed = without_outliers(self._body, chain, parameters)
        # Evenly spread frames among those in which the most limbs are fixed by their own points
        n_free = (~fixed).sum(axis=1)
        wanted = min(len(n_free), max(LEAST_FRAMES, len(n_free) // 4))
        good = np.flatnonzero(n_free <= np.partition(n_free, wanted - 1)[wanted - 1])
        frames = evenly_spread(good, parameters.samples)
        whole = parameters.fit == "whole-chain"
        fit = calibrate(chain, start[frames], inliers[frames], n_rounds=FIRST_ROUNDS if whole else 0)
        if self._are_poses:
            fit = body_joints.with_noise_of_poses(fit)
        elif whole and (kept := self._inliers(fit)) is not fit.positions:
            fit = calibrate(fit.chain, fit.poses, kept, FIRST_ROUNDS, fit.articulation)
        limits = TypeLimits(parameters.kind_doubt, parameters.hinge_wobble, parameters.least_turn)
        types = body_joints.find_joint_types(fit, fixed[frames], self._stated, limits, self._are_poses)
        rotator, flatness = parameters.rotator, parameters.flatness
        poses, seen = pose_outward(fit.chain, inliers, self._body.raw_joints, rotator=rotator, flatness=flatness)
        return _Fit(fit, types, poses, inliers, frames, body_joints.correlation_time(fit, inliers[frames])), seen

    def whole(self, first: _Fit) -> _Fit:
        """Fit limbs, joints and poses of some frames, joints held to their types, and of more frames if these say more.

        Errors that last, as of soft tissue, do not average out over more frames of the same time.
        """
        seen = np.flatnonzero((~np.isnan(first.inliers[:, :, 0])).any(axis=1))
        every = evenly_spread(seen, self._parameters.refine_samples)
        articulation = body_joints.articulation_of(first.types, set(self._stated))
        if self._are_poses:  # none is an outlier
            found = _refitted(replace(first, correlated=1.0), every, None, articulation)
            last = body_joints.with_noise_of_poses(found.last)
            return replace(found, last=last, correlated=body_joints.correlation_time(last, last.positions))
        some = evenly_spread(every, self._parameters.samples)
        found = _refitted(first, some, ROUGH_ROUNDS, articulation)
        found = _refitted(self._without_outliers(found, every), some)
        return found if found.correlated > OVERLAPPING else _refitted(replace(found, correlated=1.0), every)

    def _without_outliers(self, found: _Fit, frames: Ints) -> _Fit:
        """Leave outliers of some frames out, by a fit of their poses."""
        last, poses, inliers = found.last, found.poses, found.inliers.copy()
        fit = calibrate(last.chain, poses[frames], inliers[frames], 0, last.articulation)
        inliers[frames] = self._inliers(fit)
        return replace(found, poses=_posed_as(fit, poses, frames), inliers=inliers)

    def without_slides(self, found: _Fit) -> _Fit:
        """Fit once more to positions without the slides of soft tissue, if there are any.

        Slides have unknowns of their own: they explain the markers better, by more than they cost, or their fit has
        diverged and is dropped.
        """
        with_tissue = fit_soft_tissue(found.last) if self._parameters.soft_tissue and not self._are_poses else None
        if with_tissue is None:
            return found
        held, used = ConstrainedChain(with_tissue.chain, with_tissue.articulation), found.used
        poses = held.projected(found.poses)
        poses = held.fit(poses, found.inliers - with_tissue.tissue.displacements(held.chain, poses))
        refined = calibrate_soft_tissue(with_tissue, poses[used], found.inliers[used])
        last = refined.calibration
        if not last.squares + refined.cost < found.last.squares:
            return found
        poses = ConstrainedChain(last.chain, last.articulation).projected(poses)
        inliers = found.inliers - refined.tissue.displacements(last.chain, poses)
        types = _followed(found.types, last, found.poses[used])
        return _Fit(last, types, poses, inliers, used, refined.growth, tissue=refined.tissue)

    def closed(self, found: _Fit, loops: Ints) -> _Fit:
        """Close loops."""
        if not len(loops):
            return found
        are_stated = self._parameters.loops.strip() != FOUND
        last, poses, closed = closed_body(found.last, found.poses, found.used, loops, are_stated)
        types = body_joints.with_axes(found.types, last.articulation)
        correlated = body_joints.correlation_time(last, found.inliers[found.used])
        return replace(found, last=last, types=types, poses=poses, correlated=correlated, loops=closed, errors=None)

    def _inliers(self, fit: Calibration) -> Floats:
        """Positions of the fit's frames without outliers; its own if there are none."""
        held = ConstrainedChain(fit.chain, fit.articulation)
        outliers = out_of_line(held, fit.poses, fit.positions, self._parameters.robust)
        return np.where(outliers[..., np.newaxis], np.nan, fit.positions) if outliers.any() else fit.positions


def _refitted(found: _Fit, frames: Ints, n_rounds: int | None = None, articulation: Articulation | None = None) -> _Fit:
    """Fit some frames from where another fit has ended, with its articulation if none is given."""
    before, articulation = found.poses[frames], articulation or found.last.articulation
    positions, correlated = found.inliers[frames], found.correlated
    last = calibrate(found.last.chain, before, positions, n_rounds, articulation, correlated)
    types, poses = _followed(found.types, last, before), _posed_as(last, found.poses, frames)
    return _Fit(last, types, poses, found.inliers, frames, body_joints.correlation_time(last, positions))


def _within_reach(
    found: _Fit,
    astray: list[int],
    *,
    others: bool = True,
    worn: KnownBody | None = None,
    segments: Mapping[int, str] | None = None,
) -> tuple[_Fit, list[int]]:
    """Fit joints again with the prior of `joint_prior`: all of them, or only those that lie out of reach (`astray`).

    Joints that this fit moves out of reach count among these, too, and it is made again; also return all of them.
    """
    while True:
        last, growth = with_joint_prior(
            found.last, found.correlated, astray, others=others, body=worn, segments=segments
        )
        more = set(out_of_reach(last)).difference(astray)
        if not more:
            break
        astray = sorted(more.union(astray))
    types, poses = _followed(found.types, last, found.last.poses), _posed_as(last, found.poses, found.used)
    return replace(found, last=last, types=types, poses=poses, correlated=growth), astray


def _posed_as(last: Calibration, poses: ChainPoses, frames: Ints) -> ChainPoses:
    """Poses of all frames for the limbs and joints of a fit; in its own `frames` they are those of the fit."""
    rotation = _rotation_between(last.poses, poses[frames])
    rotations = last.articulation.projected(last.chain.parents, poses.rotations @ rotation.swapaxes(1, 2))
    root = poses.root.copy()
    root[frames], rotations[frames] = last.poses.root, last.poses.rotations
    return ChainPoses(root, rotations)


def _followed(types: list[JointType], last: Calibration, before: ChainPoses) -> list[JointType]:
    """Joint types for a new fit: its fitted axes, and all other axes rotated into the new frames of their limbs."""
    rotation = _rotation_between(last.poses, before)
    return body_joints.with_axes(_in_other_frames(types, last.chain.parents, rotation), last.articulation)


def _rotation_between(now: ChainPoses, before: ChainPoses) -> Floats:
    """Rotation of each limb's frame between two fits of the same frames, now from before, shape (n_limbs, 3, 3)."""
    after, earlier = (one.rotations.swapaxes(0, 1).reshape(one.rotations.shape[1], -1, 3) for one in (now, before))
    return nearest_rotation(after.swapaxes(1, 2) @ earlier)  # sums over frames


def _in_other_frames(types: list[JointType], parents: Ints, rotation: Floats) -> list[JointType]:
    """Rotate the axes of joint types with the frames of their limbs, which a fit may turn freely."""
    return [kind.with_frames(rotation[parents[limb]], rotation[limb]) for limb, kind in enumerate(types, start=1)]


def _with_reference_axes(chain: Chain, poses: ChainPoses, reference: int) -> tuple[Chain, ChainPoses, Floats]:
    """Rotate every limb's frame to the world's axes in the reference frame; also return the rotations."""
    rotation = poses.rotations[reference].copy()
    offsets = np.einsum("mij,mj->mi", rotation[chain.limb_of_marker], chain.offsets)
    joints = np.einsum("lij,lj->li", rotation[np.maximum(chain.parents, 0)], chain.joints)
    return chain.moved(joints, offsets), ChainPoses(poses.root, poses.rotations @ rotation.swapaxes(1, 2)), rotation
