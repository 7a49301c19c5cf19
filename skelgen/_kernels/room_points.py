"""One marker and the balls that may be it: where it is by some of them, with its covariance, and which others fit.

A camera is given by the twelve numbers of its camera_from_world; balls by their rays, and by the spread of these (see
`skelgen._kernels.camera.rays_of_pixels`). Balls of all cameras stand one behind the other.
"""

from __future__ import annotations

from typing import NamedTuple

from skelgen._kernels import kernel_part
from skelgen._kernels.small_matrices import Vector, inverse
from skelgen.model.arrays import Floats, Ints

FEWEST_TO_DROP = 3.0
"""Balls of which none is taken away: of three that do not fit nobody knows which is wrong."""

N_STEPS = 2
"""Gauss and Newton's steps to the most likely point: rays that meet leave nothing for a third."""

LEVEL = 1e-30
"""Added to the information [1/mm^2]: nothing beside that of any ball."""

Misfit = tuple[float, float, float, float, float, float, float, float]
"""Seen minus expected of a ball and its slope by the point, twice."""


class Room(NamedTuple):
    """Cameras and what they see.

    Attributes
    ----------
    poses : ndarray, shape (n_cameras, 3, 4), mm
        camera_from_world of each.
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
    x, y, pose = room.rays[ball, 0], room.rays[ball, 1], room.poses[camera]
    return (
        pose[0, 0] * x + pose[1, 0] * y + pose[2, 0],
        pose[0, 1] * x + pose[1, 1] * y + pose[2, 1],
        pose[0, 2] * x + pose[1, 2] * y + pose[2, 2],
    )


@kernel_part
def point_of_two(room: Room, places: Floats, balls: Ints, point: Floats) -> bool:
    """Fill the middle between two rays where they are nearest; return whether that is before both cameras.

    Parameters
    ----------
    room : Room
        Cameras and balls.
    places : ndarray, shape (n_cameras, 3), mm
        Where the cameras stand.
    balls : ndarray of intp, shape (n_cameras,)
        The ball of each camera, -1 where it has none.
    point : ndarray, shape (3,), mm
        In the world.
    """
    one, two = -1, -1
    for camera in range(len(balls)):
        if balls[camera] >= 0:
            one, two = two, camera
    a, b = ray_direction(room, one, balls[one]), ray_direction(room, two, balls[two])
    ox, oy, oz = places[two, 0] - places[one, 0], places[two, 1] - places[one, 1], places[two, 2] - places[one, 2]
    aa, bb = a[0] * a[0] + a[1] * a[1] + a[2] * a[2], b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    ao, bo = a[0] * ox + a[1] * oy + a[2] * oz, b[0] * ox + b[1] * oy + b[2] * oz
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
    x = pose[0, 0] * point[0] + pose[0, 1] * point[1] + pose[0, 2] * point[2] + pose[0, 3]
    y = pose[1, 0] * point[0] + pose[1, 1] * point[1] + pose[1, 2] * point[2] + pose[1, 3]
    z = pose[2, 0] * point[0] + pose[2, 1] * point[1] + pose[2, 2] * point[2] + pose[2, 3]
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
    return (
        ((pose[0, 0] - x * pose[2, 0]) / z, (pose[0, 1] - x * pose[2, 1]) / z, (pose[0, 2] - x * pose[2, 2]) / z),
        ((pose[1, 0] - y * pose[2, 0]) / z, (pose[1, 1] - y * pose[2, 1]) / z, (pose[1, 2] - y * pose[2, 2]) / z),
    )


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
            if not seen[0] < 1e150:
                return False
            count += 1
            for half in range(2):
                r, x, y, z = seen[4 * half], seen[4 * half + 1], seen[4 * half + 2], seen[4 * half + 3]
                a, b, c, d, e, f = a + x * x, b + x * y, c + x * z, d + y * y, e + y * z, f + z * z
                u, v, w, squares = u + x * r, v + y * r, w + z * r, squares + r * r
        information = (a, b, c, d, e, f)
        covariance = inverse(information, LEVEL)
        if step == N_STEPS:
            for index in range(6):
                numbers[index] = covariance[index]
            numbers[6], numbers[7] = squares, count
        else:
            point[0] += covariance[0] * u + covariance[1] * v + covariance[2] * w
            point[1] += covariance[1] * u + covariance[3] * v + covariance[4] * w
            point[2] += covariance[2] * u + covariance[4] * v + covariance[5] * w
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
        return 1e200, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    scale = 1.0 / (spread[0, 0] * spread[1, 1] - spread[0, 1] * spread[1, 0])
    a, b, c, d = spread[1, 1] * scale, -spread[0, 1] * scale, -spread[1, 0] * scale, spread[0, 0] * scale
    right, down = room.rays[ball, 0] - x, room.rays[ball, 1] - y
    (ux, uy, uz), (vx, vy, vz) = slopes(pose, x, y, z)
    return (
        a * right + b * down,
        a * ux + b * vx,
        a * uy + b * vy,
        a * uz + b * vz,
        c * right + d * down,
        c * ux + d * vx,
        c * uy + d * vy,
        c * uz + d * vz,
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
    (ux, uy, uz), (vx, vy, vz) = slopes(pose, x, y, z)
    a, b, c, d, e, f = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]
    px, py, pz = a * ux + b * uy + c * uz, b * ux + d * uy + e * uz, c * ux + e * uy + f * uz
    qx, qy, qz = a * vx + b * vy + c * vz, b * vx + d * vy + e * vz, c * vx + e * vy + f * vz
    xx, xy, yy = ux * px + uy * py + uz * pz, ux * qx + uy * qy + uz * qz, vx * qx + vy * qy + vz * qz
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
                square = seen[0] * seen[0] + seen[4] * seen[4]
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


@kernel_part
def fill_symmetric(numbers: Floats, out: Floats) -> None:
    """Fill a symmetric matrix from its upper half.

    Parameters
    ----------
    numbers : ndarray, shape (6,)
        Its upper half, row by row.
    out : ndarray, shape (3, 3)
        The matrix, which is filled.
    """
    out[0, 0], out[1, 1], out[2, 2] = numbers[0], numbers[3], numbers[5]
    out[0, 1] = out[1, 0] = numbers[1]
    out[0, 2] = out[2, 0] = numbers[2]
    out[1, 2] = out[2, 1] = numbers[4]
