"""What pictures and tables state of a project, as plain numbers: orders, deviations, lengths, matrices."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from skelgen.app.drawing.scales import LogScale, ramp_rgba
from skelgen.model import Limbs, Motion, Project, Topology, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.skeleton import joint_between


def joint_called(project: Project, joint: int) -> str:
    """Return what a joint is called, such as ``left elbow``; empty if neither limb that it joins has a name.

    Parameters
    ----------
    project : Project
        With joints.
    joint : int
        Index of the joint.
    """
    given = project.skeleton.joints[joint].name if project.has("skeleton") else ""
    limbs, names = project.topology.edges[joint].tolist(), project.limbs.names
    if given or all(names[limb] == f"limb{limb}" for limb in limbs):
        return given
    return joint_between(*(names[limb] for limb in limbs))


@dataclass(frozen=True)
class MarkerDeviation:
    """How far one marker was measured from its place on the skeleton.

    Attributes
    ----------
    marker, limb : int
        Indices; limb -1 = left out.
    name : str
        Label.
    mean, rms, largest : float, mm
        Over the frames in which the marker was seen; NaN if it never was or is left out.
    seen : float
        Share of the frames in which it was seen, 0 .. 1.
    """

    marker: int
    limb: int
    name: str
    mean: float
    rms: float
    largest: float
    seen: float


@dataclass(frozen=True, eq=False)
class Length:
    """The distance between two joints of one limb.

    Attributes
    ----------
    limb, first, second : int
        The limb, and the two joints as indices.
    rigid, std : float, mm
        Distance in the rigid skeleton, and its standard deviation; NaN before it is fitted, or where not estimated.
    raw_mean, spread : float, mm
        Mean and standard deviation over frames of the distance between the raw joint positions.
    deviations : ndarray, shape (n,), mm
        Raw distance minus the rigid (or mean) length, in the frames in which both joints are known.
    """

    limb: int
    first: int
    second: int
    rigid: float
    std: float
    raw_mean: float
    spread: float
    deviations: Floats


def branch_order(parents: Ints) -> list[int]:
    """Return the limbs root first and branch by branch (depth first), so that neighbours stay near.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for a root.
    """
    order: list[int] = []
    stack = [int(root) for root in np.flatnonzero(parents < 0)[::-1]]
    while stack:
        limb = stack.pop()
        order.append(limb)
        stack.extend(int(child) for child in np.flatnonzero(parents == limb)[::-1])
    return order


def tidy_places(parents: Ints) -> tuple[Ints, Floats]:
    """Place a tree tidily: leaves in rows of their own, every other limb in the middle of its children.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for a root.

    Returns
    -------
    depths : ndarray of intp, shape (n_limbs,)
        Joints between each limb and its root.
    rows : ndarray, shape (n_limbs,)
        Branch by branch from 0.
    """
    rows = np.zeros(len(parents))
    depths = np.zeros(len(parents), dtype=np.intp)
    order = branch_order(parents)
    leaves = [limb for limb in order if not (parents == limb).any()]
    rows[leaves] = np.arange(len(leaves))
    for limb in order:
        depths[limb] = depths[parents[limb]] + 1 if parents[limb] >= 0 else 0
    for limb in reversed(order):
        children = np.flatnonzero(parents == limb)
        if len(children):
            rows[limb] = (rows[children].min() + rows[children].max()) / 2
    return depths, rows


def limb_order(project: Project) -> list[int]:
    """Return the limbs in the order of the tree where it is known, otherwise by index."""
    if project.has("joints"):
        return branch_order(project.topology.parents)
    return list(range(project.limbs.n_limbs))


def subtree_markers(project: Project) -> Ints:
    """Return the marker order of every picture: by limb where limbs are known, otherwise by index."""
    if not project.has("limbs"):
        return np.arange(project.trajectories.n_markers)
    parts = [np.flatnonzero(project.limbs.limb_of_marker == limb) for limb in [*limb_order(project), -1]]
    return np.concatenate(parts).astype(np.intp)


def marker_deviations(trajectories: Trajectories, limbs: Limbs, motion: Motion, order: Ints) -> list[MarkerDeviation]:
    """Return the deviation of every marker, in the given order.

    Parameters
    ----------
    trajectories : Trajectories
        Measured markers.
    limbs : Limbs
        Their limbs.
    motion : Motion
        Of the fitted skeleton.
    order : ndarray of intp, shape (n,)
        Markers.
    """
    seen = trajectories.seen.mean(axis=0) if trajectories.n_frames else np.zeros(trajectories.n_markers)
    rows = []
    for marker in order.tolist():
        values = _known(motion.residuals[:, marker])
        mean, rms, largest = spread_of(values)
        limb, name = int(limbs.limb_of_marker[marker]), trajectories.names[marker]
        rows.append(MarkerDeviation(marker, limb, name, mean, rms, largest, float(seen[marker])))
    return rows


def spread_of(values: Floats) -> tuple[float, float, float]:
    """Return mean, root mean square and largest of values; NaN three times where there are none.

    Parameters
    ----------
    values : ndarray, shape (n,)
        None of them NaN.
    """
    if not len(values):
        return np.nan, np.nan, np.nan
    return float(values.mean()), float(np.sqrt((values**2).mean())), float(values.max())


def residual_per_frame(motion: Motion) -> tuple[Floats, Floats]:
    """Return mean and largest residual [mm] of each frame, each of shape (n_frames,); NaN where nothing is seen."""
    known = ~np.isnan(motion.residuals)
    counts = known.sum(axis=1)
    filled = np.where(known, motion.residuals, 0.0)
    nothing = counts == 0
    mean = np.where(nothing, np.nan, filled.sum(axis=1) / np.maximum(counts, 1))
    largest = np.where(nothing, np.nan, filled.max(axis=1, initial=0.0))
    return mean, largest


def worst_residual(motion: Motion) -> tuple[int, int]:
    """Return frame and marker of the largest residual."""
    place = int(np.nanargmax(motion.residuals))
    frame, marker = np.unravel_index(place, motion.residuals.shape)
    return int(frame), int(marker)


def joint_lengths(project: Project) -> list[Length]:
    """Return the distance between each two joints of a limb, limb after limb in the order of the tree."""
    topology = project.topology
    rigid = project.skeleton.lengths if project.has("skeleton") else {}
    stds = project.skeleton.length_std if rigid else None
    known = dict(zip(rigid, np.full(len(rigid), np.nan) if stds is None else stds, strict=True))
    lengths: list[Length] = []
    for limb in limb_order(project):
        joints = np.flatnonzero((topology.edges == limb).any(axis=1)).tolist() if topology.n_joints else []
        for pair in combinations(joints, 2):
            lengths.append(_length(topology, limb, pair, (rigid.get(pair, np.nan), float(known.get(pair, np.nan)))))
    return lengths


def _length(topology: Topology, limb: int, pair: tuple[int, int], rigid: tuple[float, float]) -> Length:
    raw = topology.raw_joint_positions
    distances = _known(np.linalg.norm(raw[:, pair[0]] - raw[:, pair[1]], axis=1))
    mean = float(distances.mean()) if len(distances) else np.nan
    spread = float(distances.std()) if len(distances) else np.nan
    centre = mean if np.isnan(rigid[0]) else rigid[0]
    return Length(limb, *pair, *rigid, mean, spread, distances - centre)


def bone_length(lengths: list[Length], topology: Topology, joint: int) -> float:
    """Return the length [mm] of the parent limb from its own parent joint to `joint`; NaN where that is a root.

    Parameters
    ----------
    lengths : list of Length
        From `joint_lengths`.
    topology : Topology
        The tree.
    joint : int
        Index of the joint.
    """
    own = np.flatnonzero(topology.children == topology.edges[joint, 0])
    if not len(own):
        return np.nan
    pair = {int(own[0]), joint}
    found = next(length for length in lengths if {length.first, length.second} == pair)
    return found.raw_mean if np.isnan(found.rigid) else found.rigid


def _known(values: Floats) -> Floats:
    return values[~np.isnan(values)]


@dataclass(frozen=True, eq=False)
class DeviationMatrix:
    """The matrix of distance deviations, ordered by limb.

    Attributes
    ----------
    markers, limbs : ndarray of intp, shape (n,)
        Marker of each row and column, and its limb; -1 = none.
    names : tuple of str, length n
        Names of the markers.
    limb_names : tuple of str, length n_limbs
        What all limbs are called.
    values : ndarray, shape (n, n), mm
        NaN where two markers are never seen together, 0 on the diagonal.
    scale : LogScale
        Scale of the colours [mm].
    """

    markers: Ints
    limbs: Ints
    names: tuple[str, ...]
    limb_names: tuple[str, ...]
    values: Floats
    scale: LogScale

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.markers)

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """A pixel for each cell, shape (n, n, 4): red, green, blue, opacity."""
        return ramp_rgba(self.scale.fractions(self.values))

    @property
    def borders(self) -> list[int]:
        """Rows at which limbs begin, and `n`."""
        return [0, *(np.flatnonzero(np.diff(self.limbs)) + 1).tolist(), self.n] if self.n else [0]


def find_deviation_matrix(project: Project) -> DeviationMatrix:
    """Return the matrix of a project with limbs."""
    markers = subtree_markers(project)
    values = project.limbs.distance_deviation[np.ix_(markers, markers)].copy()
    np.fill_diagonal(values, 0.0)
    names = tuple(project.trajectories.names[marker] for marker in markers.tolist())
    limbs, called = project.limbs.limb_of_marker[markers], map(project.limbs.called, range(project.limbs.n_limbs))
    return DeviationMatrix(markers, limbs, names, tuple(called), values, LogScale.of(values))
