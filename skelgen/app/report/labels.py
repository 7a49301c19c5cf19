"""What the report says of the labels: gaps, how sure they are and where not, what can be done, what they were made of.

Above, every track lies in a lane, coloured by the limb of the marker that it went to, grey if it was left out; below,
the same tracks in a row per marker. Two shades take turns, so that tracks that follow each other look different.
"""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from skelgen.app.advice import REMEDIES, advice_on, doubtful_share, left_out_share, open_questions
from skelgen.app.drawing import measures, svg
from skelgen.app.drawing.scales import limb_colour
from skelgen.app.drawing.wording import duration, millimetres, percent
from skelgen.app.report.pictures import (
    BOTTOM,
    LEAST_WIDTH,
    LEFT,
    MOST_BINS,
    PLOT,
    WIDTH,
    confidence_figure,
    gaps_figure,
    parted,
    png_uri,
    row_height,
    row_labels,
    time_axis,
)
from skelgen.app.tables import column_rows
from skelgen.kinematics.gap_filling.filling import fill_project
from skelgen.model import Labelling, PointCloud, Project
from skelgen.model.arrays import Ints
from skelgen.model.filled import PositionSource
from skelgen.model.labelling import Doubt, Finding, Tracklets, seen_runs
from skelgen.progress import Monitor, counted

_SOURCE_WORDS = {
    PositionSource.LIMB: "Filled from limb",
    PositionSource.JOINT: "Filled with joint",
    PositionSource.INTERPOLATED: "Interpolated",
    PositionSource.PATTERN: "By another marker",
}

_MOST_ROWS = 40
"""Doubtful spans in the table, the longest; the others are counted."""

_MOST_QUESTIONS = 10
"""Questions in the report, those that settle most."""

_FINDING_WORDS = {
    "exchanged": "Labels exchanged",
    "moved": "Label on another marker",
    "slipped": "Marker slipped",
    "fallen": "Marker fell off",
    "filled": "Gaps filled",
    "spike": "Spikes",
}


@dataclass(frozen=True, eq=False)
class LabelsContent:
    """What the template shows of the labels.

    Attributes
    ----------
    facts : list of tuple of str
        Names and values.
    advice, questions : list of str
        What could be done, and what the user could tell.
    rate : float, Hz
        Of the take.
    rows : list of tuple of str, Doubt and str
        The longest doubtful spans: marker, span, and what to do.
    findings : list of tuple of str and Finding
        Errors in the file, the first: what each is in words, and it.
    more, more_findings : int
        How many of both are not shown.
    confidence, tracks, marker_tracks : str
        Figures; empty where nothing is known of tracks.
    classic : list of tuple of str
        Method, markers, points with a marker and agreement; empty if there is nothing to compare.
    """

    facts: list[tuple[str, str]]
    advice: Sequence[str]
    questions: list[str]
    rate: float
    rows: list[tuple[str, Doubt, str]]
    findings: list[tuple[str, Finding]]
    more: int
    more_findings: int
    confidence: str
    tracks: str
    marker_tracks: str
    classic: list[tuple[str, str, str, str]]


def labels_content(project: Project) -> LabelsContent:
    """Return what the template shows of the labels of a project that knows how sure they are."""
    labelling, names = project.labelling, project.trajectories.names
    drawn = labelling.tracklets if labelling.tracklets is not None and labelling.tracklets.n_parts else None
    shown = sorted(labelling.doubts, key=lambda doubt: doubt.first_frame - doubt.last_frame)[:_MOST_ROWS]
    return LabelsContent(
        facts=_facts(project),
        advice=advice_on(project),
        questions=[one.sentence(names) for one in open_questions(project)[:_MOST_QUESTIONS]],
        rate=project.trajectories.rate,
        rows=[(names[one.marker], one, REMEDIES[one.kind]) for one in sorted(shown, key=lambda one: one.first_frame)],
        findings=[(_FINDING_WORDS[finding.kind], finding) for finding in labelling.findings[:_MOST_ROWS]],
        more=len(labelling.doubts) - len(shown),
        more_findings=max(len(labelling.findings) - _MOST_ROWS, 0),
        confidence=confidence_figure(project),
        tracks=_tracks_figure(project, drawn) if drawn else "",
        marker_tracks=_marker_tracks_figure(project, drawn) if drawn else "",
        classic=_comparison(project, labelling),
    )


