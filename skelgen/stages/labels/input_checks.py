"""What is odd about a take, said before anybody trusts its labels."""

from __future__ import annotations

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Floats

LATE = 1.5
"""Of the usual step: between frames farther apart in time, at least one frame is missing."""

GUESS_SHARE = 0.5
"""Of the typical spacing: where points surprise by more from frame to frame, the neighbour is as good a guess."""

SAMPLED_FRAMES = 2000
"""Frames in which surprise is measured."""


def odd_times(cloud: PointCloud) -> tuple[str, ...]:
    """Say where time stamps jump or repeat: frames are taken as evenly spaced all the same."""
    steps = np.diff(cloud.times)
    rising = steps[steps > 0]
    if not len(rising):
        return ()
    said = []
    jumps = np.flatnonzero(steps > LATE * np.median(rising))
    if len(jumps):
        longest = jumps[np.argmax(steps[jumps])]
        said.append(
            f"the time stamps jump at {len(jumps)} of {cloud.n_frames} frames, the most before frame {longest + 1}, by "
            f"{steps[longest]:.3g} s; frames are taken as evenly spaced, and gaps in time as none"
        )
    if len(rising) < len(steps):
        said.append(f"{len(steps) - len(rising)} time stamps repeat the one before; frames are taken as evenly spaced")
    return tuple(said)


def guessed_identities(positions: Floats, spacing: float) -> tuple[str, ...]:
    """Say so if the markers jump about so far that following them was guessing.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        The labelled take, NaN where unseen.
    spacing : float, mm
        Typical distance of a point to its nearest neighbour.
    """
    surprise = usual_surprise(positions[: SAMPLED_FRAMES + 2])
    if not surprise > GUESS_SHARE * spacing:
        return ()
    return (
        f"the markers move by {surprise:.3g} mm otherwise than the frames before tell, and neighbours are "
        f"{spacing:.3g} mm apart: their identities are guesses, and perhaps none of the points is a marker",
    )


def usual_surprise(positions: Floats) -> float:
    """Median distance [mm] of markers from where the two frames before put them; NaN if there is none."""
    surprise = np.linalg.norm(positions[2:] - 2 * positions[1:-1] + positions[:-2], axis=2)
    known = surprise[~np.isnan(surprise)]
    return float(np.median(known)) if len(known) else float("nan")


def too_few_wanted(n_markers: int | None, at_once: int) -> tuple[str, ...]:
    """Say so if the user asked for fewer markers than are seen at once."""
    if n_markers is None or at_once <= n_markers:
        return ()
    return (
        f"{n_markers} markers were asked for, but {at_once} are seen at once: the {at_once - n_markers} that are seen "
        "in the fewest frames are left out",
    )
