r"""Joints of bodies seen through soft tissue: what motion says and what is known of any body.

Soft tissue that moves as limbs turn displaces the joint that is found, most along the axis about which the limbs turn
most: by up to half a metre. But joints lie near their limbs, and mostly near a marker of the limb that is nearer to the
root, as people place markers at joints. Let D be the distance between the middles of both limbs' markers, m and
c the two of them that are nearest to the other limb's, and :math:`v_1, v_2, v_3` the axes of the limbs' turns, the
largest first. A joint p is expected at :math:`q = m + w (c - m)`:

.. math::
    \frac{\sum \|residuals\|^2}{\sigma^2} + \sum_{joints} \sum_{i=1}^3 \left(\frac{v_i (p - q)}{s_i D}\right)^2 + \ldots

Markers stick to one side of a limb, so :math:`s_1` is larger where limbs turn about one axis above all; there the
middles of both limbs' markers count as well, and the next joints of a row of limbs, as bones run across their hinges.

Where joints lie is learned from people: ``python tests/benchmarks/learn_joints.py`` measures it.

Errors that last average out over frames only as far as they change; the correlation time of the residuals says how many
frames are independent. Residuals show how the markers of a limb move against each other; together they move farther,
and that displaces joints. For a joint that motion places out of reach, all frames together count as a third of one
frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from skelgen.kinematics.calibration.calibrate import (
    FREE_SHARE,
    STEP_FRAMES,
    Calibration,
    FittedChain,
    information_of,
    level_of_tilts,
    turned_like,
)
from skelgen.kinematics.calibration.joint_places import (
    NO_TAIL,
    TOWARDS_CHILD,
    JointPlace,
    joint_places,
    out_of_reach,
    place_residuals,
    places,
    turns_of_frames,
)
from skelgen.kinematics.calibration.known_body import (
    TAIL,
    KnownBody,
    KnownLimb,
    body_residuals,
    joints_of_body,
    joints_of_limbs,
    known_limbs,
    with_joint_at,
)
from skelgen.kinematics.calibration.mirrored_halves import (
    InwardPlace,
    inward_places,
    inward_residuals,
    twin_residuals,
    twins,
)
from skelgen.kinematics.chain.chain import Chain, ObservedChain
from skelgen.kinematics.chain.normal_equations import constant_gradient
from skelgen.kinematics.inverse.poses import fit_poses
from skelgen.model.arrays import Floats, Ints, spread_frames

ENOUGH_LIMBS = 6
"""Bodies with so many limbs are taken for animals or people; smaller ones may be machines, which need no prior."""

FARTHEST = 10.0
"""Of D: standard deviation of a hinge's shift along its axis; the place where it is expected counts far more."""

PRIOR_FRAMES = 150
"""Frames to which joints are fitted together with the prior: more frames say little more."""

HELD = 1e3
"""Times the mean information: weight with which the frames of limbs are held during a step."""

LASTING = 2.0
"""Errors last, as of soft tissue, if more frames than this are worth one independent frame."""

TOGETHER = 10.0
"""Variance of errors that markers of a limb share, in units of that of the residuals, which show none of them. They
last as long. Of 3, 6, 10 and 15 joints of simulated people are best with 10 (by 5, 1 and 2 %), given their limbs."""

FOLLOWING = 3.0
"""Variance of errors of a joint that motion places out of reach, in units of that of the residuals; they follow the
motion and do not average out over frames."""

MOST, MOST_OF_BUILD = 2.0, 5.0
"""Largest factor by which the prior may raise the sum of squared residuals: beyond it, data contradict the prior.
It is larger for a body of known build: limbs of two markers fit wrong joints as well as right ones."""

ROUNDS = 40
REMEMBERED = 8
"""Past steps from which the curvature of the sum is estimated."""

LEAST_DAMPING, FIRST_DAMPING, MOST_DAMPING = 1e-9, 1e-6, 1.0
"""Dampings (Levenberg and Marquardt)."""

GROWTH, LEAST_FALL = 8.0, 0.1
"""Factors on the damping: by the first after a step that fails, by its square after the next, and so on; by the second
at least after one that gains as much as is expected (Nielsen 1999, *Damping parameter in Marquardt's method*)."""

