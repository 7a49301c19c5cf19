"""What the user states of a take beside parameters: numbers, the tree, and constraints on limbs and joints.

It comes from the options of a run (`RunOptions`) and from the corrections of a project; the stages obey both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Limbs, Project, Trajectories
from skelgen.model.arrays import check_whole
from skelgen.model.corrections import Correction, named_marker
from skelgen.model.limbs import body_and_limb
from skelgen.model.topology import parents_from_names
from skelgen.progress import Monitor

if TYPE_CHECKING:
    from skelgen.stages.joints import JointConstraints
    from skelgen.stages.limbs import LimbConstraints
    from skelgen.stages.names import MarkerSet


@dataclass(frozen=True)
class RunOptions:
    """What the user asks of one run beside the parameters of the stages.

    Attributes
    ----------
    n_markers, n_limbs : int or None
        Known numbers; None lets the stages find them.
    n_jobs : int
        Number of processes for work that can be shared.
    hierarchy : mapping of str to str, or None
        Parent of every limb by name, empty for a root: names of bodies, or limb0, limb1, ...; None finds the tree.
    root : str or None
        Name of the limb that is the root of a tree that is found, or of a marker on it.
    joined, parted : tuple of pairs of str
        Limbs between which there is a joint, and between which there is none: each limb by its name or by the name of
        one of its markers.
    """

    n_markers: int | None = None
    n_limbs: int | None = None
    n_jobs: int = 1
    hierarchy: Mapping[str, str] | None = None
    root: str | None = None
    joined: tuple[tuple[str, str], ...] = ()
    parted: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        for name, least in (("n_markers", 1), ("n_limbs", 1), ("n_jobs", 1)):
            value = getattr(self, name)
            if value is not None or name == "n_jobs":
                check_whole(value, least, name)
        if not isinstance(self.hierarchy, Mapping | None):
            raise InputError(
                f"the hierarchy is {self.hierarchy!r:.60}; it must map the name of each limb to its parent's"
            )

    def notices(self, stage: str) -> tuple[str, ...]:
        """Return the sentences that the report of a stage says about these options."""
        if stage == "labels" and self.n_markers is not None:
            return (f"the number of markers was given: {self.n_markers}",)
        if stage == "limbs" and self.n_limbs is not None:
            return (f"the number of limbs was given: {self.n_limbs}",)
        if stage != "joints":
            return ()
        given = [f"the root was given: {self.root}"] if self.root is not None else []
        given += ["the hierarchy was given"] if self.hierarchy is not None else []
        given += [f"a joint was given: {first} and {second}" for first, second in self.joined]
        return (*given, *(f"no joint was given: {first} and {second}" for first, second in self.parted))


def stated_number(project: Project, kind: str) -> int | None:
    """Return the number of markers or limbs that the latest correction states.

    Parameters
    ----------
    project : Project
        With or without corrections.
    kind : str
        ``n_markers`` or ``n_limbs``.
    """
    stated = [int(correction.value) for correction in project.corrections if correction.kind == kind]
    return stated[-1] if stated else None


def limb_constraints(project: Project, marker_set: str, monitor: Monitor) -> LimbConstraints:
    """Return what the corrections of a project, and a marker set that is stated, say about limbs.

    Parameters
    ----------
    project : Project
        With labels.
    marker_set : str
        A marker set that is worn; ``auto`` or ``none`` if the user does not say.
    monitor : Monitor
        Receives a notice for each correction.

    Raises
    ------
    InputError
        If a correction names a marker that does not exist, or the take has less than half of the marker set.
    """
    from skelgen.stages.limbs import LimbConstraints  # noqa: PLC0415 - loads the stage

    worn = worn_set(project, marker_set)
    together = [] if worn is None or marker_set == "auto" else _markers_of_segments(worn)
    apart: list[tuple[str, ...]] = [tuple(markers[0] for markers in together)]
    for correction in corrections_of(project, "limbs", monitor):
        share, part = _stated_of_limbs(project, correction)
        together += share
        apart += part
    return LimbConstraints(tuple(together), tuple(apart), () if worn is None else _markers_of_wearers(worn))


def check_no_contradiction(project: Project, correction: Correction) -> None:
    """Refuse a statement on limbs or joints that contradicts those that a project holds already.

    Parameters
    ----------
    project : Project
        With labels.
    correction : Correction
        The statement that is to be added.

    Raises
    ------
    InputError
        If it contradicts an earlier correction, which is named.
    """
    earlier = [one for one in project.corrections if one.stage == correction.stage and one.names]
    other = None
    if correction.kind in {"join", "part"} and project.has("limbs"):
        limbs = set(_limbs(project, correction))
        against = (one for one in earlier if {one.kind, correction.kind} == {"join", "part"})
        other = next((one for one in against if set(_limbs(project, one)) == limbs), None)
    elif correction.kind in {"together", "apart", "move"}:
        other = _contradicted(project, correction, earlier)
    if other is not None:
        raise InputError(
            f"'{correction.sentence}' contradicts the correction '{other.sentence}'; take that one back first"
        )


def _contradicted(project: Project, correction: Correction, earlier: Sequence[Correction]) -> Correction | None:
    """The earlier correction that a new one contradicts: markers would have to share a limb and not to share it."""
    from skelgen.stages.limbs import LimbConstraints  # noqa: PLC0415 - loads the stage

    together, apart = _stated_of_limbs(project, correction)
    for one in earlier:
        share, part = _stated_of_limbs(project, one)
        together, apart = together + share, apart + part
        try:
            LimbConstraints(tuple(together), tuple(apart)).of_markers(project.trajectories.names)
        except InputError:
            return one
    return None


def _stated_of_limbs(project: Project, correction: Correction) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
    """Markers that share a limb by a correction, and markers that are all on different limbs."""
    names = tuple(project.trajectories.names[marker] for marker in _markers(project, correction))
    if correction.kind == "move":
        return [(*names[:2], *names[3:])], [(names[0], old) for old in names[2:3]]
    return [names] if correction.kind == "together" else [], [names] if correction.kind == "apart" else []


def joint_constraints(
    project: Project, options: RunOptions, monitor: Monitor, marker_set: str = "auto"
) -> JointConstraints:
    """Return what the corrections of a project and the options of a run say about the tree.

    Parameters
    ----------
    project : Project
        With limbs.
    options : RunOptions
        Their hierarchy and root take precedence over those of corrections.
    monitor : Monitor
        Receives a notice for each correction.
    marker_set : str
        A marker set that is worn, and whose tree is known; ``auto`` or ``none`` if the user does not say.

    Raises
    ------
    InputError
        If hierarchy and root are both given, a name is unknown, or the parents form a cycle.
    """
    from skelgen.stages.joints import JointConstraints  # noqa: PLC0415 - loads the stage

    of_person = {} if marker_set in {"auto", "none"} else joints_of_person(names_by_markers(project), project.limbs)
    stated: dict[tuple[int, int], bool] = {}
    limbs_called = project.limbs.limbs_called
    roots = [limb for limb in limbs_called("pelvis") if of_person or len(project.limbs.markers_of(limb)) > 1]
    for correction in corrections_of(project, "joints", monitor):
        limbs = _limbs(project, correction)
        if correction.kind == "root":
            roots.insert(0, limbs[0])
        else:
            stated[min(limbs), max(limbs)] = correction.kind == "join"
    for pairs, wanted in ((options.joined, True), (options.parted, False)):
        stated |= dict.fromkeys((_limb_pair(project, pair) for pair in pairs), wanted)
    is_joint = of_person | stated
    if options.hierarchy is not None and options.root is not None:
        raise InputError("a hierarchy says which limb is the root: give either of both")
    if options.root is not None:
        roots = [*(limbs_called(options.root) or [_limb_called(project, options.root)]), *roots]
    names = project.limbs.names
    return JointConstraints(
        joined=tuple(pair for pair, wanted in is_joint.items() if wanted),
        parted=tuple(pair for pair, wanted in is_joint.items() if not wanted),
        parents=None if options.hierarchy is None else parents_from_names(names, _by_name(names, options.hierarchy)),
        roots=roots,
        of_person=tuple(pair for pair in of_person if pair not in stated),
    )


def _by_name(names: Sequence[str], hierarchy: Mapping[str, str]) -> dict[str, str]:
    """A hierarchy in which limbs that are called limb0, limb1 and so on have their names."""
    named = {f"limb{limb}": name for limb, name in enumerate(names)} | {name: name for name in names}
    return {named.get(child, child): named.get(parent, parent) for child, parent in hierarchy.items()}


def joint_types(project: Project, monitor: Monitor) -> dict[int, str]:
    """Return the types of joints that corrections state, by the child limb of the joint.

    Parameters
    ----------
    project : Project
        With a tree.
    monitor : Monitor
        Receives a notice for each correction, and for those that name no joint of the tree.
    """
    types: dict[int, str] = {}
    parents = project.topology.parents
    for correction in (one for one in corrections_of(project, "skeleton", monitor) if one.kind == "kind"):
        first, second = _limbs(project, correction)
        if parents[second] == first:
            types[second] = correction.value
        elif parents[first] == second:
            types[first] = correction.value
        else:
            monitor.notice(f"not applied, because the tree has no such joint: {correction.sentence}")
    return types


def worn_set(project: Project, marker_set: str) -> MarkerSet | None:
    """Return the marker set that a take wears, or None if it wears none that is known.

    Parameters
    ----------
    project : Project
        With labels.
    marker_set : str
        The set that the user states; ``auto`` finds it by the names of markers, ``none`` takes none.

    Raises
    ------
    InputError
        If a set is stated of which the take has less than half, or of which names do not say who wears it.
    """
    from skelgen.stages.names import find_marker_set, recognised_set  # noqa: PLC0415 - reads tables

    names = project.trajectories.names
    if marker_set in {"auto", "none"}:
        return recognised_set(names) if marker_set == "auto" and names else None
    worn = find_marker_set(marker_set, names)
    if 2 * len(worn.segments) < worn.n_markers:
        n_there = f"{len(worn.segments)} of its {worn.n_markers} markers"
        raise InputError(f"the marker set {marker_set} is not worn: the take has {n_there}")
    worn.check_wearers()
    return worn


def _markers_of_segments(worn: MarkerSet) -> list[tuple[str, ...]]:
    """The markers of each segment of each person who wears a set."""
    segments: dict[tuple[str, str], list[str]] = {}
    for marker, segment in worn.segments.items():
        segments.setdefault((worn.wearers[marker], segment), []).append(marker)
    return [tuple(markers) for markers in segments.values()]


def _markers_of_wearers(worn: MarkerSet) -> tuple[tuple[str, ...], ...]:
    """The markers of each person, if several wear a set."""
    persons: dict[str, list[str]] = {}
    for marker, wearer in worn.wearers.items():
        persons.setdefault(wearer, []).append(marker)
    return tuple(map(tuple, persons.values())) if len(persons) > 1 else ()


def names_by_markers(project: Project) -> tuple[str, ...]:
    """Names of limbs by those of their markers; the user's names do not count."""
    from skelgen.stages.names import find_marker_set, name_limbs, recognised_set  # noqa: PLC0415 - reads tables

    markers, report = project.trajectories.names, project.reports.get("limbs")
    stated = str(report.parameters.get("marker_set", "auto")) if report else "auto"
    worn = recognised_set(markers) if stated in {"auto", "none"} else find_marker_set(stated, markers)
    return name_limbs(project.limbs, markers, worn)


