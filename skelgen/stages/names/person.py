"""A person is recognised by four ends of a tree: two legs and two arms, as long as those of people.

Each leg is parted into thigh, shank and foot at those joints whose distances suit a person best, each arm likewise; the
limbs may be more or fewer than segments. What is left between them is the trunk, by its height over the hips.
Lengths: Drillis and Contini, Body segment parameters, New York University (1966), in parts of stature.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import combinations, pairwise, product

import numpy as np

from skelgen.model.arrays import Floats
from skelgen.stages.names.moving_tree import MovingTree, distance, unit

LEG, ARM = ("thigh", "shank", "foot"), ("upper arm", "forearm", "hand")
_Kind = tuple[str, str, str]

_LENGTHS = {LEG: (0.242, 0.234, 0.05), ARM: (0.172, 0.148, 0.045)}
"""Of two bones, and from the last joint to the middle of the limb behind it."""

_WITHOUT_END = {LEG: 0.14, ARM: 0.11}
"""From the middle joint to the middle of the markers where foot or hand have none of their own."""

_TO_TOES = 0.08
"""From the ankle to the joint of toes that move by themselves."""

_TOES = 0.46  # of a shank: how far the markers of toes are from the ankle; heads of metatarsals are nearer

_STIFF = 0.2
"""From the shoulder to the middle of the markers of an arm that is one limb."""

_ACROSS = (0.105, 0.21, 0.28)
"""From hip to hip, from shoulder to shoulder, and from the middle of the former to that of the latter."""

_WHOLE, _PART, _END = 0.06, 0.16, 0.05
"""Deviations of two bones together, of their difference, and of the rest: soft tissue displaces knees along the leg."""

_MOST, _MOST_END = 3.0, 1.0  # of a squared deviation: one joint that is far off says no more
_MISSING, _ADDED = {LEG: 2.5, ARM: 1.5}, 1.0
"""What a segment without a limb of its own costs, of which hands are many, and a limb that a segment has beyond one."""

_HEAD_HIGH, _HEAD_SPREAD, _HEADLESS = 1.55, 0.25, 1.0
"""Height of the head's markers, hips being at 0 and shoulders at 1, and what it costs if there are none."""

_STATURES = np.geomspace(0.75, 1.35, 19)  # around that of the ways between the ends
_AROUND = 3.5  # statures that the ways from a foot to the other and from both to a hand have in all
_UNEVEN = 0.7
"""What a segment costs that is found in one arm alone; of legs it is as much as a limb too many."""

_FARTHEST, _FARTHER = 0.2, 6.0
"""From which on a foot or a hand is too far from its joint, and what that costs: it is another leg's."""

_MOST_ENDS = 10
_LIKELY = 8  # choices of two legs and two arms that are looked at closely
_CHOICES = 3  # ways to part an arm or a leg that are tried with those of the others
_MOST_MISFIT = 11.2
"""Beyond which a tree is no person."""

_HEAD, _CHEST = 1.2, 0.40  # heights of a limb's markers
_NEARLY = 0.9  # of a bone
_LEAST_ALIKE = 0.3  # cosine between hips and shoulders in the mean


@dataclass(frozen=True, eq=False)
class Chain:
    """An arm or a leg.

    Attributes
    ----------
    segments : mapping of int to str
        Segment of each limb, from the trunk outward.
    joints : tuple of ndarray, shape (n_frames, 3), mm
        Hip, knee and ankle, or shoulder, elbow and wrist; the middle of the last limb instead of one that is missing.
    limbs : tuple of int
        The limb before each joint, and the last one.
    misfit : float
        How far its lengths are from a person's, squared and summed.
    """

    segments: Mapping[int, str]
    joints: tuple[Floats, Floats, Floats]
    limbs: tuple[int, int, int, int]
    misfit: float


