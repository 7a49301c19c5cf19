"""Labels put right in turns: exchanges, moves, chains and groups, each kept only where the whole take says so.

The moves grow in size. Two markers are exchanged for a while (`exchanges`); a piece goes to a marker that is not seen
meanwhile (`leftovers`), or pushes others on (`chains`). When these find nothing more, what was hidden at once is
matched as a group (`hidden_groups`). After each change, markers that were found twice may be joined, which may open the
next exchange: two markers that swapped their names can only be exchanged back when both have all of their parts. A
piece that is moved may be too short to speak in the evidence, or may speak against it; the first turn keeps such
pieces, a later one in which nothing is gained is the last.
"""

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Ints
from skelgen.stages.labels.merging.chains import push_pieces
from skelgen.stages.labels.merging.exchanges import exchange_markers
from skelgen.stages.labels.merging.hidden_groups import match_hidden
from skelgen.stages.labels.merging.leftovers import label_leftovers, move_pieces
from skelgen.stages.labels.merging.likelihood import evidence_of_labels
from skelgen.stages.labels.merging.markers import join_duplicates, merge_again, sampled_distances

MOST_TURNS = 12
"""A guard: most takes need one or two."""

MOST_POINTS = 6_000_000
"""Of more, some twelve minutes of 40 markers at 200 Hz, there are exchanges and moves only, in one turn: markers are
compared so rarely then that pieces lie between, and an hour must do with 2.5 GB."""

MOST_AGAINST = 12.0
"""nats at most that speak against a lasting track that is no known marker's: reflections last, too."""


def put_right(
    cloud: PointCloud, track_of_point: Ints, marker_of_point: Ints, rate: float, spacing: float, fixed: Bools
) -> Ints:
    """Put right what goes on under another marker's number, but for what the user states; then more may be one.

    Tracks that are left over are compared again: markers may have their own distances now.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    track_of_point, marker_of_point : ndarray of intp, shape (n_points,)
        Track and marker of each point, -1 for none.
    rate : float, Hz
        Frame rate.
    spacing : float, mm
        Typical distance of neighbouring markers.
    fixed : ndarray of bool, shape (n_points,)
        Points that keep their marker.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none, numbered without holes.
    """
    found, evidence = marker_of_point, _evidence(cloud, marker_of_point, rate, spacing)
    looks_far = cloud.n_points <= MOST_POINTS
    for turn in range(MOST_TURNS if looks_far else 1):
        right = exchange_markers(cloud, track_of_point, found, rate, spacing, fixed)
        right = move_pieces(cloud, track_of_point, right, sampled_distances(cloud, right, rate), spacing, fixed)
        right = push_pieces(cloud, track_of_point, right, rate, spacing, fixed) if looks_far else right
        if right is found or (turn and _evidence(cloud, right, rate, spacing) <= evidence):
            matched = match_hidden(cloud, track_of_point, right, rate, spacing, fixed) if looks_far else right
            if matched is right:
                found = right
                break
            right = matched
        merged = merge_again(cloud, track_of_point, right, rate, spacing)
        found = join_duplicates(cloud, merged, rate, spacing)
        evidence = _evidence(cloud, found, rate, spacing)
    sums = sampled_distances(cloud, found, rate)
    return label_leftovers(cloud, track_of_point, found, sums, spacing, MOST_AGAINST)


def _evidence(cloud: PointCloud, marker_of_point: Ints, rate: float, spacing: float) -> float:
    """How well labels explain the take [nats]."""
    return evidence_of_labels(sampled_distances(cloud, marker_of_point, rate), spacing)[0]
