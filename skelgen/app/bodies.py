"""One project per body of a take that shows several, and one of several bodies that were calibrated each by itself."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from skelgen.app.outputs import stem_of
from skelgen.errors import WriteError
from skelgen.kinematics.inverse.motion import MotionAngles
from skelgen.model import Joint, Limbs, Motion, Project, Skeleton, StageReport, Topology, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.limbs import BODY_END
from skelgen.model.project import Body
from skelgen.model.topology import joint_children

_Writable = TypeVar("_Writable")

BODY = "{body}"
"""In the path of a file: stands for the name of a body, each of which gets a file of its own."""

_WORD = re.compile(r"(?<!\$)\{[^{}]*\}")
"""A word in braces; behind a $ it is a variable of some shell, and stays as it is."""

_FORBIDDEN = re.compile(r'[\\/:*?"<>|\0]')
"""What some system does not take in the name of a file."""


def split_bodies(project: Project) -> tuple[Project, ...]:
    """Return a project for each body, with its markers, limbs, joints and motion; nothing is computed anew.

    Parameters
    ----------
    project : Project
        With joints, as `skelgen.reconstruct` makes it.

    Returns
    -------
    tuple of Project
        In the order of `project.bodies`, called ``walk_body1``, ``walk_body2`` and so on. A project of one body is
        returned as it is.

    Examples
    --------
    >>> import skelgen
    >>> two = skelgen.reconstruct(skelgen.simulate("rods", n_frames=200, subjects=2, seed=1).take)
    >>> [body.skeleton.n_limbs for body in skelgen.split_bodies(two)]
    [3, 3]
    """
    bodies = project.bodies
    return (project,) if len(bodies) == 1 else tuple(_one_body(project, body) for body in bodies)


def body_files(value: _Writable, path: Path) -> tuple[tuple[_Writable | Project, Path], ...]:
    """Return what is written to which file: each body of a project by itself where the path says so.

    Parameters
    ----------
    value : Project or other
        What is to be written.
    path : Path
        The file; ``{body}`` in its name or in that of a folder stands for ``body1``, ``body2`` and so on, or for the
        names of the calibrated skeletons.

    Raises
    ------
    WriteError
        If the path has other words in braces, or bodies are asked for where none have been found.
    """
    _check_braces(path)
    if BODY not in str(path):
        return ((value, path),)
    if not isinstance(value, Project) or not value.has("joints"):
        what = "this project" if isinstance(value, Project) else "a take"
        raise WriteError(f"{path}: bodies are found by their joints, which {what} has not; run the stages first")
    names = [_FORBIDDEN.sub("_", body.name).strip(". ") for body in value.bodies]
    if len(set(names)) < len(names) or "" in names:
        names = [f"body{number}" for number in range(1, len(names) + 1)]
    files = [Path(str(path).replace(BODY, name)) for name in names]
    return tuple(zip(split_bodies(value), files, strict=True))


def _check_braces(path: Path) -> None:
    """Raise `WriteError` if a new file or folder has another word in braces than ``{body}`` in its name."""
    new = [] if path.exists() else [path.name, *(folder.name for folder in path.parents if not folder.exists())]
    unknown = [word for name in new for word in _WORD.findall(name) if word != BODY]
    if unknown:
        raise WriteError(f"{path}: {unknown[0]} stands for nothing; {BODY} stands for the name of each body")


def join_bodies(projects: Sequence[Project], files: Sequence[Path | None] = ()) -> Project:
    """Return one project with the bodies of several takes, as the subject of a take that shows them together.

    Parameters
    ----------
    projects : sequence of Project
        Calibrated takes of markers, with skeletons. The names of limbs begin with that of their take without its
        suffix, and those of markers do unless all differ.
    files : sequence of Path or None, optional
        Project file or folder of each; it gives the name where takes have one name.

    Returns
    -------
    Project
        All markers, limbs and joints, one body after the other. Shorter takes are stretched to the frames of the
        longest: their poses do not belong together.
    """
    n_frames = max(project.take.n_frames for project in projects)
    takes = [project.trajectories for project in projects]
    frames = [np.linspace(0, take.n_frames - 1, n_frames).round().astype(np.intp) for take in takes]
    titles = _titles(projects, files)
    positions = np.concatenate([take.positions[shown] for take, shown in zip(takes, frames, strict=True)], axis=1)
    names = _distinct_names([take.names for take in takes], titles)
    joined = Trajectories(positions, names, takes[0].rate, " + ".join(titles))
    skeleton = _joined_skeletons(projects, titles)
    motion = _joined_motions(projects, frames, skeleton)
    body_of_limb = np.repeat(np.arange(len(projects)), [project.skeleton.n_limbs for project in projects])
    deviation = np.full((len(names), len(names)), np.nan)
    limbs = Limbs(skeleton.limb_of_marker, deviation, skeleton.limb_names, body_of_limb=body_of_limb)
    costs = np.where(np.eye(len(body_of_limb)) > 0, 0.0, np.nan)
    no_steps, no_values = np.zeros(skeleton.n_joints, dtype=np.intp), np.full(skeleton.n_joints, np.nan)
    topology = Topology(skeleton.parents, costs, motion.joint_positions, no_steps, no_values, alpha=0.0)
    report = StageReport()
    project = Project(joined).with_trajectories(joined, report).with_limbs(limbs, report)
    return project.with_topology(topology, report).with_skeleton(skeleton, motion, report)


def _titles(projects: Sequence[Project], files: Sequence[Path | None]) -> list[str]:
    """Names of takes, or of their files where takes have one name; names that are empty or used twice are numbered."""
    takes = [stem_of(project.name) for project in projects]
    titles = [
        take if file is None or takes.count(take) == 1 else stem_of(file.absolute())
        for take, file in zip(takes, files or [None] * len(takes), strict=True)
    ]
    return [
        title if title and titles.count(title) == 1 else f"{title or 'body'} {number}"
        for number, title in enumerate(titles, start=1)
    ]


def _distinct_names(names: Sequence[Sequence[str]], titles: Sequence[str]) -> tuple[str, ...]:
    every = [name for some in names for name in some]
    if len(set(every)) == len(every):
        return tuple(every)
    return _with_titles(names, titles)


def _with_titles(names: Sequence[Sequence[str]], titles: Sequence[str]) -> tuple[str, ...]:
    return tuple(title + BODY_END + name for title, some in zip(titles, names, strict=True) for name in some)


def _joined_skeletons(projects: Sequence[Project], titles: Sequence[str]) -> Skeleton:
    skeletons = [project.skeleton for project in projects]
    firsts = np.cumsum([0, *(skeleton.n_limbs for skeleton in skeletons)])[:-1].tolist()
    begins = [title + BODY_END for title in titles]

    def placed(which: str) -> list[Ints]:
        values = [getattr(skeleton, which) for skeleton in skeletons]
        return [np.where(value < 0, -1, value + first) for value, first in zip(values, firsts, strict=True)]

    def of_all(which: str) -> Floats | None:
        values = [getattr(skeleton, which) for skeleton in skeletons]
        return None if any(value is None for value in values) else np.concatenate(values)

    def moved(which: str) -> list[Joint]:
        return [
            replace(
                joint, parent=joint.parent + first, child=joint.child + first, name=joint.name and title + joint.name
            )
            for skeleton, first, title in zip(skeletons, firsts, begins, strict=True)
            for joint in getattr(skeleton, which)
        ]

    parents = np.concatenate(placed("parents"))
    by_child = {joint.child: joint for joint in moved("joints")}
    return Skeleton(
        parents=parents,
        joints=tuple(by_child[child] for child in joint_children(parents).tolist()),
        limb_of_marker=np.concatenate(placed("limb_of_marker")),
        marker_offsets=np.concatenate([skeleton.marker_offsets for skeleton in skeletons]),
        marker_std=np.concatenate([skeleton.marker_std for skeleton in skeletons]),
        reference_pose=np.concatenate([skeleton.reference_pose for skeleton in skeletons]),
        offset_std=of_all("offset_std"),
        length_std=of_all("length_std"),
        marker_noise=of_all("marker_noise"),
        loops=tuple(moved("loops")),
        limb_names=_with_titles([skeleton.limb_names for skeleton in skeletons], titles),
    )


def _joined_motions(projects: Sequence[Project], frames: Sequence[Ints], skeleton: Skeleton) -> Motion:
    motions = [(project.motion, shown) for project, shown in zip(projects, frames, strict=True)]

    def side_by_side(which: str) -> NDArray[Any]:
        return np.concatenate([getattr(motion, which)[shown] for motion, shown in motions], axis=1)

    world_from_limb = side_by_side("world_from_limb")
    children = [joint.child for joint in skeleton.joints]
    return Motion(
        world_from_limb=world_from_limb,
        joint_positions=world_from_limb[:, children][..., :3, 3],
        marker_positions=side_by_side("marker_positions"),
        residuals=side_by_side("residuals"),
        limb_seen=side_by_side("limb_seen"),
        rate=motions[0][0].rate,
    )


def _one_body(project: Project, body: Body) -> Project:
    take, limbs = project.trajectories, project.limbs
    names = tuple(take.names[marker] for marker in body.markers)
    own = Trajectories(take.positions[:, body.markers], names, take.rate, f"{project.name}_{body.name}")
    membership = None if limbs.membership is None else limbs.membership[np.ix_(body.markers, body.limbs)]
    of_body = Limbs(
        _renumbered(limbs.limb_of_marker[body.markers], body.limbs),
        limbs.distance_deviation[np.ix_(body.markers, body.markers)],
        _own_names([limbs.names[limb] for limb in body.limbs], body),
        membership,
    )
    found = Project(own, project.seed, source=project.source).with_trajectories(own, project.reports["labels"])
    found = found.with_limbs(of_body, project.reports["limbs"])
    joints = np.flatnonzero(np.isin(project.topology.children, body.limbs))
    found = found.with_topology(_topology(project.topology, body, joints), project.reports["joints"])
    if not project.has("skeleton"):
        return found
    skeleton = _skeleton(project.skeleton, body, joints)
    motion = _motion(project.motion, body, joints, MotionAngles(skeleton, own.positions))
    return found.with_skeleton(skeleton, motion, project.reports["skeleton"])


def _own_names(names: Sequence[str], body: Body) -> tuple[str, ...]:
    """Names of limbs without that of the body before them, unless two would be the same."""
    own = tuple(name.removeprefix(body.name + BODY_END) for name in names)
    return own if len(set(own)) == len(own) else tuple(names)


def _renumbered(indices: Ints, kept: Ints) -> Ints:
    """Replace each index by its position in `kept`, which rises; -1 stays -1."""
    return np.where(indices < 0, -1, np.searchsorted(kept, indices))


def _topology(topology: Topology, body: Body, joints: Ints) -> Topology:
    places = {int(limb): index for index, limb in enumerate(body.limbs)}
    loops = tuple((places[one], places[other]) for one, other in topology.loops if one in places and other in places)
    inside = [span for span in topology.spans if places.keys() >= set(span.limbs)]
    spans = tuple(replace(span, limbs=(places[span.limbs[0]], places[span.limbs[1]])) for span in inside)
    sure, rival = (
        None if values is None else values[joints] for values in (topology.edge_probability, topology.rival_probability)
    )
    return replace(
        topology,
        parents=_renumbered(topology.parents[body.limbs], body.limbs),
        joint_costs=topology.joint_costs[np.ix_(body.limbs, body.limbs)],
        raw_joint_positions=topology.raw_joint_positions[:, joints],
        n_iterations=topology.n_iterations[joints],
        values=topology.values[joints],
        loops=loops,
        edge_probability=sure,
        rival_probability=rival,
        spans=spans,
    )


def _skeleton(skeleton: Skeleton, body: Body, joints: Ints) -> Skeleton:
    places = {int(limb): index for index, limb in enumerate(body.limbs)}

    def moved(joint: Joint) -> Joint:
        name = joint.name.removeprefix(body.name + BODY_END)
        return replace(joint, parent=places[joint.parent], child=places[joint.child], name=name)

    offset_std, noise, length_std = skeleton.offset_std, skeleton.marker_noise, skeleton.length_std
    is_own = np.array([int(first) in set(joints.tolist()) for first, _ in skeleton.lengths], dtype=np.bool_)
    return Skeleton(
        parents=_renumbered(skeleton.parents[body.limbs], body.limbs),
        joints=tuple(moved(skeleton.joints[joint]) for joint in joints),
        limb_of_marker=_renumbered(skeleton.limb_of_marker[body.markers], body.limbs),
        marker_offsets=skeleton.marker_offsets[body.markers],
        marker_std=skeleton.marker_std[body.markers],
        reference_pose=skeleton.reference_pose[body.limbs],
        offset_std=None if offset_std is None else offset_std[body.markers],
        length_std=None if length_std is None else length_std[is_own],
        marker_noise=None if noise is None else noise[body.markers],
        loops=tuple(moved(joint) for joint in skeleton.loops if joint.parent in places),
        limb_names=_own_names([skeleton.limb_names[limb] for limb in body.limbs], body),
    )


def _motion(motion: Motion, body: Body, joints: Ints, angles: MotionAngles) -> Motion:
    return Motion(
        world_from_limb=motion.world_from_limb[:, body.limbs],
        joint_positions=motion.joint_positions[:, joints],
        marker_positions=motion.marker_positions[:, body.markers],
        residuals=motion.residuals[:, body.markers],
        limb_seen=motion.limb_seen[:, body.limbs],
        rate=motion.rate,
        joint_std=None if motion.joint_std is None else motion.joint_std[:, joints],
        compute_angles=angles,
    )