@dataclass(frozen=True, eq=False)
class Person:
    """A person by shape: two legs and two arms, whose sides are not known, and the trunk.

    Attributes
    ----------
    legs, arms : tuple of Chain
        The first arm is on the side of the first leg, if `are_arms_sided`.
    segments : mapping of int to str
        Segments of all limbs, those of arms and legs without a side.
    sides : mapping of int to int
        0 for limbs on the side of the first leg, 1 on the other.
    misfit : float
        How far the lengths are from a person's, squared and summed.
    are_arms_sided : bool
        Whether the shoulders keep their direction against the hips.
    """

    legs: tuple[Chain, Chain]
    arms: tuple[Chain, Chain]
    segments: Mapping[int, str]
    sides: Mapping[int, int]
    misfit: float
    are_arms_sided: bool


_Fit = Callable[[int, int, _Kind], "_Ways"]


@dataclass(frozen=True, eq=False)
class _Person:
    """What four ends of a tree make: chains of the two legs and the two arms."""

    chains: tuple[Chain, Chain, Chain, Chain]
    misfit: float


@dataclass(frozen=True, eq=False)
class _Four:
    """Paths that may be two legs and two arms, the stature [mm] that suits them best, and how far they are from it."""

    ways: list[_Ways]
    stature: float
    misfit: float


def find_person(tree: MovingTree) -> Person | None:
    """Return the person that a tree is, or None if it is none."""
    ends = sorted(tree.ends, key=lambda end: -sum(tree.way(end, other) for other in tree.ends))[:_MOST_ENDS]

    @cache
    def ways(hub: int, end: int, kind: _Kind) -> _Ways:
        return _Ways.along(tree, tree.path(hub, end), kind)

    tried = [four for legs in combinations(ends, 2) for four in _with_legs(tree, legs, ends, ways)]
    likely = sorted(tried, key=lambda four: four.misfit)[:_LIKELY]
    best = min((_best(tree, four) for four in likely), key=lambda found: found.misfit, default=None)
    return None if best is None or best.misfit > _MOST_MISFIT else _shape(tree, best)


def _with_legs(tree: MovingTree, legs: tuple[int, int], ends: list[int], ways: _Fit) -> list[_Four]:
    """Arms and legs of persons whose legs end in two limbs."""
    found = []
    for arms in combinations([end for end in ends if end not in legs], 2):
        hips, shoulders = tree.meeting(*legs, arms[0]), tree.meeting(*arms, legs[0])
        is_parted = hips == tree.meeting(*legs, arms[1]) and shoulders == tree.meeting(*arms, legs[1])
        if is_parted and not {hips, shoulders} & {*legs, *arms}:
            around = tree.way(*legs) + tree.way(legs[0], arms[0]) + tree.way(legs[1], arms[1])
            fits = [ways(hips, end, LEG) for end in legs] + [ways(shoulders, end, ARM) for end in arms]
            if all(len(fit.lengths) for fit in fits):
                statures = around / _AROUND * _STATURES
                misfits = np.sum([fit.misfits(statures).min(axis=0) for fit in fits], axis=0)
                found.append(_Four(fits, float(statures[misfits.argmin()]), float(misfits.min())))
    return found


def _best(tree: MovingTree, four: _Four) -> _Person:
    choices = [fit.best(four.stature) for fit in four.ways]
    found = [_joined(tree, chains, four.stature) for chains in product(*choices)]
    return min(found, key=lambda person: person.misfit)


def _joined(tree: MovingTree, chains: tuple[Chain, ...], stature: float) -> _Person:
    one, other, third, fourth = chains
    hips, shoulders = _middles(chains)
    across = [distance(one.joints[0], other.joints[0]), distance(third.joints[0], fourth.joints[0])]
    wide = np.array([*across, distance(hips, shoulders)]) / stature - np.array(_ACROSS)
    loose = [end for end in tree.ends if not any(end in chain.segments for chain in chains)]
    heights = np.array([_height(tree, end, hips, shoulders) for end in loose])
    heads = _squares((heights - _HEAD_HIGH) / _HEAD_SPREAD)
    misfit = sum(chain.misfit for chain in chains) + _squares(wide / _WHOLE).sum()
    misfit += _ADDED * len({*one.segments.values()} ^ {*other.segments.values()})
    misfit += _UNEVEN * len({*third.segments.values()} ^ {*fourth.segments.values()})
    misfit += min(heads.min(initial=_MOST), _HEADLESS) + _ADDED * max(len(loose) - 1, 0)
    return _Person((one, other, third, fourth), float(misfit))


