"""What readers of markers share: units, names, unseen markers, computed points, and the value that a file becomes."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import FormatError
from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Bools, Floats
from skelgen.progress import counted
from skelgen_formats.lines import Lines
from skelgen_formats.options import MM_PER_UNIT

FARTHEST = 1e9
"""Positions beyond this [mm], 1000 km, are damage or a wrong unit, not a capture."""

_UNLABELLED = re.compile(r"((uname)?\*\d+|unlabel+ed[ _-]?\d*)", re.IGNORECASE)
COMPUTED = "left out because a model computed them (`--points all` takes them)"
"""What became of points that are no markers, for `noted`."""

_OUTPUT = re.compile(r"\w*(Angles?|Forces?|Moments?|Powers?|Reactions?|GRF[OPM]?)")
_CUT_UNIT = 3  # letters of a unit that a field was too short for: C3D files say "mete"
_FEWEST_EQUAL = 2  # of positions with three coordinates that are the same number, for them to be gaps
_MOST_NUMBERS = 3  # that a program writes for gaps
_NUMBERS_AT_ONCE = 1 << 18
_NAMED_IN_NOTICE = 8  # names that a notice lists before it says how many more there are


def are_outputs(names: Sequence[str]) -> Bools:
    """Return which names are those that Vicon's models give to angles, forces and the like, shape (n_markers,).

    Parameters
    ----------
    names : sequence of str
        Such as ``LHipAngles`` or ``Ann:RKneeMoment``.
    """
    return np.array([_OUTPUT.fullmatch(name.rpartition(":")[2].strip()) is not None for name in names], dtype=np.bool_)


def mm_per_unit(path: Path, place: str | int, unit: str) -> float:
    """Return how many mm the named length unit has, or raise `FormatError` that lists the known ones.

    Parameters
    ----------
    path : Path
        The file, for errors.
    place : str or int
        Line, or another place in it, for errors.
    unit : str
        What the file says, in any case.
    """
    factor = mm_of_unit(unit)
    if factor is None:
        known = ", ".join(dict.fromkeys(MM_PER_UNIT))
        raise FormatError(path, place, f"the length unit is {unit.strip()[:20]!r}; it must be one of {known}")
    return factor


def mm_of_unit(unit: str) -> float | None:
    """Return how many mm the named length unit has; None if it is none.

    Parameters
    ----------
    unit : str
        What a file says, in any case; names may be cut off.
    """
    word = unit.strip(" \t\"'").lower()
    factors = {
        mm for name, mm in MM_PER_UNIT.items() if name == word or (len(word) >= _CUT_UNIT and name.startswith(word))
    }
    return factors.pop() if len(factors) == 1 else None


def scaled(path: Path, positions: Floats, factor: float) -> Floats:
    """Bring positions to mm, in their place, with half-seen markers unseen; refuse what cannot be a position.

    Parameters
    ----------
    path : Path
        For errors.
    positions : ndarray, shape (n_frames, n_markers, 3)
        In the file's unit.
    factor : float
        mm per unit of the file.

    Returns
    -------
    ndarray, shape (n_frames, n_markers, 3), mm
        The same array.
    """
    for first, block in frames_in_blocks(positions):
        wild = np.argwhere(np.abs(block) > FARTHEST / factor)
        if len(wild):
            frame, marker, axis = wild[0]
            what = f"marker {marker + 1} lies at {block[frame, marker, axis]:g}; the file is damaged or its unit wrong"
            raise FormatError(path, f"frame {first + frame + 1}", what)
        with np.errstate(invalid="ignore"):  # signalling NaNs
            np.multiply(block, factor, out=block)
        block[np.isnan(block).any(axis=2)] = np.nan
    return positions


def zeros_unseen(positions: Floats) -> Floats:
    """Make markers at exactly (0, 0, 0), which some programs write for a gap, NaN; return the same array.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3)
        Changed in place.
    """
    for _, block in frames_in_blocks(positions):
        block[(block == 0.0).all(axis=2)] = np.nan
    return positions


def equal_unseen(positions: Floats, notices: list[str]) -> Floats:
    """Make positions NaN whose coordinates are one number that others have, too; return the same array.

    A point that has such a position throughout is one that stands still, unless another one has it as well; where many
    numbers recur so, the points move along a diagonal.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3)
        Changed in place.
    notices : list of str
        Gets a sentence for each number.
    """
    first = positions[..., 0]
    frames, markers = np.nonzero((positions == first[..., np.newaxis]).all(axis=2))
    values, which, counts = np.unique(first[frames, markers], return_inverse=True, return_counts=True)
    recurs = (counts >= _FEWEST_EQUAL) | (np.abs(values) > FARTHEST)  # NDI writes -3.7e28
    if not 0 < recurs.sum() <= _MOST_NUMBERS + positions.shape[1]:
        return positions
    pairs, n_times = np.unique(which * positions.shape[1] + markers, return_counts=True)  # numbers and their markers
    numbers, owners = np.divmod(pairs, positions.shape[1])
    are_all = n_times == (~np.isnan(first)).sum(axis=0)[owners]
    is_still = (np.bincount(numbers) == 1) & np.isin(np.arange(len(values)), numbers[are_all])
    are_gaps = recurs & ~is_still
    if are_gaps.sum() > _MOST_NUMBERS:
        return positions
    gone = are_gaps[which]
    positions[frames[gone], markers[gone]] = np.nan
    for value, count in zip(values[are_gaps].tolist(), counts[are_gaps].tolist(), strict=True):
        are = counted(count, "position is", "positions are")
        taken = "and is taken" if count == 1 else "and are taken"
        notices.append(f"{are} {value:g} along x, y and z, {taken} as unseen")
    return positions


def frames_in_blocks(frames: NDArray[Any]) -> Iterator[tuple[int, NDArray[Any]]]:
    """Yield the first frame and a view of some frames at a time, so that what is computed of them takes no memory."""
    size = max(1, _NUMBERS_AT_ONCE // max(1, math.prod(frames.shape[1:])))
    for first in range(0, len(frames), size):
        yield first, frames[first : first + size]


def take_from_markers(
    path: Path,
    positions: Floats,
    names: Sequence[str],
    rate: float,
    notices: Sequence[str] = (),
    computed: Bools | None = None,
) -> Trajectories | PointCloud:
    """Make the value that a marker file holds.

    Markers that are never seen and points that a model computed are dropped, trajectories without a label (``*12``,
    ``Unlabeled 1234``) are left out when there are labelled ones, the second of a name is called NAME_2, and prefixes
    such as ``Nick01:`` are dropped while names stay distinct; each with a notice. A file with nothing but unlabelled
    trajectories becomes a `PointCloud`.

    Parameters
    ----------
    path : Path
        The file.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN is unseen.
    names : sequence of str, length n_markers
        As in the file.
    rate : float, Hz
        Frame rate.
    notices : sequence of str
        Notices of the reader so far.
    computed : ndarray of bool, shape (n_markers,), optional
        Which are no markers: points that a model computed from markers.

    Raises
    ------
    FormatError
        If there is no frame or no marker, none is ever seen, or all are computed.
    """
    notices = list(notices)
    if len(positions) == 0 or positions.shape[1] == 0:
        what = "frame" if len(positions) == 0 else "marker"
        raise FormatError(path, "", f"holds no {what}: nothing can be read from it")
    ever: Bools = np.asarray((~np.isnan(positions[:, :, 0])).any(axis=0))
    if not ever.any():
        raise FormatError(path, "", "no marker is seen in any frame: there is nothing to reconstruct from")
    measured = ever if computed is None else ever & ~computed
    if not measured.any():
        raise FormatError(path, "", "holds only points that a model computed; with `--points all` they are read")
    noted(notices, names, ever & ~measured, COMPUTED)
    labelled = np.array([not _is_unlabelled(name) for name in names])
    if not (labelled & measured).any():
        notices.append("all trajectories are unlabelled: they are taken as points without identity")
        return cloud_from_markers(positions[:, measured], rate, path.name, notices)
    noted(notices, names, ~ever, "dropped because never seen")
    noted(notices, names, measured & ~labelled, "left out because unlabelled")
    keep = np.flatnonzero(measured & labelled).tolist()
    kept_names = _without_prefixes(distinct_names([names[index] for index in keep], "_", notices), notices)
    kept = positions[:, keep] if len(keep) < positions.shape[1] else positions
    kept.flags.writeable = False  # so that the value takes it as it is
    return Trajectories(kept, kept_names, rate, path.name, tuple(notices), str(path.absolute()))


def _is_unlabelled(name: str) -> bool:
    """Whether a name is one that capture programs invent for a trajectory without a label."""
    return _UNLABELLED.fullmatch(name.rpartition(":")[2].strip()) is not None


def _without_prefixes(names: Sequence[str], notices: list[str]) -> tuple[str, ...]:
    """Return names without a subject's prefix (``Nick01:LFHD``) if they stay distinct; say so in `notices`."""
    short = tuple(name.rpartition(":")[2].strip() for name in names)
    prefixes = list(dict.fromkeys(name.rpartition(":")[0] for name in names if ":" in name))
    dropped = [f"{prefix}:" for prefix in prefixes]
    path, behind = _path_of(names)
    if path:
        dropped, short = [path, behind], tuple(name.removeprefix(path).removesuffix(behind) for name in names)
    if not dropped or len(set(short)) < len(short) or not all(short):
        return tuple(names)
    notices.append(f"dropped from the marker names: {_listed([*filter(None, dropped)])}")
    return short


