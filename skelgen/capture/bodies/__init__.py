"""Rigid bodies among unlabelled points (Gaschler 2011, 3.3): matched by distances, posed with their covariance.

Pairs of balls are matched to pairs of points by their distance, and the best pair is extended depth-first; see
`skelgen._kernels.rigid_body_search`.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skelgen._kernels.rigid_body_pose import chi_squared_limit, fit_body, weigh_pose
from skelgen._kernels.rigid_body_search import Search, find_matching, point_distances
from skelgen._kernels.rigid_body_tables import PointTable, PosedBody, SearchRules, TargetTable
from skelgen.capture.bodies.design import check_targets
from skelgen.capture.parameters import BodyParameters
from skelgen.capture.values import FoundBody, StereoPoints
from skelgen.geometry.rotations import slopes_by_motion, vector_from_matrix
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import BodyTarget

_FAR = 3.0
"""Standard deviations by which poses must differ so that one of them is wrong."""


@dataclass(frozen=True, eq=False)
class ExpectedPose:
    """Where a body is expected to be.

    Attributes
    ----------
    world_from_body : ndarray, shape (4, 4), translation in mm
        Its pose.
    covariance : ndarray, shape (6, 6)
        Of a small rotation about the world's axes [rad] and a shift [mm].
    """

    world_from_body: Floats
    covariance: Floats


class _Candidate(NamedTuple):
    """A matching of a target with points, its pose, and its cost [mm]."""

    body: PosedBody
    cost: float

    @property
    def n_matched(self) -> int:
        return int((self.body.matched >= 0).sum())


def find_bodies(
    points: StereoPoints,
    targets: Sequence[BodyTarget],
    parameters: BodyParameters | None = None,
    expected: Mapping[str, ExpectedPose] | None = None,
) -> list[FoundBody]:
    """Find targets among unlabelled points.

    Parameters
    ----------
    points : StereoPoints
        Of one frame; candidates that share a ball of an image exclude each other.
    targets : sequence of BodyTarget
        What to look for.
    parameters : BodyParameters, optional
        Limits of the search.
    expected : mapping of str to ExpectedPose, optional
        Bodies that are first looked for where they are expected to be.

    Returns
    -------
    list of FoundBody
        In the order of the targets, those that were not found left out; no point is given to two of them.

    Raises
    ------
    InputError
        If a target can be taken for another one or for itself turned; see `check_targets`.
    """
    return BodyFinder(targets, parameters).find(points, expected)


class BodyFinder:
    """Finds the same targets in many frames; the targets are checked once.

    Parameters
    ----------
    targets : sequence of BodyTarget
        What to look for.
    parameters : BodyParameters, optional
        Limits of the search.
    executor : Executor, optional
        Threads that search for one body each.

    Raises
    ------
    InputError
        If a target can be taken for another one or for itself turned.
    """

    def __init__(
        self, targets: Sequence[BodyTarget], parameters: BodyParameters | None = None, executor: Executor | None = None
    ) -> None:
        parameters = parameters or BodyParameters()
        check_targets(targets, parameters)
        self.targets = tuple(targets)
        self._tables = [table_of_target(target) for target in targets]
        self._rules, self._distinct = search_rules(parameters), parameters.distinct
        self._clearly = 2.0 * math.log(1.0 / parameters.doubt - 1.0)  # of two misfits: minus twice the log of the odds
        self._executor = executor

    def find(self, points: StereoPoints, expected: Mapping[str, ExpectedPose] | None = None) -> list[FoundBody]:
        """Find the targets in one frame; see `find_bodies`.

        Parameters
        ----------
        points : StereoPoints
            Of the frame.
        expected : mapping of str to ExpectedPose, optional
            Bodies that are first looked for where they are expected to be.
        """
        if len(points) < self._rules.min_points or not self.targets:
            return []
        scene = table_of_points(points)
        free = np.ones(len(points), dtype=bool)
        found: dict[int, PosedBody] = {}
        left = list(range(len(self.targets)))
        while left:
            candidates = self._candidates(scene, left, free, expected or {})
            left = []
            for body, candidate in sorted(candidates.items(), key=lambda item: item[1].cost):
                taken = candidate.body.matched[candidate.body.matched >= 0]
                if free[taken].all():
                    found[body] = candidate.body
                    free &= np.isfinite(scene.distances[taken]).all(axis=0)  # nor points that share a ball with them
                else:
                    left.append(body)  # another body has its points: search again among those that are left
        return [self._weighted_pose(body, posed, points) for body, posed in sorted(found.items())]

    def _weighted_pose(self, body: int, posed: PosedBody, points: StereoPoints) -> FoundBody:
        """A body that was found, posed by the noise of its points without slack."""
        scene = table_of_points(points, has_slack=False)
        pose, covariance, noise = weigh_pose(self._tables[body], scene, posed.matched)
        return FoundBody(self.targets[body].name, pose, covariance, posed.matched, float(posed.rms), float(noise))

    def _candidates(
        self, scene: PointTable, bodies: Sequence[int], free: Bools, expected: Mapping[str, ExpectedPose]
    ) -> dict[int, _Candidate]:
        """The likeliest matching of each body that has one."""

        def search_one(body: int) -> _Candidate | None:
            return self._candidate(scene, body, free, expected.get(self.targets[body].name))

        run = map if self._executor is None or len(bodies) == 1 else self._executor.map
        found = zip(bodies, run(search_one, bodies), strict=True)
        return {body: candidate for body, candidate in found if candidate is not None}

    def _candidate(self, scene: PointTable, body: int, free: Bools, expected: ExpectedPose | None) -> _Candidate | None:
        """The likeliest matching of a body, first where it is expected to be."""
        table = self._tables[body]
        nothing = np.full(len(table.points), -1, dtype=np.intp)
        if expected is not None:
            near = _near(table, scene, expected, self._rules) & free
            found = self._certain(Search(table, scene, near, nothing, self._rules), free)
            if found is not None:
                return found
        return self._certain(Search(table, scene, np.tile(free, (len(table.points), 1)), nothing, self._rules), free)

    def _certain(self, search: Search, free: Bools) -> _Candidate | None:
        """The likeliest matching, or None if another one with another pose is nearly as likely."""
        found = self._sound(search, free)
        if found is None:
            return None
        rivals = self._rivals(search, free, found)
        best, *others = sorted([found, *rivals], key=lambda one: (-one.n_matched, one.body.misfit))
        for other in others:
            is_likely = other.body.misfit - best.body.misfit < self._clearly
            if other.n_matched == best.n_matched and is_likely and self._are_apart(search.target, best, other):
                return None
        return best if best.body.rms <= self._rules.max_distance else None

    def _rivals(self, search: Search, free: Bools, found: _Candidate) -> list[_Candidate]:
        """Matchings of as many balls with another pose that the noise explains, however far off in mm."""
        rules = self._rules._replace(min_points=found.n_matched, max_distance=np.inf)
        search = search._replace(rules=rules)
        rival = self._best_matching(search._replace(known=found.body.matched), free)
        if rival is None:  # as nearly always
            return []
        rivals = [rival, *self._without(search, free, found.body.matched)]
        return [one for one in rivals if one.body.is_sound and self._are_apart(search.target, found, one)]

    def _sound(self, search: Search, free: Bools) -> _Candidate | None:
        """The best matching that the noise explains. One with more balls is preferred: it proves more."""
        best = self._best_matching(search, free)
        if best is None:
            return None
        if best.n_matched < len(search.target.points):
            rules = self._rules._replace(min_points=best.n_matched + 1)
            more = self._best_matching(search._replace(rules=rules), free)
            if more is not None and more.body.is_sound:
                return more
        if best.body.is_sound:
            return best
        others = [one for one in self._without(search, free, best.body.matched) if one.body.is_sound]
        return min(others, key=lambda one: one.cost, default=None)

    def _without(self, search: Search, free: Bools, matched: Ints) -> Iterator[_Candidate]:
        """Drop one match of a given matching after the other, and search anew: the cheapest matching without each."""
        for ball in np.flatnonzero(matched >= 0):
            others = search.allowed.copy()
            others[ball, matched[ball]] = False
            found = self._best_matching(search._replace(allowed=others), free)
            if found is not None:
                yield found

    def _are_apart(self, table: TargetTable, first: _Candidate, second: _Candidate) -> bool:
        """Whether two poses put the balls farther apart than is distinct [mm], and than the poses' errors explain."""
        one, other = first.body, second.body
        away = table.points @ (one.pose[:3, :3] - other.pose[:3, :3]).T + one.pose[:3, 3] - other.pose[:3, 3]
        if (away**2).sum() <= len(away) * self._distinct**2:  # as where one of two balls hides the other
            return False
        turn = vector_from_matrix(one.pose[:3, :3] @ other.pose[:3, :3].T)
        step = np.concatenate([turn, one.pose[:3, 3] - other.pose[:3, 3]])
        return bool(step @ np.linalg.solve(one.covariance, step) > chi_squared_limit(len(step), _FAR))

    def _best_matching(self, search: Search, free: Bools) -> _Candidate | None:
        """The cheapest matching, posed."""
        if search.allowed.any(axis=1).sum() < search.rules.min_points:
            return None
        matched, cost = find_matching(search)
        if not np.isfinite(cost):
            return None
        return _Candidate(PosedBody(*fit_body(search.target, search.scene, matched, free, search.rules)), cost)