def joints_of_person(names: Sequence[str], limbs: Limbs) -> dict[tuple[int, int], bool]:
    """Return the joints of each person; a missing segment is passed over unless a limb without a name may be it.

    Parameters
    ----------
    names : sequence of str, length n_limbs
        Of segments, in the order of the limbs.
    limbs : Limbs
        Which body each is on.
    """
    from skelgen.stages.names import PARENTS  # noqa: PLC0415 - reads tables

    bodies = limbs.body_of_limb.tolist()
    limb_of = {(bodies[limb], body_and_limb(name)[1]): limb for limb, name in enumerate(names)}
    has_unknown = {bodies[limb] for limb, name in enumerate(names) if body_and_limb(name)[1] == f"limb{limb}"}
    joints = {}
    for (body, name), limb in limb_of.items():
        parent = PARENTS.get(name, "")
        while parent and (body, parent) not in limb_of and body not in has_unknown:
            parent = PARENTS.get(parent, "")
        if (body, parent) in limb_of:
            pair = limb, limb_of[body, parent]
            joints[min(pair), max(pair)] = True
    return joints


def corrections_of(project: Project, stage: str, monitor: Monitor) -> list[Correction]:
    """Return the corrections that a stage obeys and that name markers.

    Parameters
    ----------
    project : Project
        With or without corrections.
    stage : str
        ``labels``, ``limbs``, ``joints`` or ``skeleton``.
    monitor : Monitor
        Receives a notice for each of them.
    """
    applied = [correction for correction in project.corrections if correction.stage == stage]
    for correction in applied:
        monitor.notice(f"as stated: {correction.sentence}")
    return [correction for correction in applied if correction.names]