def _middles(chains: tuple[Chain, ...]) -> tuple[Floats, Floats]:
    """Middle of the hips, and of the shoulders, each of shape (n_frames, 3)."""
    one, other, third, fourth = (chain.joints[0] for chain in chains)
    return (one + other) / 2, (third + fourth) / 2


def _height(tree: MovingTree, limb: int, hips: Floats, shoulders: Floats) -> float:
    """Height of a limb's markers along the trunk: 0 at the hips, 1 at the shoulders."""
    along = shoulders - hips
    return float(np.median(((tree.centres[limb] - hips) * along).sum(axis=1) / (along**2).sum(axis=1)))


def _squares(deviations: Floats, most: float = _MOST) -> Floats:
    return np.minimum(np.asarray(deviations) ** 2, most)


@dataclass(frozen=True, eq=False)
class _Ways:
    """All ways to part a path from the trunk into the segments of an arm or a leg.

    Attributes
    ----------
    tree, path, kind
        The path from the trunk's limb to an end, and `LEG` or `ARM`.
    breaks : list of tuples of int
        Which joints of the path are hip, knee, ankle and that of the toes; fewer where the end is missing.
    lengths : ndarray, shape (n_ways, 4), mm
        From each of these to the next, and from the last to the middle of the limb behind it.
    """

    tree: MovingTree
    path: tuple[int, ...]
    kind: _Kind
    breaks: list[tuple[int, ...]]
    lengths: Floats

    @classmethod
    def along(cls, tree: MovingTree, path: tuple[int, ...], kind: _Kind) -> _Ways:
        """Try all joints of a path."""
        places, numbers = tree.joints_on(path), range(len(path) - 1)
        apart = {(i, k): distance(places[i], places[k]) for i, k in combinations(numbers, 2)}
        ends = [distance(place, tree.centres[path[number + 1]]) for number, place in enumerate(places)]
        counts = range(2, 5) if kind is LEG else range(1, 4)
        breaks = [chosen for count in counts for chosen in combinations(numbers, count)]
        lengths = np.zeros((len(breaks), 4))
        for row, chosen in enumerate(breaks):
            pairs = pairwise(chosen)
            lengths[row, : len(chosen)] = [*(apart[pair] for pair in pairs), ends[chosen[-1]]]
        return cls(tree, path, kind, breaks, lengths)

    def misfits(self, statures: Floats) -> Floats:
        """How far each way is from a person of each stature, shape (n_ways, n_statures)."""
        upper, lower, end = _LENGTHS[self.kind]
        rows = []
        for chosen, lengths in zip(self.breaks, self.lengths[..., np.newaxis] / statures, strict=True):
            first, second, third, _ = lengths
            cost = _MISSING[self.kind] * max(3 - len(chosen), 0) + _ADDED * (len(self.path) - 1 - len(chosen))
            if len(chosen) == 1:
                terms = _squares((first - _STIFF) / _WHOLE)
            elif len(chosen) == 2:
                terms = _squares((first + second - upper - _WITHOUT_END[self.kind]) / _WHOLE)
            else:
                beyond = end if len(chosen) == len(_LENGTHS[self.kind]) else _TO_TOES
                terms = _squares((first + second - upper - lower) / _WHOLE)
                terms += _squares((third - beyond) / _END, _MOST_END)
                terms += _squares((first - second - upper + lower) / _PART)
            too_long = (lengths[len(chosen) - 1] > _FARTHEST) | (lengths[2] > _FARTHEST)
            rows.append(cost + terms + _FARTHER * (too_long & (len(chosen) > 2)))
        return np.array(rows).reshape(len(self.breaks), len(statures))

    def best(self, stature: float) -> list[Chain]:
        """Return the chains that suit a stature best, the first most."""
        misfits = self.misfits(np.array([stature]))[:, 0]
        return [self._chain(row, float(misfits[row])) for row in np.argsort(misfits, kind="stable")[:_CHOICES].tolist()]

    def _chain(self, row: int, misfit: float) -> Chain:
        breaks, n_joints = self.breaks[row], len(self.path) - 1
        stops = [*breaks, *[n_joints] * (3 - len(breaks))]
        segments = {}
        for number in range(breaks[0] + 1, n_joints + 1):
            segments[self.path[number]] = (*self.kind, "toes")[sum(number > stop for stop in stops[1:])]
        places = [*self.tree.joints_on(self.path), self.tree.centres[self.path[-1]]]
        first, second, third = (places[stop] for stop in stops[:3])
        at_hip, at_knee, at_ankle = (self.path[stop] for stop in stops[:3])
        return Chain(segments, (first, second, third), (at_hip, at_knee, at_ankle, self.path[-1]), misfit)


