"""One body from mean limbs to a calibrated chain with its poses in all frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.orientation import Rotator
from skelgen.geometry.rotations import nearest_rotation
from skelgen.kinematics.calibration.calibrate import Calibration, calibrate
from skelgen.kinematics.calibration.closed_loops import ClosedCalibration
from skelgen.kinematics.calibration.limb_errors import LimbErrors
from skelgen.kinematics.chain.chain import Chain, ChainPoses, residuals, seen_weights
from skelgen.kinematics.inverse.poses import fit_poses
from skelgen.kinematics.inverse.root_outward import pose_outward
from skelgen.kinematics.joints.joint_type import JointKind, KindLimits
from skelgen.kinematics.soft_tissue.fit import calibrate_soft_tissue, fit_soft_tissue
from skelgen.kinematics.soft_tissue.model import SoftTissue
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.skeleton.assembly import Body, assemble
from skelgen.stages.skeleton.joints import (
    articulation_of,
    axis_freedom,
    errors_of_limbs,
    find_kinds,
    joint_deviations,
    lasting,
    shifted,
    shifts_along_axes,
    with_axes,
    with_noise_of_poses,
)
from skelgen.stages.skeleton.loops import FOUND, BodyRings, closed_body
from skelgen.stages.skeleton.parameters import SkeletonParameters
from skelgen.stages.skeleton.posing import out_of_line, posed_with_care, without_outliers

FIRST_ROUNDS = 3
"""Rounds of the fit with free joints: it need only be near enough for the kinds to be told."""

LEAST_FRAMES = 30
"""Limbs and joints are estimated from the best quarter of all frames, and from no fewer than these."""


TURN_FRAMES = 20
"""Frames over which the skeleton's part in the errors of turns is averaged: it hardly changes with the pose."""


@dataclass(frozen=True, eq=False)
class FittedBody:
    """A body with everything that is known of it.

    Attributes
    ----------
    body : Body
        What was fitted.
    chain : Chain
        Rigid limbs; their frames have the world's orientation in the reference frame.
    poses : ChainPoses
        All frames.
    seen : ndarray of bool, shape (n_frames, n_limbs)
        Whether rotations rest on markers of the frame.
    outliers : ndarray of bool, shape (n_frames, n_markers)
        Positions that were left out because they cannot belong to their marker.
    kinds : list of JointKind
        Of the joints above limbs 1, 2, ...
    errors : LimbErrors
        Errors of limbs and joints, in frames of the limbs that `turn` brings to those of the chain.
    turn : ndarray, shape (n_limbs, 3, 3)
        Chain's frames from those of the errors.
    turn_covariances : ndarray, shape (n_limbs, 3, 3), rad^2
        Of limbs against their parents, in the parents' axes: what the errors make in every frame.
    reference : int
        Reference frame.
    deviations : ndarray, shape (n_frames, n_limbs, 3), mm
        Of the joints in the world, of hinges across their axes.
    growth : float
        How many frames of residuals tell as much as one that is independent.
    noise : float, mm
        Standard deviation of a coordinate.
    rings : BodyRings, optional
        Rings that were closed.
    skin : SoftTissue, optional
        How markers slide on the limbs, if they do.
    """

    body: Body
    chain: Chain
    poses: ChainPoses
    seen: Bools
    outliers: Bools
    kinds: list[JointKind]
    errors: LimbErrors
    turn: Floats
    turn_covariances: Floats
    reference: int
    deviations: Floats
    growth: float
    noise: float
    rings: BodyRings | None = None
    skin: SoftTissue | None = None


