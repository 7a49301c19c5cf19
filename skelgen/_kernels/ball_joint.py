"""Two bodies and a point of both, over frames."""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import array_kernel, kernel
from skelgen._kernels.small_matrices import by_symmetric, inverse, largest
from skelgen.model.arrays import Floats, Ints

TINY = 1e-12
"""mm; keeps the gradient finite for a joint that sits on a marker."""

LEAST_RADIUS = 1e-300
"""mm; keeps the direction finite of a point that sits on the centre of its sphere."""

SPHERE_RIDGE = 1e-9
"""Weight of nearness in the equations of spheres, relative to the points' spread: it counts only where nothing else
does."""

SPHERE_SETTLED = 1e-6
"""mm; the centre of spheres is found when it moves less."""

FIRST_DAMPING, LEAST_DAMPING, LARGEST_DAMPING = 1e-3, 1e-9, 1e9
SETTLED = 1e-7
"""mm; a frame is settled when its joint moves less."""


def fixed_point_sums(first: Floats, second: Floats, weights: Floats) -> tuple[Floats, Floats, Floats, float, int]:
    """Return what frames say of a point that is fixed in two bodies.

    Parameters
    ----------
    first, second : ndarray, shape (n_frames, 4, 4)
        world_from_body of both; NaN where unknown.
    weights : ndarray, shape (n_frames,)
        Of the frames, not negative.

    Returns
    -------
    tuple
        Weighted means over the frames that show both: of the rotations first from second, shape (3, 3), of the way
        between the origins in both bodies [mm], shape (3,), and of its square [mm^2]; and how many frames these are.
    """
    relative, ways = np.zeros((3, 3)), np.zeros((2, 3))
    square, n_frames = _add_fixed_point(first, second, weights, relative, ways)
    return relative, ways[0], ways[1], square, n_frames


@kernel
def _add_fixed_point(
    first: Floats, second: Floats, weights: Floats, relative: Floats, ways: Floats
) -> tuple[float, int]:
    """Add what `fixed_point_sums` returns, the ways in both bodies one below the other, to arrays of zeros."""
    total, square, n_frames = 0.0, 0.0, 0
    for frame in range(len(weights)):
        if math.isnan(first[frame, 0, 0]) or math.isnan(second[frame, 0, 0]):
            continue
        n_frames += 1
        weight = weights[frame]
        total += weight
        for k in range(3):
            way = second[frame, k, 3] - first[frame, k, 3]
            square += weight * way**2
            for i in range(3):
                weighted = weight * first[frame, k, i]
                ways[0, i] += weighted * way
                ways[1, i] += weight * second[frame, k, i] * way
                for j in range(3):
                    relative[i, j] += weighted * second[frame, k, j]
    for i in range(3):
        ways[0, i] /= total
        ways[1, i] /= total
        for j in range(3):
            relative[i, j] /= total
    return square / total, n_frames


def both_images(first: Floats, second: Floats, in_first: Floats, in_second: Floats) -> tuple[Floats, Floats]:
    """Return where a point of two bodies is in the world.

    Parameters
    ----------
    first, second : ndarray, shape (n_frames, 4, 4)
        world_from_body of both; NaN where unknown.
    in_first, in_second : ndarray, shape (3,), mm
        The point in both.

    Returns
    -------
    tuple of ndarray, shapes (n_frames, 3) [mm] and (n_frames,) [mm^2]
        The middle of both images, or the one that is known, and the square of their distance; NaN where unknown.
    """
    middles, gaps = np.empty((len(first), 3)), np.zeros(len(first))
    _write_images(first, second, in_first, in_second, middles, gaps)
    return middles, gaps


@kernel
def _write_images(
    first: Floats, second: Floats, in_first: Floats, in_second: Floats, middles: Floats, gaps: Floats
) -> None:
    for frame in range(len(first)):
        for i in range(3):
            one, other = first[frame, i, 3], second[frame, i, 3]
            for j in range(3):
                one += first[frame, i, j] * in_first[j]
                other += second[frame, i, j] * in_second[j]
            gaps[frame] += (one - other) ** 2
            if math.isnan(one):
                middles[frame, i] = other
            else:
                middles[frame, i] = one if math.isnan(other) else (one + other) / 2.0