def _path_of(names: Sequence[str]) -> tuple[str, str]:
    """Return what all names begin and end with, as ``Main.Study.Output.`` and ``.r``, if they begin with a path."""
    paths = [re.split(r"(?<=[./])", name)[:-1] for name in names]
    lead = [parts[0] for parts in takewhile(lambda parts: len({*parts}) == 1, zip(*paths, strict=False))]
    ends = {match[0] for match in (re.search(r"[./]\w+$", name.removeprefix("".join(lead))) for name in names) if match}
    is_path = len(lead) > 1 and len(names) > 1  # one part alone may be a side
    return ("".join(lead), ends.pop() if len(ends) == 1 else "") if is_path else ("", "")


def cloud_from_markers(positions: Floats, rate: float, name: str, notices: Sequence[str] = ()) -> PointCloud:
    """Return the seen markers of each frame as points without identity.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN is unseen.
    rate : float, Hz
        Frame rate.
    name : str
        Name of the take.
    notices : sequence of str
        Notices of the take.
    """
    seen: Bools = ~np.isnan(positions[:, :, 0])
    starts = np.concatenate(([0], np.cumsum(seen.sum(axis=1)))).astype(np.intp)
    times = np.arange(len(positions)) / rate
    return PointCloud(positions[seen], starts, times, name=name, notices=tuple(notices))


