"""One marker and the balls that may be it: where it is by some of them, with its covariance, and which others fit.

A camera is given by the twelve numbers of its camera_from_world; balls by their rays, and by the spread of these (see
`skelgen._kernels.camera.rays_of_pixels`). Balls of all cameras stand one behind the other.
"""

from __future__ import annotations

from typing import NamedTuple

from skelgen._kernels import kernel_part
from skelgen._kernels.small_matrices import (
    Vector,
    block,
    by_symmetric,
    column,
    dot,
    inverse,
    minus,
    plus,
    times,
    transposed,
    turned,
    vector,
)
from skelgen.model.arrays import Floats, Ints

FEWEST_TO_DROP = 3.0
"""Balls of which none is taken away: of three that do not fit nobody knows which is wrong."""

N_STEPS = 2
"""Gauss and Newton's steps to the most likely point: rays that meet leave nothing for a third."""

LEVEL = 1e-30
"""Added to the information [1/mm^2]: nothing beside that of any ball."""

Misfit = tuple[tuple[float, Vector], tuple[float, Vector]]
"""Seen minus expected of a ball and its slope by the point, twice."""


class Room(NamedTuple):
    """Cameras and what they see.

    Attributes
    ----------
    poses : ndarray, shape (n_cameras, 3, 4), mm
        camera_from_world of each.
    places : ndarray, shape (n_cameras, 3), mm
        Where they stand.
    essential : ndarray, shape (n_cameras, n_cameras, 3, 3)
        y^T E x = 0 for rays x of the first and y of the second of two cameras that meet.
    sizes : ndarray, shape (n_cameras, 4)
        Smallest x and y, largest x and y of rays that its image shows.
    starts : ndarray of intp, shape (n_cameras + 1,)
        First ball of each camera, and the number of balls.
    rays : ndarray, shape (n_balls, 2)
        Normalised coordinates.
    spread : ndarray, shape (n_balls, 2, 2)
        How their noise spreads them.
    """

    poses: Floats
    places: Floats
    essential: Floats
    sizes: Floats
    starts: Ints
    rays: Floats
    spread: Floats


@kernel_part
def ray_direction(room: Room, camera: int, ball: int) -> Vector:
    """Return where a ball's ray points in the world; not of length 1.

    Parameters
    ----------
    room : Room
        Cameras and balls.
    camera : int
        Which.
    ball : int
        Which, of all cameras' balls.
    """
    ray = room.rays[ball, 0], room.rays[ball, 1], 1.0
    return turned(transposed(block(room.poses[camera], 0, 0)), ray)


@kernel_part
def point_of_two(room: Room, balls: Ints, point: Floats) -> bool:
    """Fill the middle between two rays where they are nearest; return whether that is before both cameras.

    Parameters
    ----------
    room : Room
        Cameras and balls.
    balls : ndarray of intp, shape (n_cameras,)
        The ball of each camera, -1 where it has none.
    point : ndarray, shape (3,), mm
        In the world.
    """
    places, one, two = room.places, -1, -1
    for camera in range(len(balls)):
        if balls[camera] >= 0:
            one, two = two, camera
    a, b = ray_direction(room, one, balls[one]), ray_direction(room, two, balls[two])
    between = minus(vector(places, two, 0), vector(places, one, 0))
    aa, ab, bb, ao, bo = dot(a, a), dot(a, b), dot(b, b), dot(a, between), dot(b, between)
    determinant = aa * bb - ab * ab
    if not determinant > 0.0:
        return False
    s, t = (bb * ao - ab * bo) / determinant, (ab * ao - aa * bo) / determinant
    if not (s > 0.0 and t > 0.0):
        return False
    for axis in range(3):
        point[axis] = (places[one, axis] + s * a[axis] + places[two, axis] + t * b[axis]) / 2.0
    return True


@kernel_part
def projected(pose: Floats, point: Floats) -> Vector:
    """Return where a camera sees a point, and how far ahead that is.

    Parameters
    ----------
    pose : ndarray, shape (3, 4), mm
        camera_from_world.
    point : ndarray, shape (3,), mm
        In the world.
    """
    x, y, z = plus(turned(block(pose, 0, 0), (point[0], point[1], point[2])), column(pose, 3))
    return x / z, y / z, z


@kernel_part
def slopes(pose: Floats, x: float, y: float, z: float) -> tuple[Vector, Vector]:
    """Return how what a camera sees of a point changes with it.

    Parameters
    ----------
    pose : ndarray, shape (3, 4), mm
        camera_from_world.
    x, y : float
        Where it is seen.
    z : float, mm
        How far ahead it is.
    """
    right, down, ahead = block(pose, 0, 0)
    return times(1.0 / z, minus(right, times(x, ahead))), times(1.0 / z, minus(down, times(y, ahead)))


