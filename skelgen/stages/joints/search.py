"""Joints between all pairs of limbs, and those of the tree in all frames, of long takes block by block."""

import multiprocessing
from collections.abc import Iterable, Mapping
from itertools import combinations, pairwise

import numpy as np

from skelgen.interrupts import deaf_children, end_with_parent
from skelgen.kinematics.rigid_bodies import LimbShape
from skelgen.model import Limbs
from skelgen.model.arrays import Floats, Ints, evenly_spread
from skelgen.model.topology import joint_children
from skelgen.progress import SILENT, Monitor
from skelgen.stages.joints.nearness import APART
from skelgen.stages.joints.pairs import Guessing, JointGuess, classic_joint, drawn_joint, guess_joint
from skelgen.stages.joints.parameters import Pair
from skelgen.stages.joints.segments import (
    BLOCK_FRAMES,
    ENOUGH_FRAMES,
    Segment,
    make_segments,
    sample_frames,
    typical_variance,
)

NEAREST = 4
"""Limbs without a pose that are tried as neighbours of one without: each pair takes a descent."""

IN_CHAIN = 2
"""Likeliest neighbours of a limb whose joint is drawn towards the markers if it comes out far from them: as many as a
limb within a chain has."""

AGAIN = 30
"""Likeliest neighbours of a limb whose joints are guessed again when its first joint gives it poses."""

WORTH_PROCESSES = 200
"""A descent takes some 5 ms, starting workers a second: fewer pairs without poses are done in one process."""

NOT_YET = JointGuess(np.zeros((0, 3)), np.inf)
"""Stands for the guess of two limbs without poses until it is made."""


