"""The graph of joint costs: descriptions of joints, places of limbs and of words, and what lies under the pointer."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from skelgen.app.drawing.graph import CostGraph, JointCost, find_cost_graph
from skelgen.app.drawing.measures import tidy_places
from skelgen.app.drawing.poses import find_views, left_side, reference_markers
from skelgen.app.drawing.wording import digits, fixed, whole_percent
from skelgen.kinematics.hierarchy import tree_path
from skelgen.model import Project
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import listed
from skelgen_gui.model import translate
from skelgen_gui.model.selection import distances_to_lines

_SAMPLES = 200  # frames that determine which way is up
_ROUNDS = 60  # of pushing limbs apart; more than enough for 100 limbs
_WIDEST = 1.6  # factor
_APART = 1.1  # of the mean distance that limbs on a grid would have

GAP = 10.0
"""px, from the middle of a joint to the nearest corner or side of its words."""

# Directions that are tried, the first of equally good ones is taken
_SIDES = np.array([[1, 0], [-1, 0], [0, -1], [0, 1], [1, -1], [1, 1], [-1, -1], [-1, 1]], dtype=np.float64)

_ALONG = np.linspace(0.0, 1.0, 24)  # parts of a line that are looked at

# What it costs to touch a disc, the words of another joint, or a point of a line
_ON_DISC, _ON_WORDS, _ON_LINE = 10.0, 10.0, 1.0


def margin_label(joint: JointCost) -> str:
    """Say how likely the joint's limbs are neighbours, or how many times dearer the best other joint is."""
    if np.isfinite(joint.probability):
        return whole_percent(joint.probability)
    return f"{digits(joint.ratio, 2)}×" if np.isfinite(joint.ratio) else ""


def joint_sentences(joint: JointCost, names: Sequence[str] = ()) -> str:
    """Describe a joint of the tree, a line for each fact.

    Parameters
    ----------
    joint : JointCost
        Which one.
    names : sequence of str
        What the limbs are called; by default their numbers.
    """
    lines = [_pair((joint.parent, joint.child), names) + (": " + translate("Graph", joint.kind) if joint.kind else "")]
    lines.append(translate("Graph", "cost {0} mm²").format(digits(joint.cost)))
    if joint.rival is None:
        lines.append(translate("Graph", "no other joint could connect the two sides"))
    else:
        best = translate("Graph", "best other joint: {0}, {1} mm²")
        lines.append(best.format(_pair(joint.rival, names), digits(joint.cost + joint.margin)))
        lines.append(translate("Graph", "margin {0} mm²").format(digits(joint.margin)))
    if np.isfinite(joint.probability):
        sure = translate("Graph", "probability {0:.0f} %, of the other {1:.0f} %")
        lines.append(sure.format(100 * joint.probability, 100 * joint.rival_probability))
    for angle in joint.ranges:
        low, high = (fixed(float(np.degrees(end)), 0) for end in (angle.low, angle.high))
        lines.append(f"{angle.name}: {low}° … {high}°")
    return "\n".join(lines)


def pair_sentences(graph: CostGraph, first: int, second: int, names: Sequence[str] = ()) -> str:
    """Say why the tree does not join two limbs.

    Parameters
    ----------
    graph : CostGraph
        The graph.
    first, second : int
        Limbs.
    names : sequence of str
        What the limbs are called; by default their numbers.
    """
    topology = graph.topology
    lines = [translate("Graph", "{0}: not in the tree").format(_pair((first, second), names))]
    lines.append(translate("Graph", "cost {0} mm²").format(digits(float(topology.joint_costs[first, second]))))
    if (first, second) in topology.loops or (second, first) in topology.loops:
        lines.append(translate("Graph", "seems to be a joint as well: it closes a kinematic loop"))
    path = tree_path(topology.parents, first, second)
    if not path:
        return "\n".join([*lines, translate("Graph", "the two limbs belong to separate bodies")])
    dearest = max(float(topology.joint_costs[one, other]) for one, other in pairwise(path))
    between = listed([names[limb] if names else str(limb) for limb in path[1:-1]])
    joined = translate("Graph", "the tree joins them by way of {0}, at no joint for more than {1} mm²")
    return "\n".join([*lines, joined.format(between, digits(dearest))])


def _pair(limbs: tuple[int, int], names: Sequence[str]) -> str:
    if not names:
        return translate("Graph", "limb {0} – limb {1}").format(*limbs)
    return translate("Graph", "{0} – {1}").format(*(names[limb] for limb in limbs))


def find_graph(project: Project) -> tuple[CostGraph, tuple[Floats, Floats]]:
    """Return the graph of a project with joints, and the limbs' places as in the take and as a tree."""
    return find_cost_graph(project), (body_places(project), tree_places(project.topology.parents))


