"""What is known beside the data: a marker set that is recognised, and numbers of bodies and limbs that are stated.

The segments of a recognised set are the limbs and its tree the joints, unless the data say otherwise and are sure of
it. Stated bodies that stay too near each other to be parted by distances are parted by joints: limbs are found as if
all were one body, with the joints between them. Two bodies are held together by no joint, so that the joints that fit
worst are those between bodies. A number of limbs is reached from the limbs that are found: some are merged, or parted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from skelgen.app.configuration import Settings
from skelgen.app.constraints import joints_of_person
from skelgen.model import Limbs, Project, Topology
from skelgen.model.arrays import Bools
from skelgen.model.limbs import with_names_of_limbs
from skelgen.progress import Monitor, listed

if TYPE_CHECKING:
    from skelgen.stages.joints import JointConstraints
    from skelgen.stages.limbs import LimbConstraints


_OVERRULES = 0.95
"""Probability of a marker's limb, or of an edge, from which on the data overrule a marker set."""

_OVERRULES_JOINT = 0.995
"""The same of an edge that the set does not have: of fifty simulated people six such edges have 95 to 99.4 %."""

_LOOSER = 4.0
"""A marker is surely on another segment if it moves so many times more against that of the set."""

_MOST_NAMED = 5  # markers that a note names


class HeldNotices:
    """A monitor that passes progress on and keeps notices, for a result that may be replaced by a better one.

    Parameters
    ----------
    monitor : Monitor
        Receives progress, and the notices when they are released.
    """

    def __init__(self, monitor: Monitor) -> None:
        self._monitor = monitor
        self._notices: list[str] = []

    def begin(self, name: str) -> None:
        """Pass on that work starts."""
        self._monitor.begin(name)

    def advance(self, done: float, total: float) -> None:
        """Pass on how much is finished.

        Parameters
        ----------
        done, total : float
            Units of the work.
        """
        self._monitor.advance(done, total)

    def notice(self, sentence: str) -> None:
        """Keep a notice."""
        self._notices.append(sentence)

    def release(self, limbs: Limbs | None = None) -> None:
        """Pass the kept notices on, with the names of limbs where these are known by now."""
        for sentence in self._notices:
            self._monitor.notice(sentence if limbs is None else with_names_of_limbs(sentence, limbs))


def with_segments(
    project: Project, limbs: Limbs, constraints: LimbConstraints, monitor: Monitor
) -> LimbConstraints | None:
    """Return constraints that put the markers of a recognised set on its segments, or None if nothing would change.

    Parameters
    ----------
    project : Project
        With labels.
    limbs : Limbs
        What is found without the set; a marker that is on the limb of another segment, and surely, stays free.
    constraints : LimbConstraints
        What the user states; markers of which it speaks are theirs.
    monitor : Monitor
        Receives a notice of markers that the data put elsewhere.
    """
    from skelgen.stages.names import recognised_set  # noqa: PLC0415 - reads tables

    names = project.trajectories.names
    worn = recognised_set(names)
    if worn is None:
        return None
    stated = {name for group in (*constraints.together, *constraints.apart) for name in group}
    body = limbs.body_of_limb
    placed = {
        marker: f"{_subject(name)}{body[limbs.limb_of_marker[marker]]}:{worn.segments[name]}"
        for marker, name in enumerate(names)
        if name in worn.segments and name not in stated and limbs.limb_of_marker[marker] >= 0
    }
    elsewhere = _elsewhere(limbs, placed)
    segments: dict[str, list[str]] = {}
    for marker, segment in placed.items():
        if marker not in elsewhere:
            segments.setdefault(segment, []).append(names[marker])
    if elsewhere:
        listed = ", ".join(
            f"{names[marker]} with the {segment.rpartition(':')[2]}"
            for marker, segment in list(elsewhere.items())[:_MOST_NAMED]
        )
        more = f" and {len(elsewhere) - _MOST_NAMED} more" if len(elsewhere) > _MOST_NAMED else ""
        monitor.notice(f"unlike in {worn.title}, these markers surely move with another limb: {listed}{more}")
    if {frozenset(group) for group in segments.values()} == _groups(limbs, names, placed, elsewhere):
        return None
    apart = tuple(group[0] for group in segments.values())
    together = (*constraints.together, *map(tuple, segments.values()))
    return replace(constraints, together=together, apart=(*constraints.apart, apart))


