"""From pixels to points in space and back: lens, epipolar geometry, optimal triangulation with its covariance.

The lens distorts a ray x / z, y / z before the camera matrix makes pixels of it (Gaschler 2011, chapter 4.1.1; OpenCV's
k1 k2 p1 p2 k3); Newton's method undoes that. A point from two cameras is that of Hartley and Sturm's optimal
correction; see `skelgen._kernels.stereo_matching`.

Of 40 balls in each image some five pairs too many lie within the noise of one epipolar plane. `match_and_triangulate`
keeps them all: which of them are real is decided by what is known beside one pair of images, the rigid bodies or the
time before.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from skelgen._kernels import camera as _kernels_camera
from skelgen._kernels import stereo_matching
from skelgen._kernels.stereo_matching import Geometry, View, find_pairs
from skelgen.capture.values import Balls, StereoPoints
from skelgen.geometry.rotations import cross_matrix
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import TYPICAL_NOISE, Camera, StereoRig

GATE = 5.0
"""Standard deviations from the epipolar constraint up to which a pair is kept: of two million true pairs one is lost,
and a calibration that errs by more than its noise says still works."""


def project(camera: Camera, points: Floats) -> Floats:
    """Return where a camera sees points of the world.

    Parameters
    ----------
    camera : Camera
        With its place in the world.
    points : ndarray, shape (..., 3), mm
        In the world.

    Returns
    -------
    ndarray, shape (..., 2), px
        NaN behind the camera, and so far to the side that the lens model would fold the image back into itself. Pixels
        outside the image are returned as they are; see `in_image`.
    """
    return pixels_from_normalised(camera, distort(camera, _normalised(_in_camera(camera, points))))


def projection_jacobian(camera: Camera, points: Floats) -> Floats:
    """Return d pixel / d point, shape (..., 2, 3), px/mm; NaN as of `project`.

    Parameters
    ----------
    camera : Camera
        With its place in the world.
    points : ndarray, shape (..., 3), mm
        In the world.
    """
    inside = _in_camera(camera, points)
    flat = _normalised(inside)
    by_normalised = camera.matrix[:2, :2] @ distortion_jacobian(camera, flat)
    by_camera = np.zeros((*flat.shape[:-1], 2, 3))
    by_camera[..., 0, 0] = by_camera[..., 1, 1] = 1.0
    by_camera[..., 2] = -flat
    by_camera /= inside[..., 2, np.newaxis, np.newaxis]
    return np.asarray(by_normalised @ by_camera @ camera.camera_from_world[:3, :3])


def undistort(camera: Camera, pixels: Floats) -> Floats:
    """Return the rays x / z, y / z in the camera's frame that pixels look along, by Newton's method.

    Parameters
    ----------
    camera : Camera
        Its place does not matter.
    pixels : ndarray, shape (..., 2), px
        As the camera sees them.

    Returns
    -------
    ndarray, shape (..., 2)
        Normalised coordinates; NaN where the lens sends no ray to the pixel.
    """
    normalised = (pixels - camera.matrix[:2, 2]) @ np.linalg.inv(camera.matrix[:2, :2]).T
    behind_lens = np.ascontiguousarray(normalised, dtype=np.float64)
    rays = _kernels_camera.undistort(behind_lens.reshape(-1, 2), camera_numbers(camera))
    return rays.reshape(behind_lens.shape)


def distort(camera: Camera, rays: Floats) -> Floats:
    """Return where the lens puts rays.

    Parameters
    ----------
    camera : Camera
        Its place does not matter.
    rays : ndarray, shape (..., 2)
        Normalised coordinates x / z, y / z.

    Returns
    -------
    ndarray, shape (..., 2)
        Normalised coordinates behind the lens; NaN beyond `folding_radius`.
    """
    distorted, _ = _through_lens(camera, rays)
    distorted[~((rays * rays).sum(axis=-1) < folding_radius(camera) ** 2)] = np.nan
    return distorted


def distortion_jacobian(camera: Camera, rays: Floats) -> Floats:
    """Return d distorted / d ray, shape (..., 2, 2).

    Parameters
    ----------
    camera : Camera
        Its place does not matter.
    rays : ndarray, shape (..., 2)
        Normalised coordinates x / z, y / z.
    """
    return _through_lens(camera, rays)[1]


def pixels_from_normalised(camera: Camera, normalised: Floats) -> Floats:
    """Return the pixels of normalised coordinates behind the lens, shape (..., 2), px.

    Parameters
    ----------
    camera : Camera
        Its place does not matter.
    normalised : ndarray, shape (..., 2)
        Where the lens put the rays.
    """
    return np.asarray(normalised @ camera.matrix[:2, :2].T + camera.matrix[:2, 2])


def in_image(camera: Camera, pixels: Floats) -> Bools:
    """Return whether pixels lie in the camera's image, within the outer edges of its border pixels.

    Parameters
    ----------
    camera : Camera
        With the size of its image.
    pixels : ndarray, shape (..., 2), px
        NaN lies outside.
    """
    x, y = pixels[..., 0], pixels[..., 1]
    with np.errstate(invalid="ignore"):
        return np.asarray((x >= -0.5) & (y >= -0.5) & (x <= camera.width - 0.5) & (y <= camera.height - 0.5))


def view_centre(rig: StereoRig, distances: float | Floats) -> Floats:
    """Return points of the world in the middle of both views, shape (..., 3), mm.

    Parameters
    ----------
    rig : StereoRig
        The cameras.
    distances : float or ndarray, shape (...), mm
        From the middle between the cameras.
    """
    left, right = (np.linalg.inv(camera.camera_from_world) for camera in (rig.left, rig.right))
    ahead = left[:3, 2] + right[:3, 2]
    return np.asarray((left[:3, 3] + right[:3, 3]) / 2 + np.multiply.outer(distances, ahead) / np.linalg.norm(ahead))


def folding_radius(camera: Camera) -> float:
    """Return the distance x^2 + y^2 = r^2 from the axis, on the plane z = 1, from which on the lens model folds back.

    There r (1 + k1 r^2 + k2 r^4 + k3 r^6) stops to grow; infinite for a lens that never does.
    """
    k1, k2, _, _, k3 = camera.distortion
    return _folding_radius(float(k1), float(k2), float(k3))


def camera_numbers(camera: Camera) -> Floats:
    """Return a camera's eleven numbers as kernels take them, shape (11,); see `skelgen._kernels.camera`."""
    matrix = camera.matrix
    own = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], matrix[0, 1]]
    return np.array([*own, *camera.distortion, folding_radius(camera) ** 2])


