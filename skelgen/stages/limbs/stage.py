"""Stage 2: group markers into rigid limbs.

Two markers on one limb keep their distance; two on different limbs do not. Rigid bodies are fitted to groups of markers
over jittered sample frames and compared (`rigid_clusters`, `merging`), or the standard deviations of all distances are
clustered (Schönauer 2007, 3.4; Kirk, O'Brien and Forsyth 2005).
"""

from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.standing import fixed_markers
from skelgen.geometry.statistics import PairDistances
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.progress import SILENT, Monitor, counted
from skelgen.stages.classic.spectral import affinities, aligned_count, greedy_clusters, spectral_clusters, spectrum
from skelgen.stages.limbs import distances as pair_distances
from skelgen.stages.limbs.bodies import (
    bodies_of_limbs,
    body_notices,
    find_bodies,
    held_by_none,
    kept_bodies,
    seen_together,
    with_stated_bodies,
)
from skelgen.stages.limbs.checks import limb_notices
from skelgen.stages.limbs.held_bodies import with_held_bodies
from skelgen.stages.limbs.membership import contrast, every_pair, memberships
from skelgen.stages.limbs.merging import Distances, majority, rigid_bodies, with_one_fixed
from skelgen.stages.limbs.parameters import LimbConstraints, LimbParameters, MarkerConstraints
from skelgen.stages.limbs.relative_motion import Movements
from skelgen.stages.limbs.revision import deformation, is_worn, pair_odds, plates, revised
from skelgen.stages.limbs.whole_people import bodies_of_people

HALF_WEIGHT = 20
"""Sampled frames with which a pair of markers counts half: in fewer, limbs have hardly moved against each other."""

RIGID_FACTOR = 8.0
"""The automatic limit of the rising count, in units of the noise of a distance: beyond the largest of many pairs."""

OUTLIER = 3.0
"""Times the usual deviation between neighbouring limbs. The only marker of a limb hangs on a joint, which keeps it near
some marker; a marker of the room, of a bystander or one whose label wanders has no such neighbour."""


def find_limbs(
    trajectories: Trajectories,
    parameters: LimbParameters | None = None,
    *,
    n_limbs: int | None = None,
    constraints: LimbConstraints | None = None,
    seed: int = 0,
    monitor: Monitor = SILENT,
) -> Limbs:
    """Group the markers of a take into rigid limbs.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers; gaps are fine.
    parameters : LimbParameters, optional
        How; the defaults suit most takes.
    n_limbs : int, optional
        Number of limbs, if known; otherwise it is found.
    constraints : LimbConstraints, optional
        Markers that share a limb and markers that do not, beside those in `parameters`.
    seed : int
        Seed of the jittered samples and of k-means++.
    monitor : Monitor
        Receives progress and notices.

    Returns
    -------
    Limbs
        Numbered in the order of their first marker. Markers that belong nowhere are left out, with a notice.

    Raises
    ------
    InputError
        If no two markers are seen together, `n_limbs` is out of range, or constraints are wrong or contradict another.
    """
    parameters = parameters or LimbParameters()
    monitor.begin("limbs")
    named = (constraints or LimbConstraints()).with_parameters(parameters).of_markers(trajectories.names)
    found = _groups(trajectories, parameters, n_limbs, named, seed, monitor)
    pairs = every_pair(trajectories.positions[found.frames])
    about = limb_notices(trajectories, found.limb_of_marker, found.frames, pairs)
    for notice in chain(body_notices(found.body_of_marker[found.usable], found.sure), about):
        monitor.notice(notice)
    limbs = found.limbs()
    membership = _memberships(trajectories.positions, found, limbs.body_of_limb, named, pairs)
    monitor.advance(1, 1)
    return replace(limbs, membership=membership)


def draft_limbs(trajectories: Trajectories, parameters: LimbParameters, *, seed: int = 0) -> Limbs:
    """Group the markers of a take into rigid limbs as `find_limbs` does, without how sure each marker's limb is.

    Parameters
    ----------
    trajectories, parameters, seed
        As for `find_limbs`, which says what is raised.
    """
    named = LimbConstraints().with_parameters(parameters).of_markers(trajectories.names)
    return _groups(trajectories, parameters, None, named, seed, SILENT).limbs()


class _Groups(NamedTuple):
    """Limb of each marker by sampled frames, with the deviations of distances there; markers that are seen with others;
    body of each marker, and how sure each body is; and whether what is worn speaks for each marker's limb.
    """

    limb_of_marker: Ints
    frames: Ints
    deviations: pair_distances.Deviations
    usable: Ints
    body_of_marker: Ints
    sure: Floats
    by_wear: Bools

    def limbs(self) -> Limbs:
        """The limbs, without memberships."""
        kept, body_of_limb = bodies_of_limbs(self.limb_of_marker, self.body_of_marker)
        return Limbs(self.limb_of_marker, self.deviations.plain, (), None, body_of_limb, self.sure[kept])