LEAST_GAIN = 0.01
"""Rounds stop when the sum falls by less than this part of the weight: joints would move by a tenth of a deviation."""


def wants_joint_prior(fit: Calibration, correlated: float) -> bool:
    """Return whether residuals last, as soft tissue makes them, and limbs are many or a joint is out of reach.

    Parameters
    ----------
    fit : Calibration
        The fit.
    correlated : float
        How many of its frames are worth one independent frame.
    """
    return correlated > LASTING and (fit.chain.n_limbs >= ENOUGH_LIMBS or bool(out_of_reach(fit)))


def with_joint_prior(
    last: Calibration,
    correlated: float,
    astray: Sequence[int] = (),
    *,
    others: bool = True,
    body: KnownBody | None = None,
    segments: Mapping[int, str] | None = None,
) -> tuple[Calibration, float]:
    """Fit the joints to the motion and to the prior together.

    The information of the fit counts both, if `others` is true.

    Parameters
    ----------
    last : Calibration
        The fit.
    correlated : float
        How many of its frames are worth one independent frame.
    astray : sequence of int
        Limbs below the joints that motion alone places out of reach, from `out_of_reach`.
    others : bool
        Whether the prior acts on the other joints as well.
    body : KnownBody, optional
        Build of this body, known from the marker set that it wears.
    segments : mapping of int to str, optional
        Segment of a person that each of these limbs is.

    Returns
    -------
    tuple of Calibration and float
        The fit, and how many frames determine as much as one independent frame, if errors that markers of a limb share
        are counted.
    """
    some = last.at(spread_frames(last.n_frames, PRIOR_FRAMES))
    shared = TOGETHER * max(1 - LASTING / correlated, 0.0)
    weight = last.noise**2 * (1 + shared) * correlated * some.n_frames / last.n_frames
    following = max(FOLLOWING * last.n_frames / ((1 + shared) * correlated), 1.0)
    limbs = known_limbs(last.chain, body) if body is not None and others else []
    known = _known(some, dict.fromkeys(astray, following), limbs, segments or {}, others=others)
    guess = _along_hinges(joints_of_body(_drawn_back(some, known.joints), limbs), known)
    state = _converged(_Weighed(FittedChain.of(guess), known, weight))
    chain, articulation = state.fit.chain, state.fit.articulation
    start = turned_like(state.fit, last.poses, some)
    poses = fit_poses(chain, start, last.positions, articulation, last.weights)
    better = replace(last, chain=chain, articulation=articulation, poses=poses)
    if not others:
        return better, correlated
    if better.squares > (MOST_OF_BUILD if limbs else MOST) * last.squares:
        better = replace(last, chain=_along_hinges(last, known).chain)
    # Soft tissue that was fitted counts what markers share already
    growth = correlated * (1.0 if last.known_information is not None else 1 + shared)
    return _with_information(better, known, growth), growth


@dataclass(frozen=True, eq=False)
class _Known:
    """The prior: joints of any body, limbs of known build, joints of a person, limbs and their mirror images."""

    joints: list[JointPlace]
    limbs: list[KnownLimb]
    inward: list[InwardPlace]
    twin: Ints
    first: Chain

    def residuals(self, chain: Chain) -> tuple[Floats, Floats, Floats]:
        """Return the derivatives of the prior's residuals by `places`, the residuals in deviations, and their tails."""
        slopes, tails = self._of_joints
        more = body_residuals(chain, self.limbs), inward_residuals(chain, self.inward), twin_residuals(chain, self.twin)
        towards = np.concatenate([slopes @ places(chain).ravel(), *(off for _, off in more)])
        tails = np.concatenate([tails, np.full(len(towards) - len(tails), TAIL)])
        return np.concatenate([slopes, *(rows for rows, _ in more)]), towards, tails

    @cached_property
    def _of_joints(self) -> tuple[Floats, Floats]:
        return place_residuals(self.first, self.joints)