def search_rules(given: BodyParameters) -> SearchRules:
    """Return parameters as kernels take them."""
    return SearchRules(float(given.max_distance), given.min_points, given.penalty, given.gate, given.floor, given.queue)


def table_of_target(target: BodyTarget) -> TargetTable:
    """Return a target with the distances between its balls."""
    points, variances = np.array(target.points, order="C"), np.array(target.std, order="C") ** 2
    between = points[:, np.newaxis] - points
    distances = np.linalg.norm(between, axis=2)
    along = between / np.where(distances > 0, distances, 1.0)[..., np.newaxis]
    spread = (along**2 * (variances[:, np.newaxis] + variances)).sum(axis=2)
    return TargetTable(points, variances, distances, spread)


def table_of_points(found: StereoPoints, *, has_slack: bool = True) -> PointTable:
    """Return the points of one frame with the distances between them.

    Parameters
    ----------
    found : StereoPoints
        Of the frame.
    has_slack : bool
        Whether their covariances are enlarged for the search.
    """
    points, covariances = np.array(found.points, order="C"), np.array(found.covariance, order="C")
    if has_slack and found.slack is not None:
        covariances *= found.slack[:, np.newaxis, np.newaxis]
    left, right = (np.array(side, dtype=np.intp) for side in (found.left, found.right))
    return PointTable(points, covariances, *point_distances(points, covariances, left, right))


