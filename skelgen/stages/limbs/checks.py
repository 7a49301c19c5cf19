"""Input checks of limbs: notices on markers and limbs that look wrong; nothing is changed."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from skelgen.geometry.statistics import PairDistances
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats, Ints, evenly_spread
from skelgen.progress import counted, listed
from skelgen.stages.limbs.membership import STANDS_OUT, contrast

RARE_FRAMES = 30
"""Frames below which the limb of a marker is doubtful; half the take, where that is shorter."""

ONE_PLACE = 1.0
"""mm; no two markers have their centres nearer to each other."""

CORNERS = 4
"""The signed volume of so many markers tells a limb from its mirror image; that of three is 0."""

MOST_CORNERS = 8
"""Of so many markers, spread over the limb, all 70 sets of four are compared."""

STEADY = 0.25
"""Part of the volume: if its median deviation is larger, the limb is flat or not rigid, and is not checked."""

MIRRORED = (0.5, 2.0)
"""A volume of the opposite sign between these multiples of the usual one is a mirror image, whatever the noise."""

LEAST_MIRRORED = 3
"""Frames; single ones are noise."""


def limb_notices(trajectories: Trajectories, limb_of_marker: Ints, frames: Ints, pairs: PairDistances) -> Iterator[str]:
    """Say what looks wrong.

    Parameters
    ----------
    trajectories : Trajectories
        The take.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker, -1 if it is on none.
    frames : ndarray of intp
        Sampled frames to check.
    pairs : PairDistances
        From `every_pair`, in these frames.
    """
    names, positions = trajectories.names, trajectories.positions
    n_seen = (~np.isnan(positions[:, :, 0])).sum(axis=0)
    few = min(RARE_FRAMES, trajectories.n_frames // 2)
    for marker in np.flatnonzero((limb_of_marker >= 0) & (n_seen < few)).tolist():
        limb = int(limb_of_marker[marker])
        seen = counted(int(n_seen[marker]), "frame")
        yield f"{names[marker]} is seen in {seen} only: that it is on limb {limb} rests on what is seen there"
    sampled = positions[frames]
    for group in _at_one_place(sampled):
        count = f"they count as {len(group)} markers, but carry the information of one"
        yield f"{listed(names[marker] for marker in group)} are always in one place: {count}"
    more = contrast(pairs, limb_of_marker)
    if more < STANDS_OUT:
        yield (
            "markers of different limbs keep their distances nearly as well as those of one limb do over the same "
            f"length (they vary {np.exp(more):.1f} times as much): there may be no rigid limbs, as in a body that "
            "bends everywhere, or limbs move too little against each other; limbs and joints are doubtful"
        )
    for limb in range(int(limb_of_marker.max(initial=-1)) + 1):
        markers = np.flatnonzero(limb_of_marker == limb)
        n_mirrored = _mirrored_frames(sampled[:, markers])
        if n_mirrored:
            yield (
                f"limb {limb} ({', '.join(names[marker] for marker in markers)}) looks like its mirror image in "
                f"{n_mirrored} of {len(frames)} sampled frames, which no rotation explains: labels may be "
                "exchanged there"
            )


def _at_one_place(sampled: Floats) -> Iterator[list[int]]:
    """Markers with all that are where they are, each told once."""
    first, second = np.triu_indices(sampled.shape[1], 1)
    for frame in sampled:  # hardly a pair is left after the first
        if not len(first):
            return
        near = ~(np.linalg.norm(frame[second] - frame[first], axis=1) >= ONE_PLACE)
        first, second = first[near], second[near]
    are_seen = ~np.isnan(sampled[..., 0])
    both = (are_seen[:, first] & are_seen[:, second]).any(axis=0)
    first, second, grouped = first[both], second[both], set[int]()
    for marker in np.unique(first).tolist():
        group = [marker, *second[first == marker].tolist()]
        if not grouped.issuperset(group):
            yield group
        grouped.update(group)


def _mirrored_frames(sampled: Floats) -> int:
    """Number of frames in which a limb is its own mirror image, by its four markers that span the largest volume."""
    spread = evenly_spread(np.arange(sampled.shape[1]), MOST_CORNERS)
    whole = sampled[~np.isnan(sampled[:, spread, 0]).any(axis=1)]
    sets = list(combinations(spread.tolist(), CORNERS))
    if not len(whole) or not sets:
        return 0
    volumes = np.stack([_volume(whole[:, corners]) for corners in sets])
    sizes = np.median(np.abs(volumes), axis=1)
    best = int(np.argmax(sizes))
    volume, usual = volumes[best], float(sizes[best])
    if usual == 0 or np.median(np.abs(np.abs(volume) - usual)) > STEADY * usual:
        return 0
    sign = np.sign(np.median(np.sign(volume))) or 1.0
    mirrored = -sign * volume / usual
    n_mirrored = int(((mirrored > MIRRORED[0]) & (mirrored < MIRRORED[1])).sum())
    return n_mirrored if n_mirrored >= LEAST_MIRRORED else 0


def _volume(corners: Floats) -> Floats:
    """Signed volume spanned by four points [mm^3], shape (n_frames,)."""
    return np.asarray(np.linalg.det(corners[:, 1:] - corners[:, :1]))