class PairSearch:
    """The search for the joints between all pairs of limbs.

    Parameters
    ----------
    segments : list of Segment
        All limbs.
    frames : ndarray of intp
        Sampled frames at which pairs are tried.
    how : Guessing
        Parameters and seed.
    monitor : Monitor
        Receives progress.
    odds : ndarray, shape (n_limbs, n_limbs), optional
        Log odds that limbs are neighbours: two without poses are tried if one is among the likeliest of the other,
        and none between bodies, where they are `APART`.
    """

    def __init__(
        self, segments: list[Segment], frames: Ints, how: Guessing, monitor: Monitor, odds: Floats | None = None
    ) -> None:
        self._segments, self._frames, self._odds = list(segments), frames, odds
        self._sampled = [segment.at(frames) for segment in segments]
        self._how, self._parameters, self._monitor = how, how.parameters, monitor
        self._typical, self._reach = typical_variance(segments), _extent(segments, frames)
        self._guesses: dict[Pair, JointGuess] = {}
        self._postponed: set[Pair] = set()

    def guesses(self) -> dict[Pair, JointGuess]:
        """Guess every pair; then give limbs without a pose one by their best joint, and guess their pairs again.

        Two limbs without poses give none to each other, and a descent takes a hundred times a closed form: they are
        guessed at last, if they have no poses even then, and if one is among the `NEAREST` of the other.
        """
        pairs = [pair for pair in combinations(range(len(self._segments)), 2) if self._is_near(pair)]
        if self._parameters.solver != "closed-form":
            self._guess(pairs)
            return self._guesses
        self._guess_or_postpone([pair for pair in pairs if self._is_worth_a_descent(pair)])
        joined: set[int] = set()
        while (choice := self._surest_joint_to_small_limb(joined)) is not None:
            small, pair = choice
            joined.add(small)
            first, second = (self._segments[limb] for limb in pair)
            whole = guess_joint(first, second, self._how, self._typical, self._parameters.alpha)
            self._segments[small] = self._segments[small].with_joint(whole.positions, self._frames)
            self._sampled[small] = self._segments[small].at(self._frames)
            others = (other for other in pairs if small in other and other != pair)
            self._guess_or_postpone([other for other in others if self._rank(other) < AGAIN])
        for pair in [pair for pair in self._postponed if self._rank(pair) >= NEAREST]:
            del self._guesses[pair]
        self._guess([pair for pair in self._guesses if pair in self._postponed])
        return self._guesses

    def guesses_with(self, pairs: Iterable[Pair]) -> dict[Pair, JointGuess]:
        """Guess those of some pairs that were not tried, because others are likelier; return the joints of all pairs.

        Parameters
        ----------
        pairs : iterable of pairs of int
            Limbs whose joint is stated, the lower index first.
        """
        self._guess([pair for pair in pairs if pair not in self._guesses])
        return self._guesses

    def _is_near(self, pair: Pair) -> bool:
        if self._odds is not None and self._odds[pair] == APART:
            return False
        return not self._parameters.n_nearest or self._rank(pair) < self._parameters.n_nearest

    def _is_worth_a_descent(self, pair: Pair) -> bool:
        return any(self._segments[limb].shape.has_pose for limb in pair) or self._rank(pair) < NEAREST

    def _rank(self, pair: Pair) -> int:
        """Rank of each of two limbs among the likeliest neighbours of the other; the smaller of both ranks."""
        if self._odds is None:
            return 0
        one, other = pair
        return int((self._odds[[one, other]] > self._odds[one, other]).sum(axis=1).min())

    def _guess_or_postpone(self, pairs: list[Pair]) -> None:
        """Guess the joints of some pairs; pairs in which neither limb has poses are put off."""
        for pair in pairs:
            self._guesses.setdefault(pair, NOT_YET)
        lacking = {pair for pair in pairs if all(self._segments[limb].lacks_poses for limb in pair)}
        self._postponed.difference_update(pairs)
        self._postponed.update(
            pair for pair in lacking if not any(one.shape.has_pose for one in self._common_frames(pair))
        )
        self._guess([pair for pair in pairs if pair not in self._postponed])

    def _guess(self, pairs: list[Pair]) -> None:
        """Guess the joints of some pairs, in several processes where that pays.

        Likely neighbours whose joint comes out far from all markers, as points that hardly turn about it lie on a
        sphere of any size, get one that is drawn towards them.
        """
        work = [self._common_frames(pair) for pair in pairs]
        given = self._how, self._typical, self._parameters.alpha
        by_descent = self._parameters.solver == "conjugate-gradient"
        if sum(by_descent or not (one.shape.has_pose or two.shape.has_pose) for one, two in work) < WORTH_PROCESSES:
            found = (guess_joint(first, second, *given) for first, second in work)
        else:
            from joblib import Parallel, delayed  # noqa: PLC0415 - only wanted with many descents

            with deaf_children():
                found = Parallel(return_as="generator")(delayed(_guess_for_parent)(*pair, *given) for pair in work)
        for index, (pair, one) in enumerate(zip(pairs, found, strict=True), start=1):
            is_far = np.isfinite(one.square) and one.distance > self._reach and self._is_in_chain(pair)
            first, second = work[index - 1]
            self._guesses[pair] = drawn_joint(first, second, *given) if is_far and not one.is_unexplained else one
            self._monitor.advance(index, len(work))

    def _is_in_chain(self, pair: Pair) -> bool:
        """Whether limbs are likely neighbours; where only the nearest are tried, limbs are drafts and may be wrong."""
        return not self._parameters.n_nearest and self._rank(pair) < IN_CHAIN

    def _common_frames(self, pair: Pair) -> tuple[Segment, Segment]:
        """Both limbs in the sampled frames, or, where these hardly show both, in others that do."""
        first, second = (self._sampled[limb] for limb in pair)
        if (first.is_known & second.is_known).sum() >= ENOUGH_FRAMES:
            return first, second
        first, second = (self._segments[limb] for limb in pair)
        both = np.flatnonzero(first.is_known & second.is_known)
        chosen = evenly_spread(both, len(self._frames))
        if len(both) < ENOUGH_FRAMES:
            seen = np.flatnonzero(first.is_seen & second.is_seen)
            chosen = np.union1d(chosen, evenly_spread(seen, len(self._frames)))
        return first.at(chosen), second.at(chosen)

    def _surest_joint_to_small_limb(self, joined: set[int]) -> tuple[int, Pair] | None:
        """The limb without poses, not joined yet, with the surest joint to a limb that has some; and that pair."""
        best: tuple[float, int, Pair] | None = None
        for pair, guess in self._guesses.items():
            for small, body in (pair, pair[::-1]):
                waits = small not in joined and self._segments[small].lacks_poses
                helps = np.isfinite(guess.square) and not self._segments[body].lacks_poses
                if waits and helps and (best is None or guess.doubt < best[0]):
                    best = (guess.doubt, small, pair)
        return None if best is None else best[1:]


def _guess_for_parent(first: Segment, second: Segment, how: Guessing, typical: float, alpha: float) -> JointGuess:
    if multiprocessing.current_process().name.startswith("LokyProcess"):  # which would outlive a parent that is killed
        end_with_parent()
    return guess_joint(first, second, how, typical, alpha)