def _shape(tree: MovingTree, found: _Person) -> Person:
    one, other, third, fourth = found.chains
    hips, shoulders = one.joints[0] - other.joints[0], third.joints[0] - fourth.joints[0]
    alike = float(np.mean((unit(hips) * unit(shoulders)).sum(axis=1)))
    legs, arms = (one, other), (third, fourth) if alike >= 0 else (fourth, third)
    sides = {limb: side for pair in (legs, arms) for side, chain in enumerate(pair) for limb in chain.segments}
    segments = {limb: segment for chain in found.chains for limb, segment in chain.segments.items()}
    segments |= {limb: "foot" for leg in legs for limb in leg.segments if _is_forefoot(tree, leg, limb)}
    carrying = tree.path(one.limbs[0], third.limbs[0])
    for limb in _trunk_limbs(tree, found.chains):
        height = _height(tree, limb, *_middles(found.chains))
        segments[limb] = "head" if height > _HEAD and limb not in carrying else "chest" if height > _CHEST else "pelvis"
    _add_branches(tree, (*legs, *arms), segments, sides)
    return Person(legs, arms, _with_pelvis(segments, one), sides, found.misfit, abs(alike) > _LEAST_ALIKE)


def _is_forefoot(tree: MovingTree, leg: Chain, limb: int) -> bool:
    """Whether a limb that moves against the foot is a piece of it: toes are farther from the ankle."""
    _, knee, ankle = leg.joints
    return leg.segments[limb] == "toes" and distance(ankle, tree.centres[limb]) < _TOES * distance(knee, ankle)


def _trunk_limbs(tree: MovingTree, chains: tuple[Chain, ...]) -> list[int]:
    """Limbs that are reached from the hips without passing through an arm or a leg."""
    closed = {limb for chain in chains for limb in chain.segments}
    reached, waiting = {chains[0].limbs[0]}, [chains[0].limbs[0]]
    while waiting:
        near = [limb for limb in tree.neighbours[waiting.pop()] if limb not in closed | reached]
        reached.update(near)
        waiting += near
    return sorted(reached)


def _with_pelvis(segments: Mapping[int, str], leg: Chain) -> dict[int, str]:
    """Let the limb that carries the first leg be the pelvis, if none is."""
    has_pelvis = "pelvis" in segments.values() or list(segments.values()).count("chest") == 1
    return dict(segments) if has_pelvis else {**segments, leg.limbs[0]: "pelvis"}


def _add_branches(tree: MovingTree, chains: tuple[Chain, ...], segments: dict[int, str], sides: dict[int, int]) -> None:
    """Give limbs that hang beside an arm or a leg the segment whose bone they are nearest to."""
    for limb in tree.limbs:
        if limb in segments:
            continue
        path = tree.path(limb, chains[0].limbs[0])
        host = next(other for other in path if other in segments)
        near = [chain for chain in chains if host in chain.segments]
        if near:
            bones = zip(near[0].joints, (*near[0].joints[1:], tree.centres[near[0].limbs[-1]]), strict=True)
            kind = LEG if near[0] in chains[:2] else ARM
            ends = (_NEARLY, _NEARLY, 1.0)  # what is level with a joint belongs to the bone beyond it
            away = [_distance_to_bone(tree.centres[limb], *bone, end) for bone, end in zip(bones, ends, strict=True)]
            segments[limb], sides[limb] = kind[int(np.argmin(away))], sides[host]


def _distance_to_bone(points: Floats, start: Floats, end: Floats, until: float) -> float:
    along = end - start
    part = ((points - start) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-9)
    return distance(points, start + np.clip(part, 0.0, until)[:, np.newaxis] * along)
