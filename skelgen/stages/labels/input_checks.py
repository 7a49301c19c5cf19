"""Checks of a take: what cannot be labelled is refused, what is no marker left out, and what is odd is noticed."""

from dataclasses import replace

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.computed_points import are_computed
from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints, check_coordinates
from skelgen.progress import Monitor, counted
from skelgen.stages.labels.parameters import LabelParameters

MISSING_FRAME = 1.5
"""Of the usual time step: between frames farther apart in time, at least one frame is missing."""

GUESS_SHARE = 0.5
"""Of the typical spacing: where points deviate by more from frame to frame, the neighbour is as good a guess."""

SAMPLED_FRAMES = 2000
"""Frames in which the deviation is measured."""


def check_cloud(cloud: PointCloud, n_markers: int | None) -> None:
    """Refuse what cannot be labelled.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    n_markers : int or None
        Number of markers that the user asks for.

    Raises
    ------
    InputError
        If fewer than one marker is asked for, there are no points, or a coordinate is impossibly large.
    """
    if n_markers is not None and n_markers < 1:
        raise InputError(f"{n_markers} markers were asked for; there must be at least 1")
    if cloud.n_points == 0:
        raise InputError(f"{cloud.name or 'the take'} holds no points in its {cloud.n_frames} frames")
    check_coordinates(cloud.points, cloud.name or "the take")


def without_computed(take: Trajectories, monitor: Monitor) -> Trajectories:
    """Return a take without the points that a model computed, by their names.

    Parameters
    ----------
    take : Trajectories
        A labelled take.
    monitor : Monitor
        Receives a notice that names them.
    """
    computed = are_computed(take.names)
    if not computed.any():
        return take
    names = np.array(take.names)
    monitor.notice(
        f"left out, by their names computed and no markers: {', '.join(names[computed])} "
        "(`--set labels.computed_points=yes` takes them)"
    )
    return replace(take, positions=take.positions[:, ~computed], names=tuple(names[~computed].tolist()))


def with_jitter(positions: Floats, parameters: LabelParameters, seed: int) -> Floats:
    """Add the test jitter.

    Parameters
    ----------
    positions : ndarray, shape (..., 3), mm
        Points or markers.
    parameters : LabelParameters
        Their `max_jitter`.
    seed : int
        Random seed.
    """
    largest = parameters.max_jitter
    return positions + np.random.default_rng(seed).uniform(-largest, largest, positions.shape)


def frame_rate(cloud: PointCloud, parameters: LabelParameters) -> tuple[float, tuple[str, ...]]:
    """Return the frame rate [Hz], and notices of odd time stamps.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    parameters : LabelParameters
        Its `time_one_frame` counts where time stamps do not rise.
    """
    if cloud.n_frames < 2 or cloud.times[-1] > cloud.times[0]:
        usual = LabelParameters.time_one_frame
        idle = f"time_one_frame = {parameters.time_one_frame} has no effect: the take's own time stamps rise"
        return cloud.rate, (*_odd_times(cloud), *((idle,) if parameters.time_one_frame != usual else ()))
    rate = 1000.0 / parameters.time_one_frame
    return rate, (f"the time stamps do not rise; {parameters.time_one_frame} ms a frame are assumed",)


def _odd_times(cloud: PointCloud) -> tuple[str, ...]:
    """Notices of time stamps that jump or repeat: frames are taken as evenly spaced nevertheless."""
    steps = np.diff(cloud.times)
    rising = steps[steps > 0]
    if not len(rising):
        return ()
    notices = []
    jumps = np.flatnonzero(steps > MISSING_FRAME * np.median(rising))
    if len(jumps):
        longest = jumps[np.argmax(steps[jumps])]
        notices.append(
            f"the time stamps jump at {len(jumps)} of {cloud.n_frames} frames, the most before frame {longest + 1}, by "
            f"{steps[longest]:.3g} s; frames are taken as evenly spaced, and gaps in time as none"
        )
    if len(rising) < len(steps):
        notices.append(
            f"{counted(len(steps) - len(rising), 'time stamp repeats', 'time stamps repeat')} the one before; frames "
            "are taken as evenly spaced"
        )
    return tuple(notices)


def thin_frames(seen: Bools, least_seen: float) -> tuple[Bools, tuple[str, ...]]:
    """Return which frames show too few of the markers (Schönauer 2007, 5.4), and a notice if there are any.

    Parameters
    ----------
    seen : ndarray of bool, shape (n_frames, n_markers)
        Which marker is seen where.
    least_seen : float
        Part of the markers that a frame must show.
    """
    thin = np.asarray(seen.mean(axis=1) < least_seen) if seen.shape[1] else np.zeros(len(seen), dtype=np.bool_)
    count = int(thin.sum())
    if not count:
        return thin, ()
    return thin, (f"{count} of {len(thin)} frames show less than {100 * least_seen:g} % of the markers: cleaned",)


def guessed_identities(positions: Floats, spacing: float) -> tuple[str, ...]:
    """Return a notice if the markers jump about so far that following them was guessing.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        The labelled take, NaN where unseen.
    spacing : float, mm
        Typical distance of a point to its nearest neighbour.
    """
    deviation = _median_deviation(positions[: SAMPLED_FRAMES + 2])
    if not deviation > GUESS_SHARE * spacing:
        return ()
    return (
        f"the markers move by {deviation:.3g} mm otherwise than the frames before tell, and neighbours are "
        f"{spacing:.3g} mm apart: their identities are guesses, and perhaps none of the points is a marker",
    )


def _median_deviation(positions: Floats) -> float:
    """Median distance [mm] of markers from where the two frames before put them; NaN if there is none.

    `positions` [mm] has shape (n_frames, n_markers, 3).
    """
    deviation = np.linalg.norm(positions[2:] - 2 * positions[1:-1] + positions[:-2], axis=2)
    known = deviation[~np.isnan(deviation)]
    return float(np.median(known)) if len(known) else float("nan")


def too_few_wanted(n_markers: int | None, at_once: int) -> tuple[str, ...]:
    """Return a notice if the user asked for fewer markers than are seen at once.

    Parameters
    ----------
    n_markers : int or None
        Number of markers that the user asks for.
    at_once : int
        Number of markers seen at once.
    """
    if n_markers is None or at_once <= n_markers:
        return ()
    return (
        f"{counted(n_markers, 'marker was', 'markers were')} asked for, but {at_once} are seen at once: the "
        f"{at_once - n_markers} that are seen in the fewest frames are left out",
    )


def losses(found: Ints, n_found: int, n_removed: int, n_markers: int | None) -> tuple[str, ...]:
    """Return notices of what labelling has left out.

    Parameters
    ----------
    found : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    n_found : int
        Number of markers.
    n_removed : int
        Tracklets of enough length that are no marker's.
    n_markers : int or None
        Number of markers that the user asks for.
    """
    notices = []
    left_out = int((found < 0).sum())
    if left_out:
        sentence = (
            f"{left_out} of {len(found)} points ({100.0 * left_out / len(found):.1f} %) belong to no marker and are "
            "left out"
        )
        long_enough = counted(n_removed, "tracklet that was", "tracklets that were")
        notices.append(f"{sentence}, among them {long_enough} long enough" if n_removed else sentence)
    if n_markers is not None and n_found < n_markers:
        notices.append(
            f"{counted(n_markers, 'marker was', 'markers were')} asked for, but only {n_found} can be told apart"
        )
    return tuple(notices)
