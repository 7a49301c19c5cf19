"""What is held before the cameras of a room to calibrate them: the wand, and the L-frame on the ground.

The wand in images is three balls on a line, whose distances say which end is which, or two balls. A wand with its balls
at 0, d and D is seen with its middle ball at about d / D of its length: perspective shifts that by as much as one end
is farther away than the other.

Two balls look alike: which ball of one image is which of the others, only several images together say. Two images are
related by a fundamental matrix. The middles of the wand give a first one, as near as perspective leaves them in the
middle; it says of each moment which way round the balls fit better, these give a better matrix, and so on. Where both
ways fit, as the wand lies along the epipolar lines, other cameras decide, or the moment is left out.

Ground plane and origin come from the L-frame, or any three balls on the floor, one in the corner and one on each arm.
The arms differ in length, so that the distances between the balls say which is which. x runs along the first arm, z up.
"""

from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np

from skelgen.capture.images import opencv
from skelgen.capture.room.points import PointMatcher, Views
from skelgen.errors import InputError
from skelgen.geometry.rotations import transform_from
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import CameraRig

TWO, N_BALLS = 2, 3
NEARER = 1.5
"""Ratio of the distances of both ends from a camera, at most: a wand of half a metre at one and a half."""

OFF_LINE, OFF_PIXELS = 0.02, 1.5
"""How far the middle ball is seen off the line, as a part of the length, and px: lenses bend lines."""

SHORTEST = 20.0
"""px; a wand that is seen from its end shows nothing."""

MOST_BALLS = 8
"""An image with more balls shows more than a wand, of which three may lie on a line by chance."""

LEAST_UNEVEN = 0.06
"""Of the length: how far the middle ball must be from the middle of a wand to tell its ends apart."""


def check_wand(distances: Sequence[float]) -> Floats:
    """Return where the balls of a wand are, from the end that the middle one is nearer to, shape (2 or 3,), mm.

    Parameters
    ----------
    distances : sequence of float, mm
        Where they are along the wand, in order.

    Raises
    ------
    InputError
        If its ends cannot be told apart in an image.
    """
    places = np.array(distances, dtype=np.float64)
    if len(places) not in {TWO, N_BALLS} or not np.isfinite(places).all() or not (np.diff(places) > 0).all():
        text = ", ".join(f"{place:g}" for place in places)
        raise InputError(f"the wand has balls at {text} mm; give two or three places in order, as 0, 180, 500")
    places -= places[0]
    if len(places) == TWO:
        return places
    if places[1] > places[2] / 2:
        places = (places[2] - places)[::-1].copy()
    if places[1] > (0.5 - LEAST_UNEVEN) * places[2]:
        raise InputError(
            f"the middle ball of the wand is at {100 * places[1] / places[2]:.0f} % of its length, so that its ends "
            "look alike; move it to about a third"
        )
    return places


def find_wand(centres: Floats, wand: Floats) -> Floats:
    """Return where an image shows the balls of a wand, shape (n_balls, 2), px; NaN if it shows none, or several.

    Parameters
    ----------
    centres : ndarray, shape (n_balls, 2), px
        All balls of the image, the largest first.
    wand : ndarray, shape (2 or 3,), mm
        From `check_wand`. Two balls come in any order.
    """
    if len(wand) == TWO:
        is_one = len(centres) == TWO and np.linalg.norm(centres[1] - centres[0]) >= SHORTEST
        return np.asarray(centres) if is_one else np.full((TWO, 2), np.nan)
    none = np.full((N_BALLS, 2), np.nan)
    if not N_BALLS <= len(centres) <= MOST_BALLS:
        return none
    triples = centres[np.array(list(combinations(range(len(centres)), N_BALLS)))]
    orders = np.array([(0, 1, 2), (1, 2, 0), (2, 0, 1)])
    lengths = np.linalg.norm(triples[:, orders[:, 0]] - triples[:, orders[:, 2]], axis=2)
    rows = np.arange(len(triples))[:, np.newaxis]
    ends = triples[rows, orders[lengths.argmax(axis=1)]]  # of each, its ends first and last
    along, middle = ends[:, 2] - ends[:, 0], ends[:, 1] - ends[:, 0]
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
    part = (along * middle).sum(axis=1) / length**2
    off = np.abs(along[:, 0] * middle[:, 1] - along[:, 1] * middle[:, 0]) / length
    turned = part > 0.5
    ends[turned], part[turned] = ends[turned, ::-1], 1.0 - part[turned]
    low, high = _parts_seen(wand)
    fits = (part >= low) & (part <= high) & (off <= OFF_LINE * length + OFF_PIXELS) & (length >= SHORTEST)
    return ends[fits.argmax()] if fits.sum() == 1 else none