def body_places(project: Project) -> Floats:
    """Place limbs as they are seen from the front in the reference pose, or in the frame that shows most markers.

    Parameters
    ----------
    project : Project
        With limbs.

    Returns
    -------
    ndarray, shape (n_limbs, 2)
        In a box of 0 .. 1, right and down, slender bodies a little wider, no two limbs upon each other.
    """
    trajectories = project.trajectories
    markers = np.asarray(trajectories.positions[int(trajectories.seen.sum(axis=1).argmax())])
    if project.has("skeleton"):
        markers = reference_markers(project.skeleton)
    limb_of_marker, n_limbs = project.limbs.limb_of_marker, project.limbs.n_limbs
    known = (limb_of_marker >= 0) & ~np.isnan(markers[:, 0])
    if not known.any():
        return np.full((n_limbs, 2), 0.5)
    counts = np.bincount(limb_of_marker[known], minlength=n_limbs)
    sums = np.zeros((n_limbs, 3))
    np.add.at(sums, limb_of_marker[known], markers[known])
    middle = markers[known].mean(axis=0)
    centres = np.where(counts[:, np.newaxis] > 0, sums / np.maximum(counts, 1)[:, np.newaxis], middle)
    sample = trajectories.positions[:: max(trajectories.n_frames // _SAMPLES, 1)]
    left = left_side(project.skeleton) if project.has("skeleton") else None
    view = find_views(markers[known], sample, left)[0]
    return _apart(_widened(_boxed(centres @ np.stack([view.across, -view.up], axis=1))))


def tree_places(parents: Ints) -> Floats:
    """Place limbs as a tree with its roots above, in a box of 0 .. 1, shape (n_limbs, 2)."""
    depths, rows = tidy_places(parents)
    places = np.stack([rows, depths.astype(np.float64)], axis=1)
    return np.asarray((places + 0.5) / (places.max(axis=0) + 1.0))


def _boxed(places: Floats) -> Floats:
    """Places in a box of 0 .. 1, with their proportions."""
    low, high = places.min(axis=0), places.max(axis=0)
    size = max(float((high - low).max()), np.finfo(np.float64).tiny)
    return np.asarray(0.5 + (places - (low + high) / 2) / size)


def _widened(places: Floats) -> Floats:
    """Draw slender bodies wider, as far as there is room: their limbs would hide each other."""
    width = max(float(np.ptp(places[:, 0])), np.finfo(np.float64).tiny)
    return np.asarray(0.5 + (places - 0.5) * [min(_WIDEST, max(1.0 / width, 1.0)), 1.0])


def _apart(places: Floats) -> Floats:
    """Push limbs apart that lie too near to be distinguished."""
    n_limbs = len(places)
    least = _APART / np.sqrt(n_limbs) / 2
    turn = np.arange(n_limbs) * 2.4  # different directions for limbs on the same place
    places = places + 1e-6 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    for _ in range(_ROUNDS):
        between = places[:, np.newaxis] - places
        distance = np.linalg.norm(between, axis=2)
        np.fill_diagonal(distance, np.inf)
        push = np.maximum(least - distance, 0.0) / 2
        places = places + (between / distance[..., np.newaxis] * push[..., np.newaxis]).sum(axis=1)
    return _boxed(places)


def place_words(
    middles: Floats, sizes: Floats, discs: Floats, radius: float, lines: Floats, gaps: Floats | float = GAP
) -> Floats:
    """Place words beside joints and limbs, one after the other.

    Parameters
    ----------
    middles : ndarray, shape (n, 2), px
        Joints, and limbs.
    sizes : ndarray, shape (n, 2), px
        Width and height of their words; 0 without any.
    discs : ndarray, shape (n_discs, 2), px
        What must not be covered.
    radius : float, px
        Of the discs.
    lines : ndarray, shape (n_lines, 2, 2), px
        What had better not be covered.
    gaps : ndarray, shape (n,), or float, px
        From each middle to the nearest corner or side of its words.

    Returns
    -------
    ndarray, shape (n, 2), px
        Middle of the words of each.
    """
    dots = (lines[:, :1] + (lines[:, 1:] - lines[:, :1]) * _ALONG[:, np.newaxis]).reshape(-1, 2)
    placed, gaps = np.array(middles, dtype=np.float64), np.broadcast_to(gaps, len(middles))
    for index in np.flatnonzero(sizes[:, 0] > 0):
        half = sizes[index] / 2
        tried = middles[index] + _SIDES * (gaps[index] + half)
        costs = _ON_DISC * _touched(tried, half + radius, discs) + _ON_LINE * _touched(tried, half, dots)
        earlier = np.flatnonzero(sizes[:index, 0] > 0)
        for other in earlier:
            costs += _ON_WORDS * _touched(tried, half + sizes[other] / 2, placed[other][np.newaxis])
        placed[index] = tried[int(np.argmin(costs))]
    return placed


def _touched(boxes: Floats, half: Floats, places: Floats) -> Floats:
    """Count the places in each box, given by middles and half sizes."""
    inside = np.abs(places - boxes[:, np.newaxis]) < half
    return np.asarray(inside.all(axis=2).sum(axis=1), dtype=np.float64)


def nearest_point(points: Floats, at: Floats, most: float) -> int | None:
    """Return the index of the nearest point within a distance, or None.

    Parameters
    ----------
    points : ndarray, shape (n, 2), px
        Places.
    at : ndarray, shape (2,), px
        From where.
    most : float, px
        How far it may be.
    """
    return _nearest(np.linalg.norm(points - at, axis=1), most)


def nearest_line(ends: Floats, at: Floats, most: float) -> int | None:
    """Return the index of the nearest line within a distance, or None.

    Parameters
    ----------
    ends : ndarray, shape (n, 2, 2), px
        Both ends of each line.
    at : ndarray, shape (2,), px
        From where.
    most : float, px
        How far it may be.
    """
    return _nearest(distances_to_lines(ends, at), most)


def _nearest(distances: Floats, most: float) -> int | None:
    if not len(distances) or distances.min() > most:
        return None
    return int(distances.argmin())
