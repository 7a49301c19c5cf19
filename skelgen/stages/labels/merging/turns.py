"""Labels put right in turns: exchanges, moves, chains and groups, each kept only where the whole take says so.

The moves grow in size. Two markers are exchanged for a while (`exchanges`); a piece goes to a marker that is not seen
meanwhile (`leftovers`), or pushes others on (`chains`). When these find nothing more, what was hidden at once is
matched as a group (`hidden_groups`). After each change, markers that were found twice may be joined, which may open the
next exchange: two markers that swapped their names can only be exchanged back when both have all of their parts. A
piece that is moved may be too short to speak in the evidence, or may speak against it; the first turn keeps such
pieces, a later one in which nothing is gained is the last. When it is over, the same goes on with moments that count by
how much the posture changes (`followed`): what is wrong in a posture that lasts is not moved before, as it speaks for
itself too often, and with such moments alone there is too little evidence to begin with. The largest moves come at the
end of all: parts that are alike, as both legs are, are exchanged (`alike_parts`), and what that opens is put right.
"""

import math
from dataclasses import replace

from skelgen.model.arrays import Ints
from skelgen.stages.labels.merging.alike_parts import exchange_alike
from skelgen.stages.labels.merging.chains import push_pieces
from skelgen.stages.labels.merging.exchanges import exchange_markers
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.hidden_groups import match_hidden
from skelgen.stages.labels.merging.judging import better_labels
from skelgen.stages.labels.merging.leftovers import label_leftovers, move_pieces
from skelgen.stages.labels.merging.markers import join_duplicates, merge_again

MOST_TURNS = 12
"""A guard: most takes need one or two."""

MOST_AGAINST = 12.0
"""nats at most that speak against a lasting track that is no known marker's: reflections last, too."""


def put_right(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Put right what goes on under another marker's number, but for what the user states; then more may be one.

    Tracks that are left over are compared again: markers may have their own distances now.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none, numbered without holes.
    """
    looks_far, found = not take.is_very_long, marker_of_point
    for judged in (take, replace(take, by_posture=True)) if looks_far else (take,):
        found = _in_turns(judged, found, looks_far)
    return label_leftovers(take, found, MOST_AGAINST)


def with_alike_apart(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Exchange parts that are alike, a left and a right leg, and put right what that opens, while more is explained.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none, numbered without holes; the given array if nothing is exchanged.
    """
    found = marker_of_point
    for _ in range(MOST_TURNS if not take.is_very_long else 0):
        exchanged = exchange_alike(take, found)
        right = found if exchanged is found else better_labels(take, found, put_right(take, exchanged))
        if right is found:
            break
        found = right
    return found


def _in_turns(take: FollowedCloud, marker_of_point: Ints, looks_far: bool) -> Ints:
    """Marker of each point when no turn gains anything more."""
    found, evidence = marker_of_point, -math.inf
    for _ in range(MOST_TURNS if looks_far else 1):
        right = move_pieces(take, exchange_markers(take, found))
        right = push_pieces(take, right) if looks_far else right
        if right is found or take.evidence(right)[0] <= evidence:
            matched = match_hidden(take, right) if looks_far else right
            if matched is right:
                return right
            right = matched
        found = join_duplicates(take, merge_again(take, right))
        evidence = take.evidence(found)[0]
    return found