def _known(
    fit: ObservedChain,
    astray: Mapping[int, float],
    limbs: list[KnownLimb],
    segments: Mapping[int, str],
    *,
    others: bool,
) -> _Known:
    """Gather the prior; `astray` holds the weight of the expected place, by limb, of joints that lie out of reach."""
    of_build = joints_of_limbs(fit.chain, limbs)
    every = joint_places(fit)
    twin = twins(fit.chain, every)
    inward = inward_places(fit, every, twin, segments)
    return _Known(
        [
            replace(one, tail=NO_TAIL, weight=astray[one.limb], is_astray=True) if one.limb in astray else one
            for one in every
            if one.limb not in of_build and (others or one.limb in astray)
        ],
        limbs,
        [one for one in inward if one.place.limb not in of_build],
        twin if others else np.full(fit.chain.n_limbs, -1),
        fit.chain,
    )


def _with_information(fit: Calibration, known: _Known, growth: float) -> Calibration:
    """Add the information of the prior to that of the fit."""
    alike = replace(known, joints=[replace(one, weight=1.0) for one in known.joints])
    slopes, towards, tails = alike.residuals(fit.chain)
    follow, seem = turns_of_frames(fit.chain)
    slopes -= slopes @ follow @ seem
    information = fit.information.copy()
    kept = slopes.T / (1 + (towards / tails) ** 2)
    information[: len(kept), : len(kept)] += growth * fit.noise**2 * kept @ slopes
    return replace(fit, known_information=information)


def _drawn_back(fit: ObservedChain, known: list[JointPlace]) -> ObservedChain:
    """Move joints that lie out of reach to where they are expected."""
    markers = fit.poses.markers(fit.chain)
    for joint in known:
        if joint.is_astray:
            first, last = (markers[:, one] for one in joint.nearest)
            fit = replace(fit, chain=with_joint_at(fit, joint.limb, first + TOWARDS_CHILD * (last - first)))
    return fit


def _along_hinges(fit: ObservedChain, known: _Known) -> ObservedChain:
    """Move hinges along their axes to where they are expected: residuals do not determine that."""
    chain, articulation = fit.chain, fit.articulation
    size_of = {one.limb: one.distance for one in known.joints if articulation.types[one.limb] == "hinge"}
    hinges = list(size_of)
    if not hinges:
        return fit
    moves = np.zeros((len(hinges), chain.n_markers + chain.n_limbs, 3))
    for move, limb in zip(moves, hinges, strict=True):
        in_parent = articulation.in_parent[limb]
        in_child = fit.poses.rotations[0, limb].T @ fit.poses.rotations[0, chain.parents[limb]] @ in_parent
        move[chain.n_markers + limb] = in_parent
        move[np.concatenate([chain.limb_of_marker, chain.parents]) == limb] = -in_child
    flat = np.delete(moves, chain.n_markers, axis=1).reshape(len(hinges), -1)
    # Lengths are not linear in such moves, and joints that are far off would move those beside them
    slopes, towards, _ = replace(known, twin=np.full(chain.n_limbs, -1)).residuals(chain)
    held = np.diag([1 / (FARTHEST * size) for size in size_of.values()])  # where hardly anything is expected of them
    left = np.concatenate([-towards, np.zeros(len(hinges))])
    shifts = np.linalg.lstsq(np.concatenate([slopes @ flat.T, held]), left, rcond=None)[0]
    offsets, joints = np.split(shifts @ flat, [3 * chain.n_markers])
    return fit.stepped(offsets, joints, np.zeros(articulation.n_constants))