def _subject(name: str) -> str:
    """The part of a marker's name up to the last colon, which names the subject."""
    subject, colon, _ = name.rpartition(":")
    return subject + colon


def _groups(
    limbs: Limbs, names: tuple[str, ...], placed: Mapping[int, str], elsewhere: Mapping[int, str]
) -> set[frozenset[str]]:
    """Markers of the set that share a limb, without those that the data put elsewhere."""
    groups: dict[int, set[str]] = {}
    for marker in placed:
        if marker not in elsewhere:
            groups.setdefault(int(limbs.limb_of_marker[marker]), set()).add(names[marker])
    return set(map(frozenset, groups.values()))


def _elsewhere(limbs: Limbs, placed: Mapping[int, str]) -> dict[int, str]:
    """Markers that are surely on the limb of another segment than the set's, and which segment that is.

    A segment keeps its markers if none would be left: one marker on a hand moves much as the forearm does.
    """
    votes: dict[int, Counter[str]] = {}
    for marker, segment in placed.items():
        votes.setdefault(int(limbs.limb_of_marker[marker]), Counter())[segment] += 1
    found = {}
    for marker, segment in placed.items():
        counts = votes[int(limbs.limb_of_marker[marker])]
        most = max(counts, key=lambda one: counts[one])
        if counts[most] > counts[segment]:
            steady, loose = (_deviation(limbs, placed, marker, one) for one in (most, segment))
            if limbs.probability[marker] >= _OVERRULES or loose > _LOOSER * steady:
                found[marker] = most
    left = {segment for marker, segment in placed.items() if marker not in found}
    return {marker: most for marker, most in found.items() if placed[marker] in left}


def _deviation(limbs: Limbs, placed: Mapping[int, str], marker: int, segment: str) -> float:
    """Median deviation of a marker's distances to the markers of a segment [mm]; 0 if there are none."""
    others = [other for other, one in placed.items() if one == segment and other != marker]
    deviations = limbs.distance_deviation[marker, others]
    known = deviations[~np.isnan(deviations)]
    return float(np.median(known)) if len(known) else 0.0


def with_tree(
    project: Project, topology: Topology, constraints: JointConstraints, limb_names: Sequence[str], monitor: Monitor
) -> JointConstraints | None:
    """Return constraints that join the limbs of a person as a recognised set has them, or None if they are joined so.

    Parameters
    ----------
    project : Project
        With limbs that are named by the set.
    topology : Topology
        What is found without the set; an edge that is sure stays.
    constraints : JointConstraints
        What the user states.
    limb_names : sequence of str, length n_limbs
        What the set calls the limbs.
    monitor : Monitor
        Receives a notice of joints that the data refuse.
    """
    from networkx.utils import UnionFind  # noqa: PLC0415 - loaded where a tree is found

    wanted = joints_of_person(limb_names, project.limbs)
    names = [name.rstrip("0123456789 ") for name in limb_names]
    found = {frozenset((names[one], names[other])) for one, other in topology.edges.tolist()}
    missing = [pair for pair in wanted if frozenset((names[pair[0]], names[pair[1]])) not in found]
    probability = topology.edge_probability
    if not missing or probability is None or constraints.parents is not None:
        return None
    sure = [
        (one, other)
        for (one, other), p in zip(topology.edges.tolist(), probability.tolist(), strict=True)
        if p >= (_OVERRULES if (min(one, other), max(one, other)) in wanted else _OVERRULES_JOINT)
    ]
    trees = UnionFind()
    for pair in (*sure, *constraints.joined):
        trees.union(*pair)
    missing = [pair for pair in missing if project.limbs.body_of_limb[pair[0]] == project.limbs.body_of_limb[pair[1]]]
    taken, refused = [], []
    for pair in missing:
        if trees[pair[0]] == trees[pair[1]] or pair in constraints.parted:
            refused.append(f"{names[pair[0]]} and {names[pair[1]]}")
        else:
            trees.union(*pair)
            taken.append(pair)
    if refused:
        monitor.notice(f"unlike in a person, these limbs are surely not joined: {', '.join(refused)}")
    if not taken:
        return None
    of_person = (*constraints.of_person, *taken)
    return replace(constraints, joined=(*constraints.joined, *taken), of_person=of_person)