def check_frames(path: Path, place: str | int, announced: int, found: int, notices: list[str]) -> None:
    """Compare the frames that a header announces with those found: fewer is an error, more a notice.

    Parameters
    ----------
    path : Path
        The file, for errors.
    place : str or int
        Line, or another place in it, for errors.
    announced, found : int
        Numbers of frames.
    notices : list of str
        Gets a sentence if there are more.
    """
    if found < announced:
        what = f"{counted(announced, 'frame is', 'frames are')} announced and {found} are there; the file is cut off"
        raise FormatError(path, place, what)
    if found > announced:
        notices.append(more_than_announced(found, announced))


def more_than_announced(found: int, announced: int) -> str:
    """Return the notice of a file that holds more frames than its header says.

    Parameters
    ----------
    found, announced : int
        Numbers of frames.
    """
    return f"{counted(found, 'frame was', 'frames were')} read although the header announces {announced}"


def uncut(lines: Lines, rows: Floats, announced: int, notices: list[str]) -> Floats:
    """Return the rows of a text file but the last, where it ends in it before the frames that its header announces.

    Parameters
    ----------
    lines : Lines
        Of the file.
    rows : ndarray, shape (n_frames, n)
        Read from it.
    announced : int
        Frames by its header.
    notices : list of str
        Gets a sentence if there are more or fewer.
    """
    if lines.count(rows) < announced:
        rows = rows[:-1] if lines[-1].strip() and not any("is cut off" in notice for notice in notices) else rows
        frames = counted(announced, "frame is", "frames are")
        notices.append(f"{frames} announced and {lines.count(rows)} are there: the file is cut off")
    elif lines.count(rows) > announced:
        notices.append(more_than_announced(lines.count(rows), announced))
    return rows


def distinct_names(names: Sequence[str], between: str, notices: list[str] | None = None) -> tuple[str, ...]:
    """Return names that differ: the second of a name gets a 2 behind it, and so on.

    Parameters
    ----------
    names : sequence of str
        The names.
    between : str
        What stands between a name and its number.
    notices : list of str, optional
        Gets a sentence if a name was changed.
    """
    taken, count, distinct = set(names), Counter[str](), []
    for name in names:
        count[name] += 1
        candidate = name
        while count[name] > 1 and candidate in taken:
            candidate = f"{name}{between}{count[name]}"
            count[name] += candidate in taken
        taken.add(candidate)
        distinct.append(candidate)
    if notices is not None:
        changed = [f"{new} was {old}" for new, old in zip(distinct, names, strict=True) if new != old]
        if changed:
            notices.append(f"labels that stand twice got numbers: {_listed(changed)}")
    return tuple(distinct)


def noted(
    notices: list[str], names: Sequence[str], chosen: Bools, what: str, kinds: tuple[str, str] = ("marker", "markers")
) -> None:
    """Add a sentence on the chosen markers, if there are any.

    Parameters
    ----------
    notices : list of str
        Gets the sentence.
    names : sequence of str, length n
        Of all.
    chosen : ndarray of bool, shape (n,)
        Which it is about.
    what : str
        What became of them.
    kinds : tuple of two str
        What one, and several, are called.
    """
    listed = [names[index] for index in np.flatnonzero(chosen).tolist()]
    if listed:
        notices.append(f"{len(listed)} {kinds[len(listed) > 1]} {what}: {_listed(listed)}")


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_NAMED_IN_NOTICE])
    more = len(names) - _NAMED_IN_NOTICE
    return f"{shown} and {more} more" if more > 0 else shown