def corrected_marker(trajectories: Trajectories, correction: Correction, which: int) -> int:
    """Return the index of a marker that a correction names; raise `InputError` if it does not exist.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    correction : Correction
        The statement.
    which : int
        Index into its names.
    """
    none, positions = np.empty((0, 3)), trajectories.positions
    return named_marker(correction, which, trajectories.names, lambda f: positions[f] if f < len(positions) else none)


def _limb_called(project: Project, name: str) -> int:
    names, on_limbs = project.limbs.names, project.limbs.limb_of_marker.tolist()
    limb_of = dict(zip(project.trajectories.names, on_limbs, strict=True))
    limb_of |= {f"limb{limb}": limb for limb in range(len(names))} | {one: limb for limb, one in enumerate(names)}
    limb = int(limb_of.get(name, -1))
    if limb < 0:
        raise InputError(f"there is no limb {name!r}; limbs are {', '.join(names)}")
    return limb


def _limb_pair(project: Project, names: Sequence[str]) -> tuple[int, int]:
    if isinstance(names, str) or not isinstance(names, Sequence) or len(names) != 2:
        raise InputError(f"{names!r} where the names of two limbs belong")
    first, second = sorted(_limb_called(project, name) for name in names)
    if first == second:
        raise InputError(f"{names[0]!r} and {names[1]!r} are the same limb; a joint connects two limbs")
    return first, second


def _markers(project: Project, correction: Correction) -> list[int]:
    return [corrected_marker(project.trajectories, correction, which) for which in range(len(correction.names))]


def _limbs(project: Project, correction: Correction) -> list[int]:
    limbs = [int(project.limbs.limb_of_marker[marker]) for marker in _markers(project, correction)]
    for name, limb in zip(correction.names, limbs, strict=True):
        if limb < 0:
            raise InputError(f"the correction '{correction.sentence}' names {name}, which is on no limb; take it back")
    if len(limbs) == 2 and limbs[0] == limbs[1]:
        why = f"is about a joint, but {' and '.join(correction.names)} share a limb now"
        raise InputError(f"the correction '{correction.sentence}' {why}; take it back")
    return limbs