def fit_body(
    body: Body, parameters: SkeletonParameters, rotator: Rotator, are_poses: bool = False, rings: Ints | None = None
) -> FittedBody:
    """Fit one tree of limbs to its markers.

    Parameters
    ----------
    body : Body
        The tree with its markers and raw joints.
    parameters : SkeletonParameters
        How.
    rotator : callable
        Closed form of absolute orientation.
    are_poses : bool
        Whether the markers stand for bodies with orientation.
    rings : ndarray of intp, shape (n_rings, 2), optional
        Limbs that meet beyond the tree, by position in the body; the whole chain is fitted with them closed.
    """
    chain, reference = assemble(body, parameters, rotator, _well_seen_frames(body, parameters.samples))
    trusted, start, posed = without_outliers(body, chain, parameters, rotator)
    frames = _determined_frames(posed, parameters.samples)
    wanted = _wanted_kinds(parameters, body)
    first, kinds = _first_fit(chain, start[frames], trusted[frames], posed[frames], parameters, wanted, are_poses)
    poses, seen = pose_outward(first.chain, trusted, body.raw_joints, rotator=rotator, flatness=parameters.flatness)
    found = _Fit(first, kinds, poses, trusted, frames, lasting(first, trusted[frames]))
    if parameters.fit == "whole-chain":
        found = _whole_fit(found, set(wanted), parameters, are_poses, rings)
    freedom = axis_freedom(found.kinds, found.last.noise)
    shifts = shifts_along_axes(found.last.chain, found.kinds, freedom)
    chain = shifted(found.last.chain, found.kinds, shifts)
    closed, poses = found.closed, found.poses
    if parameters.fit == "whole-chain":
        closed = None if closed is None else closed.shifted(found.kinds, shifts)
        poses = posed_with_care(chain, closed, poses, found.trusted, found.last.articulation, seen)
    errors = errors_of_limbs(found.last, found.kinds, shifts, freedom, found.growth, parameters.rank_tolerance)
    if closed is not None and isinstance(found.last, ClosedCalibration):
        closed = closed.with_errors(errors, found.last, found.last.noise * np.sqrt(found.growth))
    shared = _spread(found.used, TURN_FRAMES)
    turn_covariances = errors.turns(poses[shared], found.trusted[shared])
    unseen = np.asarray(~seen.all(axis=1))
    deviations = joint_deviations(found.last, chain, poses, found.trusted, unseen, found.growth)
    chain, poses, turn = _with_reference_axes(chain, poses, reference)
    above = np.maximum(chain.parents, 0)
    return FittedBody(
        body=body,
        chain=chain,
        poses=poses,
        seen=seen,
        outliers=np.isnan(found.trusted[:, :, 0]) & ~np.isnan(body.positions[:, :, 0]),
        kinds=_in_other_frames(found.kinds, chain.parents, turn),
        errors=errors,
        turn=turn,
        turn_covariances=turn[above] @ turn_covariances @ turn[above].swapaxes(1, 2),
        reference=reference,
        deviations=deviations,
        growth=found.growth,
        noise=found.last.noise,
        rings=None if closed is None else closed.turned(turn),
        skin=None if found.skin is None else found.skin.turned(chain, turn),
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """A body while it is fitted: what is known, and the positions that it is fitted to.

    Attributes
    ----------
    last : Calibration
        The last fit.
    kinds : list of JointKind
        Of the joints above limbs 1, 2, ...
    poses : ChainPoses
        All frames.
    trusted : ndarray, shape (n_frames, n_markers, 3), mm
        Positions without outliers and slides.
    used : ndarray of intp
        Frames of the last fit.
    growth : float
        How many of these tell as much as one that is independent.
    closed : BodyRings, optional
        Rings that were closed.
    skin : SoftTissue, optional
        The slides.
    """

    last: Calibration
    kinds: list[JointKind]
    poses: ChainPoses
    trusted: Floats
    used: Ints
    growth: float
    closed: BodyRings | None = None
    skin: SoftTissue | None = None


def _first_fit(
    chain: Chain,
    start: ChainPoses,
    trusted: Floats,
    posed: Bools,
    parameters: SkeletonParameters,
    wanted: dict[int, str],
    are_poses: bool,
) -> tuple[Calibration, list[JointKind]]:
    """Fit some frames with free joints, and tell the kinds."""
    whole = parameters.fit == "whole-chain"
    first = calibrate(chain, start, trusted, n_rounds=FIRST_ROUNDS if whole else 0)
    if whole and not are_poses:
        first = _robust(first, parameters, FIRST_ROUNDS)
        trusted = first.positions
    if are_poses:
        first = with_noise_of_poses(first, trusted)
    limits = KindLimits(parameters.kind_doubt, parameters.hinge_wobble, parameters.least_turn)
    return first, find_kinds(first.chain, first.poses, trusted, posed, first.noise, wanted, limits, are_poses)


def _whole_fit(
    first: _Fit, known: set[int], parameters: SkeletonParameters, are_poses: bool, rings: Ints | None
) -> _Fit:
    """Fit as many frames as count, joints held to their kinds, soft tissue and rings heeded."""
    trusted = first.trusted
    last, poses, kinds = _refined(first.last, first.poses, trusted, first.kinds, known, parameters.refine_samples)
    used = _frames_of_refinement(trusted, parameters.refine_samples)
    if are_poses:
        last = with_noise_of_poses(last, trusted)
    else:
        before, last = last.poses, _robust(last, parameters, None)
        kinds, poses = _followed(kinds, last, before), _posed_as(last, poses, used)
        trusted = trusted.copy()
        trusted[used] = last.positions
    growth, skin = lasting(last, trusted[used]), None
    if parameters.soft_tissue and not are_poses:
        before = poses[used]
        last, poses, trusted, growth, skin = _without_slides(last, poses, trusted, used, growth)
        kinds = _followed(kinds, last, before)
    if rings is None or not len(rings):
        return _Fit(last, kinds, poses, trusted, used, growth, skin=skin)
    last, poses, closed = closed_body(last, poses, used, rings, parameters.loops.strip() != FOUND)
    kinds = with_axes(kinds, last.articulation)
    return _Fit(last, kinds, poses, trusted, used, lasting(last, trusted[used]), closed, skin)


def _robust(fit: Calibration, parameters: SkeletonParameters, n_rounds: int | None) -> Calibration:
    """The fit without outliers; itself if there are none."""
    outliers = out_of_line(fit.chain, fit.articulation, fit.poses, fit.positions, parameters.robust)
    if not outliers.any():
        return fit
    positions = np.where(outliers[..., np.newaxis], np.nan, fit.positions)
    return calibrate(fit.chain, fit.poses, positions, n_rounds, fit.articulation)


def _refined(
    first: Calibration, start: ChainPoses, trusted: Floats, kinds: list[JointKind], known: set[int], samples: int
) -> tuple[Calibration, ChainPoses, list[JointKind]]:
    """Fit once more with joints that turn as their kinds allow, and with as many frames as count."""
    articulation = articulation_of(kinds, known)
    frames = _frames_of_refinement(trusted, samples)
    weights = seen_weights(trusted[frames])
    last = calibrate(first.chain, start[frames], trusted[frames], None, articulation, weights)
    return last, _posed_as(last, start, frames), _followed(kinds, last, start[frames])


def _posed_as(last: Calibration, poses: ChainPoses, frames: Ints) -> ChainPoses:
    """Poses of all frames that obey the joints of a fit to some; in these they are its own."""
    rotations = last.articulation.projected(last.chain.parents, poses.rotations)
    root = poses.root.copy()
    root[frames], rotations[frames] = last.poses.root, last.poses.rotations
    return ChainPoses(root, rotations)


def _followed(kinds: list[JointKind], last: Calibration, before: ChainPoses) -> list[JointKind]:
    """Kinds with the axes that were fitted, and with the others in the frames that limbs have now."""
    after, earlier = (one.rotations.swapaxes(0, 1).reshape(last.chain.n_limbs, -1, 3) for one in (last.poses, before))
    turn = nearest_rotation(after.swapaxes(1, 2) @ earlier)  # sums over frames
    return with_axes(_in_other_frames(kinds, last.chain.parents, turn), last.articulation)


def _without_slides(
    last: Calibration, poses: ChainPoses, trusted: Floats, used: Ints, growth: float
) -> tuple[Calibration, ChainPoses, Floats, float, SoftTissue | None]:
    """Fit once more to positions without the slides of soft tissue, if there are any; also return these positions.

    Slides have unknowns of their own, so they explain the markers better, or their fit has gone astray and is dropped.
    """
    sliding = fit_soft_tissue(last)
    if sliding is None:
        return last, poses, trusted, growth, None
    before, chain, articulation = poses, sliding.chain, sliding.articulation
    poses = ChainPoses(poses.root, articulation.projected(chain.parents, poses.rotations))
    poses = fit_poses(chain, poses, trusted - sliding.tissue.displacements(chain, poses), articulation)
    settled = calibrate_soft_tissue(sliding, poses[used], trusted[used])
    if not _squares(settled.calibration) < _squares(last):
        return last, before, trusted, growth, None
    last = settled.calibration
    poses = ChainPoses(poses.root, last.articulation.projected(chain.parents, poses.rotations))
    return last, poses, trusted - settled.tissue.displacements(last.chain, poses), settled.growth, settled.tissue


def _squares(fit: Calibration) -> float:
    """Sum of the squared residuals [mm^2] of the frames of a fit."""
    return float((residuals(fit.chain, fit.poses, fit.positions) ** 2).sum())


def _in_other_frames(kinds: list[JointKind], parents: Ints, turn: Floats) -> list[JointKind]:
    """Kinds for limbs whose frames were turned: nothing holds the frame of a limb while it is fitted."""
    return [kind.with_frames(turn[parents[limb]], turn[limb]) for limb, kind in enumerate(kinds, start=1)]


def _frames_of_refinement(trusted: Floats, samples: int) -> Ints:
    return _spread(np.flatnonzero((~np.isnan(trusted[:, :, 0])).any(axis=1)), samples)


def _wanted_kinds(parameters: SkeletonParameters, body: Body) -> dict[int, str]:
    """Kinds that the user knows, by position of the limb in the body."""
    return {limb: kind for limb, one in enumerate(body.limbs) if (kind := parameters.wanted_kind(int(one)))}


def _well_seen_frames(body: Body, samples: int) -> Ints:
    """Evenly spread frames among those that show at least as many markers as half of all frames do."""
    count = (~np.isnan(body.positions[:, :, 0])).sum(axis=1)
    good = np.flatnonzero(count >= max(np.median(count), 1))
    return _spread(good, samples)


def _determined_frames(posed: Bools, samples: int) -> Ints:
    """Evenly spread frames among those in which the most limbs are fixed by their own points."""
    doubtful = (~posed).sum(axis=1)
    wanted = min(len(doubtful), max(LEAST_FRAMES, len(doubtful) // 4))
    good = np.flatnonzero(doubtful <= np.partition(doubtful, wanted - 1)[wanted - 1])
    return _spread(good, samples)


def _spread(frames: Ints, samples: int) -> Ints:
    return frames[np.unique(np.linspace(0, len(frames) - 1, min(samples, len(frames))).astype(np.intp))]


def _with_reference_axes(chain: Chain, poses: ChainPoses, reference: int) -> tuple[Chain, ChainPoses, Floats]:
    """Turn every limb's frame so that it has the world's axes in the reference frame; also return the turns."""
    turn = poses.rotations[reference].copy()
    offsets = np.einsum("mij,mj->mi", turn[chain.limb_of_marker], chain.offsets)
    joints = np.einsum("lij,lj->li", turn[np.maximum(chain.parents, 0)], chain.joints)
    return chain.moved(joints, offsets), ChainPoses(poses.root, poses.rotations @ turn.swapaxes(1, 2)), turn