def _facts(project: Project) -> list[tuple[str, str]]:
    labelling = project.labelling
    facts = []
    if labelling.tracklets is not None:
        facts += [
            ("Tracklets", str(labelling.tracklets.n_tracklets)),
            ("of which left out", str(labelling.tracklets.n_left_out)),
            ("of which divided", str(labelling.tracklets.n_divided)),
            ("Stretches of markers", str(len(seen_runs(project.trajectories.seen)[0]))),
        ]
    if isinstance(project.take, PointCloud):
        left_out = f"{int(labelling.left_out.sum())} ({percent(left_out_share(project))})"
        facts.append(("Points left out", left_out))
    facts.append(("Doubtful spans", str(len(labelling.doubts))))
    facts.append(("Doubtful positions", percent(doubtful_share(labelling))))
    facts.append(("Pairs that no distance distinguishes", str(len(labelling.twins))))
    return facts


def _comparison(project: Project, labelling: Labelling) -> list[tuple[str, str, str, str]]:
    """Rows of method, markers, points with a marker, agreement; empty if there is nothing to compare."""
    classic = labelling.classic
    if classic is None:
        return []
    own = project.trajectories
    method = str(project.reports["labels"].parameters.get("method", "this run")) if "labels" in project.reports else ""
    counts = [counted(each.n_markers, "marker") for each in (own, classic)]
    return [
        (method, counts[0], str(int(own.seen.sum())), ""),
        (f"{classic.method} (classic)", counts[1], str(classic.n_points), percent(classic.share)),
    ]


_MOST_LANES = 200  # more lanes share rows: a picture, not a list
_LANE = 4.0  # px
_LARGEST_HEIGHT = 400.0  # px
_ROOM = 3  # pixels free behind a track, so that two do not look like one
_LEFT_OUT = (128, 128, 128, 150)
_LIGHTER = 0.55  # of the way to white: the second shade
_WHITE = 255