def _groups(
    trajectories: Trajectories,
    parameters: LimbParameters,
    n_limbs: int | None,
    named: MarkerConstraints,
    seed: int,
    monitor: Monitor,
) -> _Groups:
    """Part markers into bodies, and these into limbs."""
    frames = pair_distances.sample_frames(trajectories.n_frames, parameters, seed)
    every = pair_distances.distance_deviations(trajectories.positions, frames)
    usable = _usable(every.plain, named)
    _check_numbers(trajectories.name, len(usable), n_limbs)
    alone = np.setdiff1d(np.arange(trajectories.n_markers), usable)
    _notice_left_out(trajectories, alone, "never seen together with another marker", monitor)
    body_of_marker, sure = _bodies(trajectories.positions, usable, every.steady, named, parameters, n_limbs)
    limb_of_marker = np.full(trajectories.n_markers, -1, dtype=np.intp)
    by_wear, held = np.zeros(trajectories.n_markers, dtype=np.bool_), list[Ints]()
    fixed = fixed_markers(trajectories.positions, trajectories.rate, every.plain)
    for markers in [usable[body_of_marker[usable] == body] for body in range(len(sure))]:
        grouping = _Grouping(trajectories.positions[:, markers], named.of(markers), parameters, n_limbs, seed)
        groups, by_wear[markers] = grouping.limbs(frames, every.of(markers))
        if n_limbs is None:
            groups = with_one_fixed(groups, fixed[markers], named.of(markers).apart)
        _notice_left_out(trajectories, markers[groups < 0], "moving against all limbs like none of them", monitor)
        limb_of_marker[markers] = np.where(groups < 0, -1, groups + limb_of_marker.max() + 1)
        kept, grouped = markers[groups >= 0], groups[groups >= 0]
        held += [kept[plate] for plate in plates(grouped, every.of(kept), trajectories.positions[:, kept])]
    if len(sure) > 1 and parameters.n_bodies == 0:
        body_of_marker, sure = kept_bodies(with_held_bodies(trajectories.positions, body_of_marker, held), sure)
    limb_of_marker[limb_of_marker >= 0] = _numbered_by_first(limb_of_marker[limb_of_marker >= 0])
    return _Groups(limb_of_marker, frames, every, usable, body_of_marker, sure, by_wear)


def _check_numbers(name: str, n_usable: int, n_limbs: int | None) -> None:
    """Refuse a take with too few markers for a limb, or for as many limbs as are stated."""
    if n_usable < 2:
        raise InputError(f"{name or 'the take'}: no two markers are seen together; there is no limb to find")
    if n_limbs is not None and not 1 <= n_limbs <= n_usable:
        raise InputError(f"{counted(n_limbs, 'limb')} cannot be made of {n_usable} markers")


def _memberships(
    positions: Floats, found: _Groups, body_of_limb: Ints, named: MarkerConstraints, pairs: PairDistances
) -> Floats:
    """Probability of each limb for each marker, NaN for those on none; limbs of other bodies have none."""
    membership = np.where(found.limb_of_marker[:, np.newaxis] >= 0, np.zeros(len(body_of_limb)), np.nan)
    for body in np.unique(body_of_limb).tolist():
        limbs = np.flatnonzero(body_of_limb == body)
        on_body = np.isin(found.limb_of_marker, limbs)
        markers, on_limb = np.flatnonzero(on_body), np.where(on_body, found.limb_of_marker, -1)
        own, whole = np.searchsorted(limbs, found.limb_of_marker[markers]), positions[:, markers]
        by_wear = whole if found.by_wear[markers].all() else None
        likely = memberships(whole[found.frames], own, named.of(markers), contrast(pairs, on_limb), by_wear)
        membership[np.ix_(markers, limbs)] = likely
    return membership