def _near(table: TargetTable, scene: PointTable, expected: ExpectedPose, rules: SearchRules) -> Bools:
    """Which point may be which ball, if the body is where it is expected, shape (k, n)."""
    turn, place = expected.world_from_body[:3, :3], expected.world_from_body[:3, 3]
    arms = table.points @ turn.T
    away = scene.points - (arms + place)[:, np.newaxis]
    slopes = slopes_by_motion(arms)
    spread = np.einsum("kai,ij,kai->ka", slopes, expected.covariance, slopes) + table.variances
    limits = rules.floor**2 + spread[:, np.newaxis] + np.einsum("nii->ni", scene.covariances)
    return np.asarray((away**2 <= rules.gate**2 * limits).all(axis=2))


def resolved_points(points: StereoPoints, bodies: Iterable[FoundBody]) -> Ints:
    """Return the points that are left when every ball of an image is used once.

    Points of bodies are real; of the others those go first whose balls fit best together.

    Parameters
    ----------
    points : StereoPoints
        All candidates of one frame.
    bodies : iterable of FoundBody
        What was found among them.

    Returns
    -------
    ndarray of intp, shape (n,)
        Indices, rising.
    """
    certain = [int(point) for body in bodies for point in body.points if point >= 0]
    order = [*certain, *np.argsort(points.epipolar_distance, kind="stable").tolist()]
    used_left: set[int] = set()
    used_right: set[int] = set()
    kept = []
    for point in order:
        left, right = int(points.left[point]), int(points.right[point])
        if left not in used_left and right not in used_right:
            kept.append(point)
            used_left.add(left)
            used_right.add(right)
    return np.array(sorted(kept), dtype=np.intp)