@dataclass(frozen=True, eq=False)
class _Weighed:
    """A fit and the prior; what does not depend on the damping of a step is computed once.

    Attributes
    ----------
    fitted : FittedChain
        The fit.
    known : _Known
        What is known.
    weight : float, mm^2
        Weight of one squared standard deviation of the prior beside squared residuals.
    """

    fitted: FittedChain
    known: _Known
    weight: float

    @cached_property
    def _residuals(self) -> tuple[Floats, Floats, Floats]:
        return self.known.residuals(self.fitted.fit.chain)

    @cached_property
    def total(self) -> float:
        """Sum of the squared residuals and of those of the prior, whose large ones count less (Cauchy)."""
        _, towards, tails = self._residuals
        return self.fitted.squares + self.weight * float((tails**2 * np.log1p((towards / tails) ** 2)).sum())

    @cached_property
    def _equations(self) -> tuple[Floats, Floats, Floats]:
        """Normal matrix and gradient of the constants, and the least prior on the matrix' diagonal."""
        fit, chain = self.fitted.fit, self.fitted.fit.chain
        n_places = 3 * (chain.n_markers + chain.n_limbs - 1)
        information = information_of(fit, STEP_FRAMES)
        usual = float(np.diag(information)[:n_places].mean())
        free = np.full(len(information), FREE_SHARE * usual)
        free[n_places:] *= level_of_tilts(chain)
        slopes, towards, tails = self._residuals
        follow, seem = turns_of_frames(chain)
        slopes = slopes - slopes @ follow @ seem
        kept = 1 / (1 + (towards / tails) ** 2)
        # Directions that no frame determines are filtered out of the residuals' gradient: it is not exactly 0 there
        gradient = information @ np.linalg.solve(information + np.diag(free), constant_gradient(fit))
        gradient[:n_places] -= self.weight * (slopes.T @ (kept * towards))
        matrix = information + np.diag(free)
        matrix[:n_places, :n_places] += (
            self.weight * (kept * slopes.T) @ slopes + HELD * level_of_tilts(chain) * usual * seem.T @ seem
        )
        return matrix, gradient, free

    @cached_property
    def gradient(self) -> Floats:
        """Gradient of minus half the sum by the constants, shape (n_constants,)."""
        return self._equations[1]

    def solved(self, right: Floats, damping: float) -> Floats:
        """Solve the damped normal equations, without directions that neither data nor prior determine."""
        matrix, _, free = self._equations
        spoken = right - free * np.linalg.solve(matrix, right)
        return np.asarray(np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), spoken))

    def stepped(self, step: Floats) -> _Weighed:
        """Take a step of the constants."""
        fit = self.fitted.fit
        n_places = 3 * (fit.chain.n_markers + fit.chain.n_limbs - 1)
        offsets, joints, tilts = np.split(step, [3 * fit.chain.n_markers, n_places])
        return replace(self, fitted=FittedChain.of(fit.stepped(offsets, joints, tilts)))


def _converged(state: _Weighed) -> FittedChain:
    """Step until the sum of the residuals' squares and of the prior's falls no more.

    What motion hardly determines is curved: there Gauss-Newton steps stop far from the minimum, and where they stop is
    chance. How the gradient changed over the last steps corrects them (L-BFGS, Nocedal and Wright 2006, *Numerical
    Optimization*, 7.2, with the normal equations for its first matrix).
    """
    damping, growth, past = FIRST_DAMPING, GROWTH, list[tuple[Floats, Floats]]()
    for _ in range(ROUNDS):
        step = _direction(state, past, damping)
        expected = float(step @ state.gradient)
        better = state.stepped(step)
        gain = state.total - better.total
        if gain > 0:
            past = [*past, (step, state.gradient - better.gradient)][-REMEMBERED:]
            state, growth = better, GROWTH
            share = gain / max(expected, gain)
            damping = max(damping * max(1 - (2 * share - 1) ** 3, LEAST_FALL), LEAST_DAMPING)
            if max(gain, expected) < LEAST_GAIN * state.weight:
                break
        elif past:
            past = []
        elif damping > MOST_DAMPING or expected < LEAST_GAIN * state.weight:
            break
        else:
            damping, growth = max(damping, FIRST_DAMPING) * growth, growth * GROWTH
    return state.fitted


def _direction(state: _Weighed, past: Sequence[tuple[Floats, Floats]], damping: float) -> Floats:
    """Return the step from the gradient, corrected by steps of the past and the changes of the gradient over them."""
    left, shares = state.gradient, []
    bent = [(step, change) for step, change in past if step @ change > 0]
    for step, change in reversed(bent):
        shares.append(float(step @ left) / float(step @ change))
        left = left - shares[-1] * change
    found = state.solved(left, damping)
    for (step, change), share in zip(bent, reversed(shares), strict=True):
        found = found + (share - float(change @ found) / float(step @ change)) * step
    return found
