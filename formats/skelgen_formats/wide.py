"""Wide tables: one row per frame, three columns per point, as scripts write them, in CSV or Parquet.

Which columns are whose is said by the lines above the numbers (see `skelgen_formats.table_heads`); other columns are
left out. Cells are parted by commas, semicolons, tabs or blanks. Points with a unit quaternion or three angles are
bodies, and read as such where all are, or with the option `bodies`. How angles make a rotation no such file says; the
usual order is assumed, and `angle_order` states another. Rows of several people or bones may take turns.

Few such files state a frame rate or a unit. Else the rate is that of a column with times, in the unit that its title
names or that gives a camera's rate, or 100 Hz is assumed, and the unit by the size of the coordinates; options state
both. Columns of forces, accelerations, angles and the like are no points and are left out. Points whose three
coordinates are the same number several times, as -9999 is, are unseen there.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.geometry.frame_rate import AS_RECORDED_RATE
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.model.arrays import Floats
from skelgen.progress import counted
from skelgen_formats.assumed_units import mm_per_recorded_unit, notice_images, notice_landmarks
from skelgen_formats.bodies import BY_ROWS, blank_unseen, take_from_bodies, with_quaternions
from skelgen_formats.body_columns import Body
from skelgen_formats.flags import Flag, are_unseen
from skelgen_formats.lines import Lines, decoded_head, read_lines
from skelgen_formats.markers import are_outputs, equal_unseen, mm_per_unit, scaled, take_from_markers, zeros_unseen
from skelgen_formats.options import (
    ALL_POINTS,
    ANGLE_ORDER,
    AUTO,
    BODIES,
    POINTS,
    RECORDED_RATE,
    RECORDED_UNIT,
    Format,
    Options,
)
from skelgen_formats.row_owners import Turns, owners_in_blocks, without_copies
from skelgen_formats.table_heads import HEAD_LINES, find_head
from skelgen_formats.table_rows import (
    in_order,
    padded_rows,
    reread_with_marks,
    unquoted_rows,
    until_other_table,
    with_numbers,
    with_plain_numbers,
    with_seconds,
    without_remarks,
)
from skelgen_formats.text import parse_rows, rate_in
from skelgen_formats.time_stamps import Stamps, since_first
from skelgen_formats.title_lines import Head
from skelgen_formats.turn_titles import AXES

ASSUMED_RATE = 100.0
"""Frame rate [Hz] of files that state none."""

_FEW_FRAMES = 8  # in so few, but one point may be seen by chance
_RATE_TOLERANCE = 0.05  # of what is stated
_NEAR_STEPS = 3.0  # steps from frame to frame, within which a body may have been at the origin


def read_table(path: Path, lines: Lines, options: Options) -> Trajectories | PointCloud | Poses:
    """Read a table of points or bodies from its lines.

    Parameters
    ----------
    path : Path
        The file, for errors.
    lines : Lines
        Of the table.
    options : Options
        `bodies`, `recorded_rate`, `recorded_unit` and `sample` count.

    Raises
    ------
    FormatError
        If the titles name no points, points have two coordinates, or a row is not as long as they are.
    """
    head = find_head([line for _, line in islice(lines.numbered(), HEAD_LINES)])
    if head is None:
        what = "no line of titles such as name_x, name_y, name_z was found; write them over the columns"
        raise FormatError(path, 1, what)
    head.owners = head.owners or owners_in_blocks(islice(lines.numbered(), head.n_lines, None), head)
    if head.owners and lines.is_sampled:
        raise FormatError(path, head.n_lines, "rows of several people or points take turns, of which no sample tells")
    if not head.bodies and head.notices:
        raise FormatError(path, 1, f"the columns are {head.notices[0]}; nothing else is there")
    if not head.bodies:
        raise FormatError(path, 1, "points have two coordinates: 2D; triangulate them first, e.g. with anipose")
    wanted = chosen_columns(head, options)
    flags = [column for body in head.bodies for column in body.flags]
    columns = [*wanted, *flags]
    rows, stamps, turns = reread_with_marks(head, lambda: _numbers_of(path, lines, head, columns, options))
    rows = _seen(rows, head.bodies, head.notices)
    if turns.frames:
        rows, stamps = turns.spread(path, rows, stamps)
        rows, head.bodies = without_copies(rows, turns.named(head.bodies), head.notices)
    return take_from_rows(path, rows, head, stamps, with_stated_rate(path, head, options, stamps))


def with_stated_rate(path: Path, head: Head, options: Options, times: Stamps | None) -> Options:
    """Return the options with the frame rate that lines before the titles state, if no other is wanted.

    Where the times make another rate, a notice says so.

    Parameters
    ----------
    path : Path
        The file, for errors.
    head : Head
        Of the table; gets notices.
    options : Options
        `recorded_rate` counts.
    times : Stamps or None
        Of the frames.
    """
    if not head.rate or options.recorded_rate != AS_RECORDED_RATE:
        return options
    stated = rate_in(path, 1, head.rate, "the frame rate")
    measured = times.rate([]) if times else AS_RECORDED_RATE
    if measured != AS_RECORDED_RATE and abs(measured / stated - 1.0) > _RATE_TOLERANCE:
        head.notices.append(f"{stated:g} Hz, stated before the titles, are taken; the times make {measured:.4g} Hz")
    return replace(options, recorded_rate=stated)


def chosen_columns(head: Head, options: Options) -> list[int]:
    """Keep the points, or the bodies where there is nothing else or they are asked for, and return their columns.

    Parameters
    ----------
    head : Head
        Of the table; keeps what is chosen, and gets notices.
    options : Options
        `bodies` and `points` count.
    """
    turned = [body for body in head.bodies if body.is_turned]
    angled = [body for body in head.bodies if body.has_angles]
    if not turned and (options.bodies or (options.points == AUTO and len(angled) == len(head.bodies))):
        turned = angled
    elif angled:
        names = ", ".join(body.name for body in angled[:8])
        head.notices.append(f"rotations other than unit quaternions are left out: {names}")
    kinds = [len(body.columns(turned=True)) for body in turned]
    turned = [body for body, kind in zip(turned, kinds, strict=True) if kind == kinds[0]]
    points = [body for body in head.bodies if body not in turned]
    are_bodies = bool(turned) and (options.bodies or len(points) < 2)  # a single point has no skeleton
    if are_bodies and points:
        one, several = "point without a rotation is left out", "points without a rotation are left out"
        head.notices.append(counted(len(points), one, several))
    elif turned and points:
        head.notices.append("bodies with rotations are left out; `--bodies` reads them instead of the points")
    head.bodies = turned if are_bodies else points
    return [column for body in head.bodies for column in body.columns(turned=are_bodies)]


def _numbers_of(
    path: Path, lines: Lines, head: Head, wanted: Sequence[int], options: Options
) -> tuple[Floats, Stamps | None, Turns]:
    """Return the wanted columns, shape (n_rows, n_wanted), times, if any, and whose each row is, if they take turns."""
    turns = Turns()
    times = [head.clock.column] if head.clock else []
    numbered = list(islice(lines.numbered(), head.n_lines))
    first = numbered[-1][0] if numbered else 0
    # without times, a row of empty cells is a frame in which nothing is seen
    least = 0 if times or not head.delimiter else head.n_cells - 1
    numbers = unquoted_rows(until_other_table(lines.rows(first, least=least), head), head.delimiter, least)
    coordinates = {column for body in head.bodies for column in body.place.values()}
    numbers = without_remarks(with_plain_numbers(numbers, head, coordinates), head, head.notices)
    whole = padded_rows(with_numbers(numbers, head), len(lines), head.n_cells, head.delimiter, head.notices)
    if head.owners:
        whole = turns.noted(whole, head)
    is_in_parts = head.frames is None and head.clock is not None and bool(head.clock.others)
    whole = with_seconds(whole, head) if is_in_parts else whole
    if head.counts is not None and not head.owners:
        whole = in_order(whole, head.counts, head, every=not lines.is_sampled)
    whole = whole if is_in_parts else with_seconds(whole, head)
    rows = parse_rows(path, whole, head.n_cells, head.delimiter, [*wanted, *times])
    if not head.clock:
        return rows, None, turns
    stamps = rows[:, -1]
    if options.sample and options.sample.n_left_out:
        few = islice(unquoted_rows(lines.numbered(first), head.delimiter, least), options.sample.most)
        plain = with_plain_numbers(few, head, coordinates)
        some = with_seconds(padded_rows(plain, len(lines), head.n_cells, head.delimiter, []), head)
        stamps = parse_rows(path, some, head.n_cells, head.delimiter, times)[:, 0]
        head.notices.append(f"the frame rate is that of the first {len(stamps)} time stamps")
    return rows[:, :-1], since_first(stamps, head.clock.second, head.clock.counts_frames), turns


def _seen(rows: Floats, chosen: Sequence[Body], notices: list[str]) -> Floats:
    """Return the numbers of points, without their flags; NaN where these say that one is unseen."""
    marks = [(at, flag) for at, body in enumerate(chosen) for flag in body.flags.values()]
    numbers, flags = np.split(rows, [rows.shape[1] - len(marks)], axis=1)
    unseen = np.zeros((len(rows), len(chosen)), dtype=np.bool_)
    told = set()
    for kind in {flag for _, flag in marks}:
        columns = [column for column, (_, flag) in enumerate(marks) if flag == kind]
        by_kind = are_unseen(flags[:, columns], kind) if _tell(flags[:, columns], kind) else np.zeros(0)
        if by_kind.any():
            for column, hidden in zip(columns, by_kind.T, strict=True):
                unseen[:, marks[column][0]] |= hidden
            told.add("confidence" if kind.is_graded else "flags")
    if not told:
        return numbers
    points = numbers.reshape(len(rows), len(chosen), -1).copy()
    if n_hidden := int((unseen & ~np.isnan(points).any(axis=2)).sum()):
        positions = counted(n_hidden, "position is", "positions are")
        notices.append(f"{positions} unseen, as the columns of {' and '.join(sorted(told))} say")
    points[unseen] = np.nan
    return points.reshape(numbers.shape)


def _tell(flags: Floats, kind: Flag) -> bool:
    """Whether the numbers of columns of one kind may say what is seen: grades, whole ones, or 0 and 1 if they hide."""
    values = flags[~np.isnan(flags)]
    if kind.is_graded or kind.deviates:
        return True
    return bool((np.isin(values, (0.0, 1.0)) if kind.hides else values == np.round(values)).all())


def take_from_rows(
    path: Path, rows: Floats, head: Head, times: Stamps | None, options: Options
) -> Trajectories | PointCloud | Poses:
    """Return the take of rows with the numbers of each body; those of other units are brought to that of the table.

    Parameters
    ----------
    path : Path
        The file.
    rows : ndarray, shape (n_frames, n_numbers)
        In the columns that were chosen.
    head : Head
        Of the table.
    times, options
        As `take_from_head` takes them.
    """
    bodies = head.bodies
    numbers = rows.reshape(len(rows), len(bodies), rows.shape[1] // len(bodies))
    for at, body in enumerate(bodies):
        if body.unit and head.unit and body.unit != head.unit:
            numbers[:, at, : len(AXES)] *= mm_per_unit(path, 1, body.unit) / mm_per_unit(path, 1, head.unit)
    return take_from_head(path, numbers, [body.name for body in bodies], head, times, options)


def take_from_head(
    path: Path, numbers: Floats, names: Sequence[str], head: Head, times: Stamps | None, options: Options
) -> Trajectories | PointCloud | Poses:
    """Return the take of points or bodies of a table, whose head says what their numbers are.

    Parameters
    ----------
    path : Path
        The file.
    numbers : ndarray, shape (n_frames, n_points, 3, 6, 7 or 12)
        As `take_from_table` takes them, or places and three angles.
    names : sequence of str, length n_points
        Of the points.
    head : Head
        Whose first body tells how rotations are written.
    times : Stamps or None
        Of some frames at least.
    options : Options
        As `take_from_table` takes them, and `angle_order`.
    """
    first = head.bodies[0]
    if numbers.shape[2] == len(AXES) * 2:
        numbers = with_quaternions(numbers, first.angle_order, first.angle_unit, options, head.notices)
    elif numbers.shape[2] == len(AXES) * 4 and "8" in first.matrix:
        head.notices.append(BY_ROWS)
    take = take_from_table(path, numbers, names, times, options, head.unit)
    notices = [*head.notices, *take.notices]
    if not head.unit and options.recorded_unit == AUTO:
        notice_landmarks(head.titles, numbers, notices)
    return replace(take, notices=tuple(notices))


def take_from_table(
    path: Path, numbers: Floats, names: Sequence[str], times: Stamps | None, options: Options, unit: str = ""
) -> Trajectories | PointCloud | Poses:
    """Return the take of points or bodies of which no file says rate and unit for certain.

    Parameters
    ----------
    path : Path
        The file.
    numbers : ndarray, shape (n_frames, n_points, 3, 7 or 12)
        Positions in the file's unit; NaN, three zeros or three times another number, such as -9999, where unseen. Of
        bodies followed by the unit quaternion, scalar first, or by the matrix, row by row.
    names : sequence of str, length n_points
        Of the points.
    times : Stamps or None
        Of some frames at least.
    options : Options
        `points`, `recorded_rate` and `recorded_unit` count.
    unit : str
        What the file says, or empty.
    """
    notices: list[str] = []
    numbers = np.array(numbers, dtype=np.float64)
    numbers[np.isinf(numbers)] = np.nan
    if numbers.shape[2] > len(AXES):
        bodies = _lost_unseen(blank_unseen(numbers))
        factor, rate = _factor_and_rate(path, bodies[:, :, : len(AXES)], times, options, unit, notices)
        return take_from_bodies(path, bodies, factor, names, rate, notices)
    positions = equal_unseen(zeros_unseen(numbers), notices)
    _check_together(path, positions)
    factor, rate = _factor_and_rate(path, positions, times, options, unit, notices)
    if not unit and options.recorded_unit == AUTO:
        notice_images(positions, notices)
    computed = None if options.points == ALL_POINTS else are_outputs(names)
    return take_from_markers(path, scaled(path, positions, factor), names, rate, notices, computed)


def _check_together(path: Path, positions: Floats) -> None:
    """Refuse points of which no two are ever seen at once, if several are seen at all."""
    seen = np.isfinite(positions).all(axis=2)
    if len(positions) > _FEW_FRAMES and seen.any(axis=0).sum() > 1 and seen.sum(axis=1).max(initial=0) == 1:
        what = "no two points are in the same row: each was written at times of its own; interpolate at common times"
        raise FormatError(path, "", what)


def _lost_unseen(bodies: Floats) -> Floats:
    """Make bodies NaN at (0, 0, 0), where trackers put one that they lost, or with no rotation.

    A body that stays there, or comes as near to it as it moves in a few frames, is seen there.
    """
    at_origin = (bodies[:, :, : len(AXES)] == 0.0).all(axis=2)
    for body, is_there in enumerate(at_origin.T):
        track = bodies[~is_there & ~np.isnan(bodies[:, body, 0]), body, : len(AXES)]
        with np.errstate(over="ignore", invalid="ignore"):
            steps = np.linalg.norm(np.diff(track, axis=0), axis=1)
            is_near = len(steps) and np.linalg.norm(track, axis=1).min() <= _NEAR_STEPS * np.median(steps)
        at_origin[:, body] &= len(track) > 0 and not is_near
    bodies[at_origin | (bodies[:, :, len(AXES) :] == 0.0).all(axis=2)] = np.nan
    return bodies


def _factor_and_rate(
    path: Path, positions: Floats, times: Stamps | None, options: Options, unit: str, notices: list[str]
) -> tuple[float, float]:
    """Return mm per unit and the frame rate, as stated, measured or assumed; what is assumed is noticed."""
    factor = mm_per_recorded_unit(path, "", unit, positions, options.recorded_unit, notices)
    rate = options.recorded_rate
    if rate == AS_RECORDED_RATE and times is not None:
        rate = times.rate(notices)
    if times is not None and rate != AS_RECORDED_RATE:
        times.notice_skipped(notices)
    if rate == AS_RECORDED_RATE:
        rate = ASSUMED_RATE
        why = "the file states no frame rate" if times is None else "the times of the file tell no frame rate"
        notices.append(f"{why}; 100 Hz is assumed, `--recorded-rate` states another")
    return factor, rate


def _is_wide(head: bytes, path: Path) -> bool:
    lines = [line for line in decoded_head(head).splitlines() if line.strip()]
    return find_head(lines[:HEAD_LINES]) is not None


CSV = Format(
    name="wide-csv",
    title="Wide table of points, CSV",
    suffixes=(".csv",),
    holds="markers",
    sniff=_is_wide,
    read=lambda path, options: read_table(path, read_lines(path, options.sample), options),
    options=(POINTS, BODIES, RECORDED_RATE, RECORDED_UNIT, ANGLE_ORDER),
    note="Columns name_x, name_y, name_z, as of anipose or FreeMoCap; with name_qx or name_roll bodies; rate and unit"
    " by option.",
)