def mean_distances(joint: Floats, markers: Floats) -> tuple[Floats, Floats]:
    """Return mean and standard deviation over frames of each marker's distance [mm] to a joint, shapes (n_markers,).

    Parameters
    ----------
    joint : ndarray, shape (n_frames, 3), mm
        Where it is.
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    distances, (means, spreads, counts) = np.empty(markers.shape[:2]), np.zeros((3, markers.shape[1]))
    _add_distances(joint, markers, distances, means, spreads, counts)
    return means, spreads


@kernel
def _add_distances(
    joint: Floats, markers: Floats, distances: Floats, means: Floats, spreads: Floats, counts: Floats
) -> None:
    n_frames, n_markers = distances.shape
    for frame in range(n_frames):
        for marker in range(n_markers):
            square = 0.0
            for i in range(3):
                square += (joint[frame, i] - markers[frame, marker, i]) ** 2
            distances[frame, marker] = math.sqrt(square)
            if not math.isnan(square):
                means[marker] += distances[frame, marker]
                counts[marker] += 1.0
    for marker in range(n_markers):
        means[marker] /= max(counts[marker], 1.0)
    for frame in range(n_frames):
        for marker in range(n_markers):
            if not math.isnan(distances[frame, marker]):
                spreads[marker] += (distances[frame, marker] - means[marker]) ** 2
    for marker in range(n_markers):
        spreads[marker] = math.sqrt(spreads[marker] / max(counts[marker], 1.0))


@kernel
def spread_of_directions(body: Floats, points: Floats, centre: Floats) -> float:
    """Return how far directions from a centre to points turn: one minus the square of their mean, over all points.

    Parameters
    ----------
    body : ndarray, shape (n_frames, 4, 4)
        world_from_body; NaN where unknown.
    points : ndarray, shape (n_frames, n_points, 3), mm
        World positions, NaN where unseen; each point is seen with the body.
    centre : ndarray, shape (3,), mm
        In the body's frame.
    """
    spread, n_points = 0.0, points.shape[1]
    for point in range(n_points):
        x, y, z, count = 0.0, 0.0, 0.0, 0.0
        for frame in range(len(body)):
            pose, place = body[frame], points[frame, point]
            if math.isnan(pose[0, 0]) or math.isnan(place[0]):
                continue
            a, b, c = place[0] - pose[0, 3], place[1] - pose[1, 3], place[2] - pose[2, 3]
            p = pose[0, 0] * a + pose[1, 0] * b + pose[2, 0] * c - centre[0]
            q = pose[0, 1] * a + pose[1, 1] * b + pose[2, 1] * c - centre[1]
            r = pose[0, 2] * a + pose[1, 2] * b + pose[2, 2] * c - centre[2]
            length = max(math.sqrt(p * p + q * q + r * r), LEAST_RADIUS)
            x, y, z, count = x + p / length, y + q / length, z + r / length, count + 1.0
        spread += (1.0 - (x * x + y * y + z * z) / (count * count)) / n_points
    return spread


@kernel
def move_to_centre(points: Floats, ends: Ints, centre: Floats, rows: Floats, most_steps: int) -> int:
    """Move a point to the common centre of spheres by Gauss-Newton steps on the distances; return how many there were.

    Parameters
    ----------
    points : ndarray, shape (n, 3), mm
        Where points are that move on spheres, one point after the other.
    ends : ndarray of intp, shape (n_points,)
        Where each point ends.
    centre : ndarray, shape (3,), mm
        Where to begin; moved.
    rows : ndarray, shape (n, 4)
        Room: unit vectors to the centre and distances from it, minus the means over each point.
    most_steps : int
        Steps at most.
    """
    for done in range(most_steps):
        a, b, c, d, e, f, p, q, r = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        first = 0
        for point in range(len(ends)):
            x_mean, y_mean, z_mean, mean = 0.0, 0.0, 0.0, 0.0
            share = 1.0 / (ends[point] - first)
            for row in range(first, ends[point]):
                x, y, z = centre[0] - points[row, 0], centre[1] - points[row, 1], centre[2] - points[row, 2]
                distance = max(math.sqrt(x * x + y * y + z * z), LEAST_RADIUS)
                rows[row, 0], rows[row, 1], rows[row, 2] = x / distance, y / distance, z / distance
                rows[row, 3] = distance
                x_mean += share * rows[row, 0]
                y_mean += share * rows[row, 1]
                z_mean += share * rows[row, 2]
                mean += share * distance
            for row in range(first, ends[point]):
                x, y, z = rows[row, 0] - x_mean, rows[row, 1] - y_mean, rows[row, 2] - z_mean
                distance = rows[row, 3] - mean
                a, b, c, d, e, f = a + x * x, b + x * y, c + x * z, d + y * y, e + y * z, f + z * z
                p, q, r = p + distance * x, q + distance * y, r + distance * z
            first = ends[point]
        level = SPHERE_RIDGE * (a + d + f) + LEAST_RADIUS
        step = by_symmetric(inverse((a, b, c, d, e, f), level), (p, q, r))
        for i in range(3):
            centre[i] -= step[i]
        if largest(step) < SPHERE_SETTLED:
            return done + 1
    return most_steps


@array_kernel
def joint_cost(joint: Floats, markers: Floats, weights: Floats, alpha: float, gradient: Floats) -> float:
    """Return the cost of a joint [mm^2], and write its gradient; see `stages.classic.joint_cost`.

    Parameters
    ----------
    joint : ndarray, shape (n_frames, 3), mm
        Where it is.
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Any finite number where unseen.
    weights : ndarray, shape (n_frames, n_markers)
        Of the frames of each marker, with sum 1, or 0 if it is never seen; 0 where unseen.
    alpha : float, mm
        Weight of the mean distance.
    gradient : ndarray, shape (n_frames, 3), mm
        Filled.
    """
    n_frames, n_markers = weights.shape
    distances, means = np.empty((n_frames, n_markers)), np.zeros(n_markers)
    for frame in range(n_frames):
        for marker in range(n_markers):
            square = 0.0
            for i in range(3):
                square += (joint[frame, i] - markers[frame, marker, i]) ** 2
            distances[frame, marker] = math.sqrt(square) + TINY
            means[marker] += weights[frame, marker] * distances[frame, marker]
    value, n_seen = 0.0, 0
    for marker in range(n_markers):
        value += alpha * means[marker]
        n_seen += means[marker] > 0.0
    n_seen = max(n_seen, 1)
    for frame in range(n_frames):
        for i in range(3):
            gradient[frame, i] = 0.0
        for marker in range(n_markers):
            weight, deviation = weights[frame, marker], distances[frame, marker] - means[marker]
            value += weight * deviation**2
            factor = weight * (2.0 * deviation + alpha) / distances[frame, marker] / n_seen
            for i in range(3):
                gradient[frame, i] += factor * (joint[frame, i] - markers[frame, marker, i])
    return value / n_seen


@array_kernel
def multilaterated(joint: Floats, markers: Floats, radii: Floats, most_steps: int) -> Floats:
    """Move the joint in every frame to where its distances to the markers are nearest to given ones.

    Parameters
    ----------
    joint : ndarray, shape (n_frames, 3), mm
        Where it is, and, overwritten, where it is moved: by damped Gauss-Newton steps.
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    radii : ndarray, shape (n_markers,), mm
        The distances.
    most_steps : int
        Steps at most.

    Returns
    -------
    ndarray, shape (n_frames,), mm^2
        Mean squared error of the distances.
    """
    n_frames, n_markers = markers.shape[:2]
    errors = np.zeros(n_frames)
    for frame in range(n_frames):
        x, y, z = joint[frame, 0], joint[frame, 1], joint[frame, 2]
        step, damping, before, tried = (0.0, 0.0, 0.0), FIRST_DAMPING, np.inf, 0
        normal, right = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        while True:
            u, v, w = x + step[0], y + step[1], z + step[2]
            square, n_seen = 0.0, 0
            a, b, c, d, e, f, p, q, r = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for marker in range(n_markers):
                i, j, k = u - markers[frame, marker, 0], v - markers[frame, marker, 1], w - markers[frame, marker, 2]
                distance = math.sqrt(i * i + j * j + k * k) + TINY
                if math.isnan(distance):
                    continue
                n_seen += 1
                error = distance - radii[marker]
                square += error * error
                i, j, k = i / distance, j / distance, k / distance
                a, b, c, d, e, f = a + i * i, b + i * j, c + i * k, d + j * j, e + j * k, f + k * k
                p, q, r = p + error * i, q + error * j, r + error * k
            settled = tried > 0 and square <= before and largest(step) < SETTLED
            if square <= before:
                x, y, z, before = u, v, w, square
                normal, right = (a, b, c, d, e, f), (p, q, r)
                if tried:
                    damping = max(damping / 5.0, LEAST_DAMPING)
            else:
                damping = min(damping * 10.0, LARGEST_DAMPING)
            if settled or tried == most_steps or n_seen == 0:
                break
            tried += 1
            one, two, three = by_symmetric(inverse(normal, damping), right)
            step = (-one, -two, -three)
        joint[frame, 0], joint[frame, 1], joint[frame, 2] = x, y, z
        errors[frame] = before / max(n_seen, 1)
    return errors