@lru_cache(maxsize=64)
def _folding_radius(k1: float, k2: float, k3: float) -> float:
    roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    squares = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(np.sqrt(squares.min())) if squares.size else float("inf")


def _in_camera(camera: Camera, points: Floats) -> Floats:
    return np.asarray(points @ camera.camera_from_world[:3, :3].T + camera.camera_from_world[:3, 3])


def _normalised(inside: Floats) -> Floats:
    depth = np.where(inside[..., 2:] > 0, inside[..., 2:], np.nan)
    return np.asarray(inside[..., :2] / depth)


def _through_lens(camera: Camera, rays: Floats) -> tuple[Floats, Floats]:
    """Where the lens puts rays, shape (..., 2), also beyond its fold, and the derivative of that, shape (..., 2, 2)."""
    flat = np.ascontiguousarray(rays, dtype=np.float64).reshape(-1, 2)
    distorted, slope = _kernels_camera.distort(flat, camera_numbers(camera))
    return distorted.reshape(rays.shape), slope.reshape(*rays.shape, 2)


@dataclass(frozen=True, eq=False)
class Triangulated:
    """Points of pairs of pixels.

    Attributes
    ----------
    points : ndarray, shape (n, 3), mm
        In the rig's world; NaN where the rays do not meet in front of both cameras.
    covariance : ndarray, shape (n, 3, 3), mm^2
        In the world; NaN where the point is.
    rays : ndarray, shape (n, 2, 2)
        Normalised coordinates in the left and in the right camera that meet in the point.
    shifts : ndarray, shape (n, 2)
        How far both pixels were moved for that, in their standard deviations; the sum of squares is chi-squared with
        one degree of freedom.
    """

    points: Floats
    covariance: Floats
    rays: Floats
    shifts: Floats