def _parts_seen(wand: Floats) -> tuple[float, float]:
    """At which part of its length the middle ball is seen, at least and at most."""
    part = wand[1] / wand[2]
    low, high = (part * ratio / (1 - part + part * ratio) for ratio in (1 / NEARER, NEARER))
    return float(low), min(float(high), 0.5)


ROUNDS = 4
"""From the middles to the balls: three change nothing more."""

CLEARER = 3.0
"""By how much the better way round must fit, in times of the usual misfit and in px."""


def with_equal_ends(seen: Floats, least_shared: int) -> Floats:
    """Return the balls of all images in one order in each frame.

    Parameters
    ----------
    seen : ndarray, shape (n_frames, n_cameras, 2, 2), px
        Where each image shows the two balls, in any order; NaN where it does not.
    least_shared : int
        Frames that two cameras must share to be compared.

    Returns
    -------
    ndarray, shape (n_frames, n_cameras, 2, 2), px
        NaN also where nothing says which ball is which.
    """
    shows = np.asarray(np.isfinite(seen[:, :, 0, 0]))
    n_frames, n_cameras = shows.shape
    evidence = np.zeros((n_frames, n_cameras, n_cameras))
    for one, two in combinations(range(n_cameras), 2):
        both = np.flatnonzero(shows[:, one] & shows[:, two])
        if len(both) >= least_shared:
            evidence[both, one, two] = evidence[both, two, one] = _evidence(seen[both, one], seen[both, two])
    is_turned, is_known = _ways_round(evidence, shows)
    ordered = np.where(is_turned[..., np.newaxis, np.newaxis], seen[:, :, ::-1], seen)
    ordered[~is_known] = np.nan
    return np.asarray(ordered)


def _evidence(one: Floats, two: Floats) -> Floats:
    """How much better both fit the same way round than turned, shape (n,); 0 where that is not clear."""
    cv2 = opencv()
    left, right = one.mean(axis=1), two.mean(axis=1)
    better = np.zeros(len(one))
    for _ in range(ROUNDS):
        matrix, _ = cv2.findFundamentalMat(left, right, cv2.FM_LMEDS)
        if matrix is None or matrix.shape != (3, 3):
            return np.zeros(len(one))
        straight, turned = _misfit(matrix, one, two), _misfit(matrix, one, two[:, ::-1])
        better = turned - straight
        same_way = np.where((better >= 0)[:, np.newaxis, np.newaxis], two, two[:, ::-1])
        left, right = one.reshape(-1, 2), same_way.reshape(-1, 2)
    usual = max(float(np.median(np.minimum(straight, turned))), 1.0)
    return np.where(np.abs(better) >= CLEARER * usual, better, 0.0)


def _misfit(matrix: Floats, one: Floats, two: Floats) -> Floats:
    """How far two balls lie from their epipolar lines, both together, shape (n,), px."""
    a = np.concatenate([one, np.ones((*one.shape[:2], 1))], axis=2)
    b = np.concatenate([two, np.ones((*two.shape[:2], 1))], axis=2)
    ahead, back = a @ matrix.T, b @ matrix
    off = np.abs((b * ahead).sum(axis=2))
    across = np.hypot(ahead[..., 0], ahead[..., 1]), np.hypot(back[..., 0], back[..., 1])
    return np.asarray((off / np.maximum(np.minimum(*across), 1e-12)).sum(axis=1))