def _bodies(
    positions: Floats,
    usable: Ints,
    deviation: Floats,
    named: MarkerConstraints,
    parameters: LimbParameters,
    n_limbs: int | None,
) -> tuple[Ints, Floats]:
    """Body of each marker, and the probability of each body; limbs and bodies that are stated are not parted."""
    body_of_marker = np.zeros(positions.shape[1], dtype=np.intp)
    if n_limbs is not None and parameters.n_bodies > 1:
        raise InputError("give either the number of limbs or that of bodies: how limbs are shared is not known")
    if parameters.n_bodies == 1 or n_limbs is not None or parameters.method != "rigidity":
        return body_of_marker, np.ones(1)
    parts = seen_together(positions[:, usable], parameters.n_bodies)
    stated = named.bodies if parameters.n_bodies in {0, len(named.bodies)} else ()
    if stated:
        body_of_marker[usable] = parts
        parts = with_stated_bodies(body_of_marker, stated, deviation)[usable]
        parts = np.unique(parts, return_inverse=True)[1]
    body_of_marker[usable], sure = find_bodies(positions[:, usable], parameters.n_bodies, parts)
    if len(sure) < parameters.n_bodies:
        raise InputError(f"{parameters.n_bodies} bodies were asked for, but only {len(sure)} can be told apart")
    if parameters.n_bodies == 0 and parameters.marker_set != "none":
        body_of_marker[usable], sure = bodies_of_people(positions[:, usable], body_of_marker[usable], sure, parts)
        body_of_marker[np.setdiff1d(np.arange(len(body_of_marker)), usable)] = body_of_marker[usable].min()
    for block in (*(tuple(one.tolist()) for one in stated), *named.blocks):
        bodies = np.unique(body_of_marker[list(block)])
        body_of_marker[np.isin(body_of_marker, bodies)] = bodies[0]
    sure = np.minimum(sure, named.body_probability) if stated else sure
    return kept_bodies(body_of_marker, sure)


class _Grouping:
    """Groups of markers, by one sampling of frames after the other."""

    def __init__(
        self,
        positions: Floats,
        constraints: MarkerConstraints,
        parameters: LimbParameters,
        n_limbs: int | None,
        seed: int,
    ) -> None:
        self._positions, self._constraints, self._parameters = positions, constraints, parameters
        self._n_limbs, self._seed = n_limbs, seed

    def limbs(self, frames: Ints, deviations: pair_distances.Deviations) -> tuple[Ints, bool]:
        """Return the limb of each marker, and whether what is worn had a say.

        The limb is -1 for markers that move against all limbs more than limbs do.

        Parameters
        ----------
        frames : ndarray of intp
            The first sampling.
        deviations : Deviations
            Of distances over these frames.
        """
        rigid = self.voted(frames, deviations)
        groups, by_wear = self.revised(rigid, frames, deviations)
        if self._n_limbs is not None:
            return groups, by_wear
        # Whether markers are alone in their group and move against all others far more than neighbouring limbs do
        usual = deviations.between(rigid).neighbour_motion()
        others = np.nan_to_num(deviations.steady, nan=np.inf) + np.diag(np.full(len(groups), np.inf))
        is_alone = np.bincount(groups)[groups] == 1
        is_far = is_alone & (others.min(axis=1) ** 2 / 2 > OUTLIER**2 * usual) & (usual > 0)
        if is_far.any():
            is_far &= held_by_none(self._positions)
        return np.where(is_far & ~self._constraints.is_named, -1, groups), by_wear

    def voted(self, frames: Ints, deviations: pair_distances.Deviations) -> Ints:
        """Group markers by one sampling after the other until more than half agree; else by the majority on each pair.

        Parameters
        ----------
        frames : ndarray of intp
            The first sampling.
        deviations : Deviations
            Of distances over these frames.
        """
        votes = [self._grouped(frames, deviations)]
        n_samplings = self._parameters.samplings if self._parameters.method == "rigidity" else 1
        is_complete = len(frames) == len(self._positions)
        for sampling in range(1, 1 if is_complete else n_samplings):
            again = pair_distances.sample_frames(len(self._positions), self._parameters, (self._seed, sampling))
            votes.append(self._grouped(again, pair_distances.distance_deviations(self._positions, again)))
            if 2 * sum(np.array_equal(votes[-1], one) for one in votes) > n_samplings:
                return votes[-1]
        return self._constrained(majority(votes), deviations.steady)

    def revised(self, groups: Ints, frames: Ints, deviations: pair_distances.Deviations) -> tuple[Ints, bool]:
        """Revise limbs by what all pairs say: those that bend unlike each other, or are of somebody in a marker set.

        Where most limbs carry plates, which do not bend, others may bend all the more: what is worn knows these.

        Also return whether what is worn had a say.

        Parameters
        ----------
        groups : ndarray of intp, shape (n_markers,)
            What the samplings agree on.
        frames : ndarray of intp
            The first sampling.
        deviations : Deviations
            Of distances over these frames.
        """
        may_bend = self._parameters.method == "rigidity" and self._parameters.flexibility > 0
        is_open = may_bend and self._n_limbs is None
        bend, unlike = deformation(groups, deviations, self._positions) if is_open else (False, False)
        whole = None
        if bend or unlike:
            by_motion = pair_odds(self._positions[frames])
            whole = self._positions if self._parameters.marker_set != "none" else None
            if (bend and unlike) or (whole is not None and is_worn(by_motion, whole)):
                held = () if bend else plates(groups, deviations, self._positions)
                groups = revised(groups, by_motion, self._constraints, deviations.steady, whole, held)
            else:
                whole = None
        return _numbered_by_first(groups), whole is not None

    def _grouped(self, frames: Ints, deviations: pair_distances.Deviations) -> Ints:
        return _numbered_by_first(self._constrained(self._clusters(frames, deviations), deviations.steady))

    def _clusters(self, frames: Ints, deviations: pair_distances.Deviations) -> Ints:
        deviation, common = deviations.steady, deviations.common
        parameters, n_limbs = self._parameters, self._n_limbs
        weight = np.where(np.isnan(deviation), 0.0, (common + 1) / (common + HALF_WEIGHT))
        groups = None
        if parameters.method == "rigidity":
            distances = Distances(np.where(weight > 0, deviation, 0.0) ** 2 / 2, weight)
            groups = rigid_bodies(Movements(self._positions, frames), distances, parameters, self._constraints, n_limbs)
        elif parameters.method == "distances":
            groups = pair_distances.rigid_groups(deviation, parameters, weight)
        if groups is not None and n_limbs in (None, len(np.unique(groups))):
            return groups
        complete = _complete(deviation)
        k = n_limbs if n_limbs is not None else _count_limbs(complete, parameters, self._seed)
        if parameters.method == "greedy":
            return greedy_clusters(complete, k)
        return spectral_clusters(complete, k, parameters.spectral, self._seed)

    def _constrained(self, groups: Ints, deviation: Floats) -> Ints:
        if self._constraints.is_empty:
            return groups
        groups = self._constraints.applied(groups, _complete(deviation))
        if self._n_limbs is not None:
            groups = self._constraints.parted(groups, _complete(deviation), self._n_limbs)
        n_found = len(np.unique(groups))
        if self._n_limbs not in (None, n_found):
            raise InputError(
                f"{counted(self._n_limbs or 0, 'limb is', 'limbs are')} asked for, but with the markers that must "
                f"share a limb or must not there are {n_found}; ask for less of both"
            )
        return groups