def triangulate(rig: StereoRig, left: Floats, right: Floats, std: float | None = None) -> Triangulated:
    """Return the most likely points of corresponding pixels.

    Parameters
    ----------
    rig : StereoRig
        Both cameras.
    left, right : ndarray, shape (n, 2), px
        What the cameras see, lens included; the n-th belongs to the n-th.
    std : float, px, optional
        Standard deviation of a pixel along one axis; that of the rig if not given.
    """
    noise = np.full(len(left), rig.noise if std is None else std)
    both = np.arange(len(left))
    views = view_of(rig.left, left, noise), view_of(rig.right, right, noise)
    return _triangulate_pairs(rig, *views, geometry_of(rig), np.stack([both, both], axis=1))


def _triangulate_pairs(rig: StereoRig, left: View, right: View, geometry: Geometry, pairs: Ints) -> Triangulated:
    """Return the most likely points of pairs of pixels.

    Parameters
    ----------
    rig : StereoRig
        Both cameras.
    left, right : View
        What they see; see `view_of`.
    geometry : Geometry
        From `geometry_of`.
    pairs : ndarray of intp, shape (n, 2)
        The left and the right pixel of each.
    """
    found = stereo_matching.triangulate(left, right, geometry, pairs)
    camera_from_world = rig.left.camera_from_world
    back = camera_from_world[:3, :3].T
    points = (found.points - camera_from_world[:3, 3]) @ back.T
    return Triangulated(points, np.asarray(back @ found.covariances @ back.T), found.rays, found.shifts)


def view_of(camera: Camera, pixels: Floats, std: Floats) -> View:
    """Return what a camera sees as kernels take it.

    Parameters
    ----------
    camera : Camera
        Its place does not matter.
    pixels : ndarray, shape (n, 2), px
        Lens included.
    std : ndarray, shape (n,), px
        Standard deviation of each along one axis.
    """
    numbers = camera_numbers(camera)
    return View(
        *_kernels_camera.rays_of_pixels(
            np.array(pixels, dtype=np.float64, order="C"), np.array(std, dtype=np.float64), numbers
        )
    )


def geometry_of(rig: StereoRig) -> Geometry:
    """Return where the right camera is, seen from the left one, as kernels take it."""
    right_from_left = rig.right_from_left
    rotation, shift = np.array(right_from_left[:3, :3], order="C"), np.array(right_from_left[:3, 3])
    return Geometry(rotation, shift, cross_matrix(shift) @ rotation)


def match_and_triangulate(left: Balls, right: Balls, rig: StereoRig, gate: float = GATE) -> StereoPoints:
    """Return the points that pairs of balls may be.

    Parameters
    ----------
    left, right : Balls
        What was found in both images of one moment.
    rig : StereoRig
        The cameras; its noise is the least that a centre has.
    gate : float
        Pairs farther from the epipolar constraint than so many standard deviations, of 0.1 px at least, are left out.

    Returns
    -------
    StereoPoints
        In the order of the left balls, then of the right ones; only points in front of both cameras.
    """
    left_std, right_std = np.fmax(left.std, rig.noise), np.fmax(right.std, rig.noise)
    views = view_of(rig.left, left.centres, left_std), view_of(rig.right, right.centres, right_std)
    geometry, wide = geometry_of(rig), views
    if rig.noise < TYPICAL_NOISE:  # calibrations err by more than balls that are seen whole, and so do half hidden ones
        stds = np.fmax(left_std, TYPICAL_NOISE), np.fmax(right_std, TYPICAL_NOISE)
        wide = view_of(rig.left, left.centres, stds[0]), view_of(rig.right, right.centres, stds[1])
    pairs = find_pairs(*wide, geometry, gate)
    found = _triangulate_pairs(rig, *views, geometry, pairs)
    is_point = np.isfinite(found.covariance[:, 0, 0])
    first, second = pairs[is_point].T
    distance = np.hypot(found.shifts[is_point, 0] * left_std[first], found.shifts[is_point, 1] * right_std[second])
    shared = _is_shared(first, len(left)) | _is_shared(second, len(right))
    typical = np.fmax(np.fmin(left_std[first], right_std[second]), TYPICAL_NOISE)
    slack = (typical / np.fmin(left_std[first], right_std[second])) ** 2
    return StereoPoints(found.points[is_point], found.covariance[is_point], first, second, distance, shared, slack)


def _is_shared(balls: Ints, n_balls: int) -> Bools:
    """Whether a ball is part of more than one pair."""
    return np.asarray(np.bincount(balls, minlength=n_balls)[balls] > 1)