def _ways_round(evidence: Floats, shows: Bools) -> tuple[Bools, Bools]:
    """Which balls are to be exchanged, and where that is certain, shapes (n_frames, n_cameras): clearest first."""
    n_frames, n_cameras = shows.shape
    is_turned, is_known = np.zeros_like(shows), np.zeros_like(shows)
    strength, frames = np.abs(evidence), np.arange(n_frames)
    is_known[frames, strength.max(axis=2).argmax(axis=1)] = strength.max(axis=(1, 2)) > 0
    for _ in range(n_cameras - 1):
        open_ends = np.where(is_known[:, :, np.newaxis] & ~is_known[:, np.newaxis], strength, 0.0)
        best = open_ends.reshape(n_frames, -1).argmax(axis=1)
        known, new = best // n_cameras, best % n_cameras
        there = frames[open_ends[frames, known, new] > 0]
        known, new = known[there], new[there]
        is_turned[there, new] = is_turned[there, known] ^ (evidence[there, known, new] < 0)
        is_known[there, new] = True
    return is_turned, is_known & shows


TOLERANCE = 0.02
"""Relative error of the three distances up to which three balls are the frame."""

ALIKE = 0.1
"""Relative difference of the arms below which they cannot be told apart."""

FEWEST_CAMERAS = 2
"""Cameras that a point needs."""

N_ARMS = 2


def find_ground(frames: Sequence[Views], rig: CameraRig, arms: Sequence[float]) -> Floats:
    """Return where an L-frame on the floor is: world_from_ground, shape (4, 4), mm.

    Parameters
    ----------
    frames : sequence of views
        What all cameras see while it lies still.
    rig : CameraRig
        The cameras.
    arms : sequence of float, mm
        From the ball in the corner to the two others; x runs along the first arm. Where these do not stand at right
        angles, the distance between the two others is the third number.

    Raises
    ------
    InputError
        If it is not seen, or the cameras would be below the floor.
    """
    wanted = _distances(arms)
    matcher, found = PointMatcher(rig), []
    for views in frames:
        points = matcher.find(views)
        corner = _corner(points.points[points.n_cameras >= FEWEST_CAMERAS], wanted)
        if corner is not None:
            found.append(corner)
    if not found:
        raise InputError(
            f"no three balls {wanted[0]:g}, {wanted[1]:g} and {wanted[2]:.0f} mm apart are seen by two cameras: "
            "lay the L-frame on the floor in the middle of the room, and give its arms; if they are right, the wand's "
            "distances are not"
        )
    origin, first, second = np.median(found, axis=0)
    x = (first - origin) / np.linalg.norm(first - origin)
    z = np.cross(x, second - origin)
    z /= np.linalg.norm(z)
    world_from_ground = transform_from(np.column_stack([x, np.cross(z, x), z]), origin)
    heights = (rig.places - origin) @ z
    if np.median(heights) < 0:
        raise InputError(
            "the cameras would be below the floor: the frame's short arm must point to the left of its long arm, seen "
            "from above; exchange the arms, or the order in which they are given"
        )
    return world_from_ground


def _distances(arms: Sequence[float]) -> Floats:
    """From the corner to both ends and between these, shape (3,), mm; which ball is which must show."""
    along, aside = arms[:2]
    between = arms[2] if len(arms) > N_ARMS else float(np.hypot(along, aside))
    if not (along > 0 and aside > 0 and abs(along - aside) > ALIKE * max(along, aside)):
        raise InputError(f"the arms of the L-frame are {along:g} and {aside:g} mm; they must differ by a tenth or more")
    if not abs(along - aside) < between < along + aside:
        raise InputError(f"no three balls are {along:g}, {aside:g} and {between:g} mm apart; measure their distances")
    wanted = np.array([along, aside, between])
    if len(arms) > N_ARMS and (np.abs(wanted[:2] - between) <= ALIKE * between).any():
        raise InputError(
            f"the three balls are {along:g}, {aside:g} and {between:g} mm apart; each two must differ by a tenth or "
            "more, to tell the balls from each other"
        )
    return wanted


def _corner(points: Floats, wanted: Floats) -> Floats | None:
    """Corner, end of the first arm and end of the second one among points; None if no three have their distances."""
    if not 3 <= len(points) <= 12:
        return None
    chosen = np.array(list(permutations(range(len(points)), 3)))
    corner, first, second = (points[chosen[:, index]] for index in range(3))
    gaps = [np.linalg.norm(a - b, axis=1) for a, b in ((first, corner), (second, corner), (first, second))]
    off = np.abs(np.stack(gaps, axis=1) / wanted - 1.0).max(axis=1)
    best = int(off.argmin())
    return points[chosen[best]] if off[best] <= TOLERANCE else None