@kernel_part
def refine(room: Room, balls: Ints, point: Floats, numbers: Floats) -> bool:
    """Move a point to the most likely place; fill its covariance (6 numbers), chi-squared, and the count of balls.

    Parameters
    ----------
    room : Room
        Cameras and balls.
    balls : ndarray of intp, shape (n_cameras,)
        The ball of each camera, -1 where it has none.
    point : ndarray, shape (3,), mm
        In the world.
    numbers : ndarray, shape (8,)
        Covariance [mm^2] as the upper half of a matrix, chi-squared, count of balls.
    """
    for step in range(N_STEPS + 1):
        a = b = c = d = e = f = u = v = w = squares = 0.0
        count = 0
        for camera in range(len(balls)):
            ball = balls[camera]
            if ball < 0:
                continue
            seen = whitened(room, camera, ball, point)
            if not seen[0][0] < 1e150:
                return False
            count += 1
            for half in range(2):
                r, (x, y, z) = seen[half]
                a, b, c, d, e, f = a + x * x, b + x * y, c + x * z, d + y * y, e + y * z, f + z * z
                u, v, w, squares = u + x * r, v + y * r, w + z * r, squares + r * r
        covariance = inverse((a, b, c, d, e, f), LEVEL)
        if step == N_STEPS:
            for index in range(6):
                numbers[index] = covariance[index]
            numbers[6], numbers[7] = squares, count
        else:
            shift = by_symmetric(covariance, (u, v, w))
            for axis in range(3):
                point[axis] += shift[axis]
    return True


@kernel_part
def whitened(room: Room, camera: int, ball: int, point: Floats) -> Misfit:
    """Return seen minus expected of a ball and its slope by the point, twice, in standard deviations.

    Parameters
    ----------
    room : Room
        Cameras and balls.
    camera : int
        Which.
    ball : int
        Which, of all cameras' balls.
    point : ndarray, shape (3,), mm
        In the world.
    """
    pose, spread = room.poses[camera], room.spread[ball]
    x, y, z = projected(pose, point)
    if not z > 0.0:
        return (1e200, (0.0, 0.0, 0.0)), (0.0, (0.0, 0.0, 0.0))
    scale = 1.0 / (spread[0, 0] * spread[1, 1] - spread[0, 1] * spread[1, 0])
    a, b, c, d = spread[1, 1] * scale, -spread[0, 1] * scale, -spread[1, 0] * scale, spread[0, 0] * scale
    right, down = room.rays[ball, 0] - x, room.rays[ball, 1] - y
    u, v = slopes(pose, x, y, z)
    return (
        (a * right + b * down, plus(times(a, u), times(b, v))),
        (c * right + d * down, plus(times(c, u), times(d, v))),
    )


@kernel_part
def nearest_ball(room: Room, camera: int, point: Floats, numbers: Floats, gate: float) -> int:
    """Return the ball of a camera that is nearest to where it must see a point, within all noise; -1 if none is.

    Parameters
    ----------
    room : Room
        Cameras and balls.
    camera : int
        Which.
    point : ndarray, shape (3,), mm
        In the world.
    numbers : ndarray, shape (8,)
        Covariance [mm^2] as the upper half of a matrix, chi-squared, count of balls.
    gate : float
        Standard deviations within which balls fit.
    """
    pose = room.poses[camera]
    x, y, z = projected(pose, point)
    if not z > 0.0:
        return -1
    across, along = slopes(pose, x, y, z)
    covariance = (numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5])
    spread_along = by_symmetric(covariance, along)
    xx, xy, yy = dot(across, by_symmetric(covariance, across)), dot(across, spread_along), dot(along, spread_along)
    best, least = -1, gate * gate
    for ball in range(room.starts[camera], room.starts[camera + 1]):
        spread = room.spread[ball]
        right, down = room.rays[ball, 0] - x, room.rays[ball, 1] - y
        own = spread[0, 0] * spread[0, 0] + spread[0, 1] * spread[0, 1]
        if right * right > gate * gate * (xx + own):
            continue
        s, u = xx + own, yy + spread[1, 0] * spread[1, 0] + spread[1, 1] * spread[1, 1]
        t = xy + spread[0, 0] * spread[1, 0] + spread[0, 1] * spread[1, 1]
        square = (u * right * right - 2.0 * t * right * down + s * down * down) / (s * u - t * t)
        if square < least:
            best, least = ball, square
    return best


@kernel_part
def drop_misfits(room: Room, balls: Ints, point: Floats, numbers: Floats, gate: float) -> None:
    """Take away the ball that fits worst, until all fit or three are left.

    Parameters
    ----------
    room : Room
        Cameras and balls.
    balls : ndarray of intp, shape (n_cameras,)
        The ball of each camera, -1 where it has none.
    point : ndarray, shape (3,), mm
        In the world.
    numbers : ndarray, shape (8,)
        Covariance [mm^2] as the upper half of a matrix, chi-squared, count of balls.
    gate : float
        Standard deviations within which balls fit.
    """
    while numbers[7] > FEWEST_TO_DROP:
        worst, largest = -1, gate * gate
        for camera in range(len(balls)):
            if balls[camera] >= 0:
                seen = whitened(room, camera, balls[camera], point)
                square = seen[0][0] * seen[0][0] + seen[1][0] * seen[1][0]
                if square > largest:
                    worst, largest = camera, square
        if worst < 0:
            return
        balls[worst] = -1
        if not refine(room, balls, point, numbers):
            return


@kernel_part
def is_in_view(room: Room, camera: int, point: Floats) -> bool:
    """Return whether a camera's image would show a point.

    Parameters
    ----------
    room : Room
        Cameras and balls.
    camera : int
        Which.
    point : ndarray, shape (3,), mm
        In the world.
    """
    pose, size = room.poses[camera], room.sizes[camera]
    x, y, z = projected(pose, point)
    return bool(z > 0.0 and size[0] < x < size[2] and size[1] < y < size[3])
