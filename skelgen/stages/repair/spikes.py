"""Find spikes: frames in which a label jumps away from its limb and back, to a reflection or a wrong reconstruction.

One bad frame in a hundred of each marker is one in ten for a limb with its neighbours, and limbs are parted by it.
"""

import numpy as np

from skelgen.geometry.statistics import lengths_of, median_of_known
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats, Ints, runs_of
from skelgen.stages.repair.departures import departures
from skelgen.stages.repair.fills import Fill

AWAY = 5.0
"""Standard deviations by which distances are off in each frame of a spike, in the middle of a marker's mates."""

LONGEST, LEAST_FRAMES = 0.1, 2
"""s, and frames of slow cameras; what is away for longer may be a limb that has moved."""

JUMP = 15.0
"""Times its usual step against its mates by which a label jumps at both ends: limbs come and go by and by."""

PART = 0.5
"""Of how far it is away, how far it jumps, and the other way round: what moves away does not come with one step, and
where a marker beside it jumps, it does not move itself."""

TINY = 1e-6
"""mm."""

EVIDENCE = "away from its limb, from where it jumps there and back within a tenth of a second"


def find_spikes(trajectories: Trajectories) -> tuple[Fill, ...]:
    """Find frames in which labels jump away from their limb and back.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers, none of whose labels are exchanged.
    """
    positions, found = trajectories.positions, []
    longest = max(LEAST_FRAMES, LONGEST * trajectories.rate)
    for marker, (mates, away) in enumerate(departures(positions)):
        inner = [(first, stop) for first, stop in runs_of(away > AWAY) if first > 0 and stop < len(away)]
        short = [(first, stop) for first, stop in inner if stop - first <= longest]
        spikes = _sharp(positions, marker, mates, short) if short else []
        if spikes:
            frames = np.concatenate([np.arange(first, stop) for first, stop in spikes])
            found.append(Fill(marker, trajectories.names[marker], frames, len(spikes), EVIDENCE, "spike"))
    return tuple(found)


def _sharp(positions: Floats, marker: int, mates: Ints, pieces: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Those of some pieces of frames at both of whose ends a marker jumps against its mates, there and back."""
    steps = np.diff(positions[:, [marker, *mates]], axis=0)
    beside = median_of_known(steps[:, 1:].transpose(1, 0, 2).reshape(len(mates), -1)).reshape(-1, 3)
    jumps = steps[:, 0] - beside
    least = max(JUMP * float(median_of_known(lengths_of(jumps)[:, np.newaxis])[0]), TINY)
    sharp = []
    for first, stop in pieces:
        path, there, back = positions[first:stop, marker], jumps[first - 1], jumps[stop - 1]
        far = lengths_of(path - (positions[first - 1, marker] + positions[stop, marker]) / 2).max()
        short = lengths_of(np.stack([there, back])).min()  # NaN at gaps, where nothing is known
        if far / PART > short > np.max([least, PART * far, lengths_of(there + back)]):
            sharp.append((first, stop))
    return sharp