def _count_limbs(deviation: Floats, parameters: LimbParameters, seed: int) -> int:
    """Find the number of limbs, for the clusterings that need it.

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Complete standard deviations of distances.
    parameters : LimbParameters
        Their `count` says how.
    seed : int
        Seed of k-means for the rising count.
    """
    if parameters.count == "rigidity":
        return int(pair_distances.rigid_groups(deviation, parameters).max()) + 1
    if parameters.count == "rising":
        limit = parameters.rigid_limit or RIGID_FACTOR * float(np.sqrt(2 * pair_distances.noise_variance(deviation)))
        for k in range(1, len(deviation)):
            labels = spectral_clusters(deviation, k, parameters.spectral, seed)
            if deviation[labels[:, np.newaxis] == labels].max() <= limit:
                return k
        return len(deviation)
    values, vectors = spectrum(affinities(deviation, parameters.spectral)[0])
    if parameters.count == "rotation":
        return aligned_count(vectors[:, ::-1])
    gaps = -np.diff(values[::-1])  # the number of leading eigenvalues before the largest gap (von Luxburg 2007, 8.3)
    return int(np.argmax(gaps[: max(1, len(values) // 2)])) + 1


def _usable(deviation: Floats, constraints: MarkerConstraints) -> Ints:
    """Markers that are seen with another one, or that the user puts on a limb with one that is."""
    others: Floats = deviation + np.where(np.eye(len(deviation)) > 0, np.nan, 0.0)
    has_company: Bools = np.asarray(~np.isnan(others).all(axis=1))
    for block in constraints.blocks:
        has_company[list(block)] = has_company[list(block)].any()
    return np.flatnonzero(has_company)


def _complete(deviation: Floats) -> Floats:
    """Give pairs that are never seen together the largest deviation: nothing says that they are rigid."""
    return np.where(np.isnan(deviation), np.nanmax(deviation), deviation)


def _numbered_by_first(groups: Ints) -> Ints:
    """Number groups by their first marker."""
    _, first, inverse = np.unique(groups, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse]


def _notice_left_out(trajectories: Trajectories, markers: Ints, reason: str, monitor: Monitor) -> None:
    if len(markers):
        names = ", ".join(trajectories.names[marker] for marker in markers)
        monitor.notice(f"left out, {reason}: {names}")