def _tracks_figure(project: Project, tracklets: Tracklets) -> Markup:
    """Draw the tracks as points were followed.

    Parameters
    ----------
    project : Project
        With labels.
    tracklets : Tracklets
        Of its labels.
    """
    n_frames = project.trajectories.n_frames
    lane, n_lanes = lanes(*tracklets.spans, room=max(1, _ROOM * n_frames // MOST_BINS))
    pixels = _painted(tracklets, lane[tracklets.track], n_lanes, n_frames, _colours(project, tracklets))
    height = min(_LANE * n_lanes, _LARGEST_HEIGHT)
    picture = svg.image(LEFT, 0, PLOT, height, png_uri(pixels))
    axis = time_axis(project.trajectories, height)
    return svg.drawing(WIDTH, height + BOTTOM, "Tracks as points were followed", picture, axis, least=LEAST_WIDTH)


def _marker_tracks_figure(project: Project, tracklets: Tracklets) -> Markup:
    """Draw the same tracks in the rows of the markers that they went to, with the number of parts at the right.

    Parameters
    ----------
    project : Project
        With labels.
    tracklets : Tracklets
        Of its labels.
    """
    order = measures.subtree_markers(project)
    row_of_marker = np.full(len(order) + 1, -1, dtype=np.intp)  # the last one is for what was left out
    row_of_marker[order] = np.arange(len(order))
    rows = row_of_marker[tracklets.marker]
    n_frames = project.trajectories.n_frames
    pixels = _painted(tracklets, rows, len(order), n_frames, _colours(project, tracklets))
    row = row_height(len(order))
    height = row * len(order)
    counts = np.bincount(rows[rows >= 0], minlength=len(order))
    names = [project.trajectories.names[marker] for marker in order.tolist()]
    picture = svg.image(LEFT, 0, PLOT, height, png_uri(parted(pixels, row)))
    labels = row_labels(names, [str(count) for count in counts.tolist()], row)
    axis = time_axis(project.trajectories, height)
    return svg.drawing(WIDTH, height + BOTTOM, "Markers and their tracks", picture, *labels, axis, least=LEAST_WIDTH)


def lanes(first: Ints, last: Ints, room: int) -> tuple[Ints, int]:
    """Put tracks into as few lanes as possible.

    Parameters
    ----------
    first, last : ndarray of intp, shape (n_tracks,)
        Frames of each track.
    room : int
        Frames between two tracks of a lane.

    Returns
    -------
    lane : ndarray of intp, shape (n_tracks,)
        Lane of each track; only where there are very many tracks at once do several share one.
    n_lanes : int
        Number of lanes, at least one.
    """
    lane = np.zeros(len(first), dtype=np.intp)
    free: list[int] = []
    busy: list[tuple[int, int]] = []
    n_lanes = 0
    for track in np.lexsort((-last, first)).tolist():
        while busy and busy[0][0] < first[track]:
            heapq.heappush(free, heapq.heappop(busy)[1])
        if free:
            lane[track] = heapq.heappop(free)
        else:
            lane[track], n_lanes = n_lanes, n_lanes + 1
        heapq.heappush(busy, (int(last[track]) + room, int(lane[track])))
    if n_lanes > _MOST_LANES:
        return np.asarray(lane * _MOST_LANES // n_lanes), _MOST_LANES
    return lane, max(n_lanes, 1)


def _colours(project: Project, tracklets: Tracklets) -> NDArray[np.uint8]:
    """Red, green, blue and alpha of each part, shape (n_parts, 4)."""
    n_markers = project.trajectories.n_markers
    limb_of_marker = project.limbs.limb_of_marker if project.has("limbs") else np.arange(n_markers)
    palette = np.array([_rgb(limb) for limb in range(int(limb_of_marker.max(initial=-1)) + 1)]).reshape(-1, 3)
    limb = np.append(limb_of_marker, -1)[tracklets.marker]
    rgba = np.tile(np.array(_LEFT_OUT, dtype=np.uint8), (tracklets.n_parts, 1))
    colour = palette[limb[limb >= 0]]
    lighter = _turn(tracklets)[limb >= 0, np.newaxis]
    rgba[limb >= 0, :3] = colour + lighter * _LIGHTER * (_WHITE - colour)
    rgba[limb >= 0, 3] = _WHITE
    return rgba


def _turn(tracklets: Tracklets) -> Ints:
    """0 and 1 in turns for the successive parts of each marker, shape (n_parts,)."""
    order = np.lexsort((tracklets.first, tracklets.marker))
    marker = tracklets.marker[order]
    starts = np.searchsorted(marker, marker)
    turn = np.empty(len(order), dtype=np.intp)
    turn[order] = (np.arange(len(order)) - starts) % 2
    return turn


def _rgb(limb: int) -> list[int]:
    code = limb_colour(limb)
    return [int(code[place : place + 2], 16) for place in (1, 3, 5)]


def _painted(
    tracklets: Tracklets, rows: Ints, n_rows: int, n_frames: int, rgba: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Paint the parts of tracks into their rows, long ones first, shape (n_rows, n_bins, 4)."""
    n_bins = min(max(n_frames, 1), MOST_BINS)
    pixels = np.zeros((n_rows, n_bins, 4), dtype=np.uint8)
    begins, ends = (tracklets.first * n_bins // n_frames, tracklets.last * n_bins // n_frames + 1)
    for part in np.argsort(tracklets.first - tracklets.last, kind="stable").tolist():
        if rows[part] >= 0:
            pixels[rows[part], begins[part] : ends[part]] = rgba[part]
    return pixels


@dataclass(frozen=True, eq=False)
class GapsContent:
    """The section of when each marker is seen.

    Attributes
    ----------
    figure : Markup
        Timeline of all markers.
    facts : list of tuple of str
        Names and values.
    can_fill : bool
        Whether there are gaps, and a skeleton that fills them.
    """

    figure: Markup
    facts: list[tuple[str, str]]
    can_fill: bool = False


def gaps_content(project: Project, monitor: Monitor) -> GapsContent:
    """Return the section of gaps; with a skeleton, what they can be filled from.

    Parameters
    ----------
    project : Project
        With labelled markers.
    monitor : Monitor
        Receives progress; may cancel.
    """
    facts = _gap_facts(project)
    if not project.has("skeleton") or project.trajectories.seen.all():
        return GapsContent(gaps_figure(project), facts)
    filled = fill_project(project, monitor)
    for source, words in _SOURCE_WORDS.items():
        stds = filled.std[filled.source == source]
        if len(stds):
            facts.append((words, f"{len(stds)} (± {millimetres(float(np.median(stds)))})"))
    return GapsContent(gaps_figure(project, filled), facts, can_fill=True)


def _gap_facts(project: Project) -> list[tuple[str, str]]:
    rows = column_rows(project.trajectories)
    longest = max(rows, key=lambda row: row["longest_gap"] or 0)
    complete = sum(not row["gaps"] for row in rows)
    facts = [
        ("Seen", percent(float(project.trajectories.seen.mean()))),
        ("Gaps", str(sum(row["gaps"] or 0 for row in rows))),
        ("Markers without a gap", f"{complete} of {len(rows)}"),
    ]
    if frames := longest["longest_gap"]:
        time = duration(frames / project.trajectories.rate)
        facts.append(("Longest gap", f"{counted(frames, 'frame')} ({time}) at {longest['name']}"))
    return facts