def place_joints(
    segments: list[Segment],
    frames: Ints,
    parents: Ints,
    how: Guessing,
    monitor: Monitor,
    guesses: Mapping[Pair, JointGuess] | None = None,
) -> tuple[dict[int, JointGuess], list[Segment]]:
    """Place the joints of the tree in all frames of the segments, those between limbs with poses first.

    Points that hardly turn about a joint lie on a sphere of any size. A joint that comes out farther from its markers
    than all markers are from each other is placed anew by the joint cost, which draws it towards them.

    Parameters
    ----------
    segments : list of Segment
        All limbs.
    frames : ndarray of intp
        Frames from which shapes of limbs that gain a joint are estimated.
    parents : ndarray of intp, shape (n_limbs,)
        The tree, -1 for roots.
    how : Guessing
        Parameters and seed.
    monitor : Monitor
        Receives progress.
    guesses : mapping of pair to JointGuess, optional
        Joints found from sampled frames, whose mean distances make the start of conjugate gradients.

    Returns
    -------
    tuple of dict of int to JointGuess and list of Segment
        Joints by child limb, and all limbs with the joints that give them poses.
    """
    segments = list(segments)
    typical = typical_variance(segments)
    reach = _extent(segments, frames)
    waiting = [int(child) for child in np.flatnonzero(parents >= 0)]
    n_joints = len(waiting)
    kept: dict[int, JointGuess] = {}
    while waiting:
        waiting.sort(key=lambda child: -_known(segments[child].shape) - _known(segments[parents[child]].shape))
        child = waiting.pop(0)
        pair = (int(parents[child]), child)
        first, second = segments[pair[0]], segments[pair[1]]
        given = how, typical, how.parameters.alpha_final
        if how.parameters.solver == "conjugate-gradient" and guesses:
            kept[child] = classic_joint(first, second, *given, _radii(guesses, pair, first.n_markers))
        else:
            kept[child] = guess_joint(first, second, *given)
        if kept[child].distance > reach:
            kept[child] = drawn_joint(first, second, how, typical, how.parameters.alpha)
        for limb in pair:
            if segments[limb].lacks_poses:
                segments[limb] = segments[limb].with_joint(kept[child].positions, frames)
        monitor.advance(len(kept), n_joints)
    return kept, segments


def _radii(guesses: Mapping[Pair, JointGuess], pair: Pair, n_first: int) -> Floats | None:
    """Mean distances [mm] from the joint that was guessed to the markers of both limbs, in the order of the pair."""
    ordered = (min(pair), max(pair))
    radii = guesses[ordered].radii if ordered in guesses else np.zeros(0)
    return (radii if pair == ordered else np.roll(radii, n_first)) if len(radii) else None


def place_in_blocks(
    positions: Floats,
    limbs: Limbs,
    parents: Ints,
    how: Guessing,
    monitor: Monitor,
    guesses: Mapping[Pair, JointGuess] | None = None,
) -> Floats:
    """Place the joints of a tree in all frames of a long take; each block estimates its own shapes and joints.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    limbs : Limbs
        Which marker is on which limb.
    parents : ndarray of intp, shape (n_limbs,)
        The tree, -1 for roots.
    how : Guessing
        Parameters and seed.
    monitor : Monitor
        Receives progress.
    guesses : mapping of pair to JointGuess, optional
        Joints found from sampled frames, whose mean distances make the start of conjugate gradients.

    Returns
    -------
    ndarray, shape (n_frames, n_joints, 3), mm
        Joints from the roots outward.
    """
    n_frames = len(positions)
    raw = np.empty((n_frames, int((parents >= 0).sum()), 3))
    ends = np.linspace(0, n_frames, -(-n_frames // BLOCK_FRAMES) + 1).astype(np.intp)
    for first, last in pairwise(ends.tolist()):
        block = positions[first:last]
        frames = sample_frames(len(block), how.parameters)
        segments = make_segments([block[:, limbs.markers_of(limb)] for limb in range(limbs.n_limbs)], frames)
        kept, _ = place_joints(segments, frames, parents, how, SILENT, guesses)
        raw[first:last] = positions_of_joints(kept, parents, len(block))
        monitor.advance(last, n_frames)
    raw.flags.writeable = False
    return raw


def positions_of_joints(joints: dict[int, JointGuess], parents: Ints, n_frames: int) -> Floats:
    """Return the positions of joints [mm], shape (n_frames, n_joints, 3), from the roots outward.

    Parameters
    ----------
    joints : dict of int to JointGuess
        By child limb.
    parents : ndarray of intp, shape (n_limbs,)
        The tree, -1 for roots.
    n_frames : int
        Number of frames.
    """
    positions = [joints[child].positions for child in joint_children(parents).tolist()]
    return np.stack(positions, axis=1) if positions else np.zeros((n_frames, 0, 3))


def _extent(segments: list[Segment], frames: Ints) -> float:
    """Usual diagonal of the box around all markers [mm]."""
    markers = np.concatenate([segment.markers[frames] for segment in segments], axis=1)
    seen = ~np.isnan(markers[:, :, :1])
    shown = seen.any(axis=(1, 2))
    if not shown.any():
        return np.inf
    highest = np.where(seen, markers, -np.inf)[shown].max(axis=1)
    lowest = np.where(seen, markers, np.inf)[shown].min(axis=1)
    return float(np.median(np.linalg.norm(highest - lowest, axis=1)))


def _known(shape: LimbShape) -> int:
    """Rank of what is known of a limb's poses: nothing, some frames, enough frames."""
    return int(shape.posed.sum() >= ENOUGH_FRAMES) + int(shape.has_pose)