UNSURE = 0.5
"""Probability of a body below which distances alone would not part it."""


def bodies_by_joints(
    project: Project, settings: Settings, limbs: Limbs, stated: LimbConstraints, monitor: Monitor
) -> LimbConstraints | None:
    """Return constraints with the markers of each body by the joints between limbs, where distances are unsure.

    Parameters
    ----------
    project : Project
        With labels.
    settings : Settings
        Parameters of the stages; that of limbs states the number of bodies.
    limbs : Limbs
        As distances part the bodies.
    stated : LimbConstraints
        What the user states.
    monitor : Monitor
        Receives a notice of what parts the bodies.

    Returns
    -------
    LimbConstraints or None
        None where distances are sure, bodies are stated, or joints say nothing: a limb that stands still goes across
        the bodies that distances tell, as the feet of several people who never step.
    """
    from skelgen.stages.joints import JointSearch  # noqa: PLC0415 - loads the stage
    from skelgen.stages.limbs import find_limbs  # noqa: PLC0415 - loads the stage

    n_bodies = settings.limbs.n_bodies
    if n_bodies < 2 or stated.bodies or limbs.body_probability.min() >= UNSURE:
        return None
    trajectories = project.trajectories
    as_one = find_limbs(trajectories, replace(settings.limbs, n_bodies=1), constraints=stated, seed=project.seed)
    search = JointSearch(trajectories, as_one, settings.joints, project.seed)
    parted = search.parted(n_bodies)
    if parted is None or (search.is_still & _across(as_one, limbs) & (parted.body_of_limb >= 0)).any():
        return None
    body_of_marker = parted.of_markers(trajectories.positions, as_one.limb_of_marker)
    names = np.array(trajectories.names)
    bodies = tuple(tuple(names[body_of_marker == body].tolist()) for body in range(n_bodies))
    monitor.notice(
        f"{n_bodies} bodies, as stated, of {listed(str(len(body)) for body in bodies)} markers: they are too near each "
        "other for distances to part them; the joints that would hold them together have "
        f"{parted.gap_ratio:.1f} times the gap of any other joint"
    )
    return replace(stated, bodies=bodies, body_probability=parted.probability)


def near_limbs(
    names: Sequence[str], limbs: Limbs, split: Sequence[Sequence[str]], stated: LimbConstraints, n_limbs: int
) -> LimbConstraints:
    """Return constraints by which another number of limbs only merges, or only parts, those that are found.

    Parameters
    ----------
    names : sequence of str
        Of the markers.
    limbs : Limbs
        Those that are found.
    split : sequence of sequence of str
        Names of parts of one marker, of which the first stands for it.
    stated : LimbConstraints
        What the user states.
    n_limbs : int
        The number that is stated.
    """
    parts = {name for group in split for name in group[1:]}
    kept = [name not in parts for name in names]
    markers = [
        [names[marker] for marker in limbs.markers_of(limb).tolist() if kept[marker]] for limb in range(limbs.n_limbs)
    ]
    if n_limbs < limbs.n_limbs:
        return replace(stated, together=(*stated.together, *(group for group in markers if len(group) > 1)))
    return replace(stated, apart=(*stated.apart, *(pair for two in combinations(markers, 2) for pair in product(*two))))


def _across(as_one: Limbs, limbs: Limbs) -> Bools:
    """Which limbs of `as_one` have markers on several bodies of `limbs`, shape (n_limbs,)."""
    on_both = (limbs.limb_of_marker >= 0) & (as_one.limb_of_marker >= 0)
    bodies = limbs.body_of_limb[limbs.limb_of_marker]
    return np.array(
        [len(np.unique(bodies[on_both & (as_one.limb_of_marker == limb)])) > 1 for limb in range(as_one.n_limbs)]
    )
