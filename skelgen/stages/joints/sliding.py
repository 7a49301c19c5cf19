r"""Limbs that slide along each other, as the stages of a telescope or the axes of a gantry do.

No point is fixed in both, so that no joint of a tree holds them together, and one that is fitted nevertheless spoils
the limbs around it. A point of one stays on a line of the other, about which alone they turn, if at all: with u along
the line in the first limb and P the projection across it, :math:`P (R_f p_b + t_f - p_a) = 0` in every frame f, linear
in both points. The line is the axis about which the limbs turn most, or the direction in which they are shifted most.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from skelgen.kinematics.hierarchy import tree_path
from skelgen.kinematics.joints.closed_form import fit_fixed_point
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.joints.pairs import KEPT_PART, LEAST_TURN, JointGuess, expected_error, pose_noise
from skelgen.stages.joints.parameters import Pair
from skelgen.stages.joints.segments import ENOUGH_FRAMES, Segment, typical_variance

LEAST_ODDS = -2.0
"""Log odds that two limbs are neighbours below which what looks like sliding is chance, as of legs that swing alike."""

ON_LINE = 4.0
"""The same across the line: sliding explains what is seen up to here."""

SLIDES = 100.0
"""Times that, along the line: motion of ten standard deviations."""

LEAST_SINGULAR = 1e-3
"""Of the largest singular value: in directions that turn less, points stay at the middles of the limbs."""


def sliding_limbs(segments: Sequence[Segment], guesses: Mapping[Pair, JointGuess], odds: Floats) -> dict[Pair, float]:
    """Return the pairs of limbs that slide along each other and how far [mm], the nearest first.

    Parameters
    ----------
    segments : sequence of Segment
        All limbs, in the frames of the guesses.
    guesses : mapping of pair to JointGuess
        The joint between each two limbs; where noise explains its gap, nothing slides.
    odds : ndarray, shape (n_limbs, n_limbs)
        Log odds that limbs are neighbours.
    """
    typical = typical_variance(segments)
    found = {}
    for first, second in guesses:
        if odds[first, second] >= LEAST_ODDS and guesses[first, second].is_unexplained:
            distance = sliding_range(segments[first], segments[second], typical)
            if distance > 0:
                found[first, second] = distance
    return dict(sorted(found.items(), key=lambda item: _distance(*(segments[limb] for limb in item[0]))))


def sliding_loop_notices(slides: Mapping[Pair, float], parents: Ints, loops: Sequence[Pair]) -> Iterator[str]:
    """Say which limbs slide along each other although a tree joins them, where no loop of other joints explains it.

    Parameters
    ----------
    slides : mapping of pair to float
        From `sliding_limbs`.
    parents : ndarray of intp, shape (n_limbs,)
        The tree, -1 for roots.
    loops : sequence of pairs of int
        Limbs that share a joint beyond the tree: those of a parallelogram seem to slide, too.
    """
    in_loops = {limb for pair in loops for limb in tree_path(parents, *pair)}
    for (first, second), far in slides.items():
        if tree_path(parents, first, second) and not {first, second} <= in_loops:
            yield (
                f"limb {first} and limb {second} slide along each other, by {far:.0f} mm, while other limbs join them: "
                "a loop is closed there by a joint that slides, which skelgen does not know and leaves open"
            )


def sliding_range(first: Segment, second: Segment, typical: float) -> float:
    """Return how far two limbs slide along each other [mm]; 0 if they do not, or have no poses.

    Parameters
    ----------
    first, second : Segment
        Both limbs, in sampled frames.
    typical : float, mm^2
        Variance of a marker's coordinate, for limbs whose own is not known.
    """
    posed = first.shape.posed & second.shape.posed
    if posed.sum() < ENOUGH_FRAMES:
        return 0.0
    one, other = first.shape.world_from_limb[posed], second.shape.world_from_limb[posed]
    turns = one[:, :3, :3].swapaxes(1, 2) @ other[:, :3, :3]
    shifts = np.einsum("fji,fj->fi", one[:, :3, :3], other[:, :3, 3] - one[:, :3, 3])
    gaps = turns @ second.centre + shifts - first.centre
    found = [0.0]
    for line in _lines(first, second, one, other, gaps):
        if not _turns_about(line, first, second, turns, typical):
            continue
        across = np.eye(3) - np.outer(line, line)
        system = np.concatenate([across @ turns, np.broadcast_to(-across, turns.shape)], axis=2).reshape(-1, 6)
        change = np.linalg.lstsq(system, -(gaps @ across).ravel(), rcond=LEAST_SINGULAR)[0]
        place, end = first.centre + change[3:], second.centre + change[:3]
        left = gaps + turns @ change[:3] - change[3:]
        along = left @ line
        reached = [place + (along.mean() + side * along.std()) * line for side in (-1, 1)]  # errors are quadratic
        of_first = np.mean([expected_error(first, point, typical) for point in reached], axis=0)
        chance = float((of_first + expected_error(second, end, typical))[posed].mean())
        squares = np.sort(((left @ across) ** 2).sum(axis=1))[: round(KEPT_PART * len(left))]
        if squares.mean() / 2 <= ON_LINE * chance and np.var(along) > SLIDES * chance:
            found.append(float(np.ptp(np.quantile(along, [0.01, 0.99]))))
    return max(found)


def _distance(first: Segment, second: Segment) -> float:
    """Usual distance [mm] of the middles of two limbs that have poses."""
    return float(np.nanmedian(np.linalg.norm(first.middle - second.middle, axis=1)))


def _lines(first: Segment, second: Segment, one: Floats, other: Floats, gaps: Floats) -> Iterator[Floats]:
    """Directions in the first limb along which the second may slide."""
    fit = fit_fixed_point(one, other, first.centre, second.centre)
    if fit is not None:
        yield fit.axis_in_first
    yield np.linalg.svd(gaps - gaps.mean(axis=0), full_matrices=False)[2][0]


def _turns_about(line: Floats, first: Segment, second: Segment, turns: Floats, typical: float) -> bool:
    """Whether two limbs turn about a direction of the first alone, as far as noise tells."""
    seen = turns.swapaxes(1, 2) @ line
    middle = seen.mean(axis=0)
    steady = float(np.linalg.norm(middle))
    noise = 0.0
    for limb, axis in ((first, line), (second, middle / max(steady, LEAST_SINGULAR))):
        shares = limb.noise.shares(limb.shape.posed.astype(np.float64))
        noise += pose_noise(limb, typical) * limb.noise.of_rotation_across(axis, shares)
    return 2 * (1 - steady) <= ON_LINE * noise + LEAST_TURN**2
