"""All targets in one frame: each searched for by itself, then points given to the bodies that they fit best."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skelgen.capture.bodies import plain, plain_pose
from skelgen.capture.bodies.design import check_targets
from skelgen.capture.bodies.plain_pose import Settled
from skelgen.capture.bodies.tables import Rules, Scene, TargetTable, rules_of, scene_plain, target_table
from skelgen.capture.parameters import BodyParameters
from skelgen.capture.values import FoundBody, StereoPoints
from skelgen.geometry.rotations import vector_from_matrix
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
        Of a small turn about the world's axes [rad] and a shift [mm].
    """

    world_from_body: Floats
    covariance: Floats


class _Candidate(NamedTuple):
    settled: Settled
    cost: float


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
        If the targets cannot be told from each other or from themselves; see `check_targets`.
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
    compiled : bool, optional
        Whether to use the compiled twin; by default where numba can keep what it compiles.

    Raises
    ------
    InputError
        If the targets cannot be told from each other or from themselves.
    """

    def __init__(
        self,
        targets: Sequence[BodyTarget],
        parameters: BodyParameters | None = None,
        executor: Executor | None = None,
        compiled: bool | None = None,
    ) -> None:
        parameters = parameters or BodyParameters()
        check_targets(targets, parameters)
        self.targets = tuple(targets)
        self._tables = [target_table(target) for target in targets]
        self._rules, self._distinct = rules_of(parameters), parameters.distinct
        self._clearly = 2.0 * math.log(1.0 / parameters.doubt - 1.0)  # of two misfits: minus twice the log of the odds
        self._executor = executor
        self._twin: _Twin = _CompiledTwin() if _can_compile(compiled) else _PlainTwin()

    def find(self, points: StereoPoints, expected: Mapping[str, ExpectedPose] | None = None) -> list[FoundBody]:
        """Find the targets in one frame; see `find_bodies`."""
        if len(points) < self._rules.min_points or not self.targets:
            return []
        scene = self._twin.scene(points)
        free = np.ones(len(points), dtype=bool)
        found: dict[int, Settled] = {}
        left = list(range(len(self.targets)))
        while left:
            candidates = self._candidates(scene, left, free, expected or {})
            rivals = [body for body in left if candidates[body] is not None]
            left = []
            for body in sorted(rivals, key=lambda body: _cost(candidates[body])):
                settled = _settled(candidates[body])
                if free[settled.matched[settled.matched >= 0]].all():
                    found[body] = settled
                    free &= _not_excluded(scene, settled.matched)
                else:
                    left.append(body)  # somebody else has its points: search again among those that are left
        return [_found_body(self.targets[body], found[body]) for body in sorted(found)]

    def _candidates(
        self, scene: Scene, bodies: Sequence[int], free: Bools, expected: Mapping[str, ExpectedPose]
    ) -> dict[int, _Candidate | None]:
        def one(body: int) -> _Candidate | None:
            return self._candidate(scene, body, free, expected.get(self.targets[body].name))

        run = map if self._executor is None or len(bodies) == 1 else self._executor.map
        return dict(zip(bodies, run(one, bodies), strict=True))

    def _candidate(self, scene: Scene, body: int, free: Bools, expected: ExpectedPose | None) -> _Candidate | None:
        table = self._tables[body]
        everywhere = np.tile(free, (len(table.points), 1))
        if expected is not None:
            near = _near(table, scene, expected, self._rules) & free
            found = self._certain(table, scene, near, free)
            if found is not None:
                return found
        return self._certain(table, scene, everywhere, free)

    def _certain(self, table: TargetTable, scene: Scene, allowed: Bools, free: Bools) -> _Candidate | None:
        """The likeliest matching, or None if another one that tells another pose is nearly as likely."""
        found = self._sound(table, scene, allowed, free)
        if found is None:
            return None
        rivals = self._rivals(table, scene, allowed, free, found)
        best, *others = sorted([found, *rivals], key=lambda one: (-_n_matched(one), one.settled.misfit))
        for other in others:
            is_likely = other.settled.misfit - best.settled.misfit < self._clearly
            if (
                _n_matched(other) == _n_matched(best)
                and is_likely
                and _are_apart(table, best.settled, other.settled, self._distinct)
            ):
                return None
        return best if best.settled.rms <= self._rules.max_distance else None

    def _rivals(
        self, table: TargetTable, scene: Scene, allowed: Bools, free: Bools, found: _Candidate
    ) -> list[_Candidate]:
        """Matchings of as many balls that tell another pose and that the noise explains, however far off in mm."""
        rules = self._rules._replace(min_points=_n_matched(found), max_distance=np.inf)
        rival = self._searched(table, scene, allowed, free, rules, known=found.settled.matched)
        if rival is None:  # as nearly always
            return []
        rivals = [rival, *self._without(table, scene, allowed, free, found.settled.matched, rules)]
        return [
            rival
            for rival in rivals
            if rival.settled.is_sound and _are_apart(table, found.settled, rival.settled, self._distinct)
        ]

    def _sound(self, table: TargetTable, scene: Scene, allowed: Bools, free: Bools) -> _Candidate | None:
        """The best matching that the noise explains; one of more balls, if there is such, as it proves more."""
        best = self._searched(table, scene, allowed, free, self._rules)
        if best is None:
            return None
        n_matched = _n_matched(best)
        if n_matched < len(table.points):
            more = self._searched(table, scene, allowed, free, self._rules._replace(min_points=n_matched + 1))
            if more is not None and more.settled.is_sound:
                return more
        if best.settled.is_sound:
            return best
        others = self._without(table, scene, allowed, free, best.settled.matched, self._rules)
        return min((other for other in others if other.settled.is_sound), key=_cost, default=None)

    def _without(
        self, table: TargetTable, scene: Scene, allowed: Bools, free: Bools, matched: Ints, rules: Rules
    ) -> Iterator[_Candidate]:
        """The cheapest matchings without one or another match of a given one."""
        for ball in np.flatnonzero(matched >= 0):
            others = allowed.copy()
            others[ball, matched[ball]] = False
            found = self._searched(table, scene, others, free, rules)
            if found is not None:
                yield found

    def _searched(
        self,
        table: TargetTable,
        scene: Scene,
        allowed: Bools,
        free: Bools,
        rules: Rules,
        known: Ints | None = None,
    ) -> _Candidate | None:
        if allowed.any(axis=1).sum() < rules.min_points:
            return None
        known = np.full(len(table.points), -1, dtype=np.intp) if known is None else known
        matched, cost = self._twin.search(table, scene, allowed, rules, known)
        if not np.isfinite(cost):
            return None
        return _Candidate(self._twin.settle(table, scene, matched, free, rules), cost)


class _PlainTwin:
    """The search in plain Python and NumPy."""

    def scene(self, points: StereoPoints) -> Scene:
        return scene_plain(points)

    def search(self, table: TargetTable, scene: Scene, allowed: Bools, rules: Rules, known: Ints) -> tuple[Ints, float]:
        return plain.search(table, scene, allowed, rules, known)

    def settle(self, table: TargetTable, scene: Scene, matched: Ints, free: Bools, rules: Rules) -> Settled:
        return plain_pose.settle(table, scene, matched, free, rules)


class _CompiledTwin:
    """The compiled search."""

    def __init__(self) -> None:
        from skelgen.capture.bodies import compiled_pose, compiled_search  # noqa: PLC0415 - numba takes a second

        self._span_tables, self._search = compiled_search.span_tables, compiled_search.search
        self._distances, self._settle = compiled_search.Distances, compiled_pose.settle

    def scene(self, points: StereoPoints) -> Scene:
        places, covariances = np.array(points.points), np.array(points.covariance)
        left, right = (np.array(side, dtype=np.intp) for side in (points.left, points.right))
        return Scene(places, covariances, *self._span_tables(places, covariances, left, right))

    def search(self, table: TargetTable, scene: Scene, allowed: Bools, rules: Rules, known: Ints) -> tuple[Ints, float]:
        distances = self._distances(table.edges, table.edge_variances, scene.spans, scene.span_variances)
        return self._search(table.points, scene.points, distances, allowed, rules, known)

    def settle(self, table: TargetTable, scene: Scene, matched: Ints, free: Bools, rules: Rules) -> Settled:
        places = (scene.points, scene.covariances, scene.spans)
        return Settled(*self._settle(table.points, table.variances, *places, matched, free, rules))


_Twin = _PlainTwin | _CompiledTwin


def _can_compile(wanted: bool | None) -> bool:
    """Whether numba is there and can keep what it compiles, unless the caller says what is wanted."""
    if wanted is not None:
        return wanted
    try:
        _CompiledTwin()
    except (ImportError, RuntimeError):
        return False
    return True


def _cost(candidate: _Candidate | None) -> float:
    return np.inf if candidate is None else candidate.cost


def _n_matched(candidate: _Candidate) -> int:
    return int((candidate.settled.matched >= 0).sum())


def _are_apart(table: TargetTable, one: Settled, other: Settled, distinct: float) -> bool:
    """Whether two poses put the balls farther apart than is distinct [mm], and than the errors of the pose tell."""
    away = table.points @ (one.pose[:3, :3] - other.pose[:3, :3]).T + one.pose[:3, 3] - other.pose[:3, 3]
    if (away**2).sum() <= len(away) * distinct**2:  # as where one of two balls hides the other
        return False
    turn = vector_from_matrix(one.pose[:3, :3] @ other.pose[:3, :3].T)
    step = np.concatenate([turn, one.pose[:3, 3] - other.pose[:3, 3]])
    return bool(step @ np.linalg.solve(one.covariance, step) > plain_pose.fit_limit(len(step), _FAR))


def _settled(candidate: _Candidate | None) -> Settled:
    assert candidate is not None
    return candidate.settled


def _not_excluded(scene: Scene, matched: Ints) -> Bools:
    """Points that are not taken, and share no ball of an image with those that are."""
    return np.asarray(np.isfinite(scene.spans[matched[matched >= 0]]).all(axis=0))


def _near(table: TargetTable, scene: Scene, expected: ExpectedPose, rules: Rules) -> Bools:
    """Which point may be which ball, if the body is where it is expected, shape (k, n)."""
    turn, place = expected.world_from_body[:3, :3], expected.world_from_body[:3, 3]
    arms = table.points @ turn.T
    away = scene.points - (arms + place)[:, np.newaxis]
    x, y, z = arms.T
    slopes = np.zeros((len(arms), 3, 6))
    slopes[:, 0, 1], slopes[:, 0, 2], slopes[:, 1, 2] = z, -y, x
    slopes[:, 1, 0], slopes[:, 2, 0], slopes[:, 2, 1] = -z, y, -x
    slopes[:, :, 3:] = np.eye(3)
    spread = np.einsum("kai,ij,kai->ka", slopes, expected.covariance, slopes) + table.variances
    limits = rules.floor**2 + spread[:, np.newaxis] + np.einsum("nii->ni", scene.covariances)
    return np.asarray((away**2 <= rules.gate**2 * limits).all(axis=2))


def _found_body(target: BodyTarget, settled: Settled) -> FoundBody:
    return FoundBody(target.name, settled.pose, settled.covariance, settled.matched, float(settled.rms))


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
