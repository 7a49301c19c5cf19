"""Points in space from corresponding pixels of two cameras, with the covariance that the images' noise gives them.

The point is that of Hartley and Sturm's optimal correction; see `skelgen._kernels.stereo_matching`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen._kernels import stereo_matching
from skelgen._kernels.stereo_matching import Geometry, View
from skelgen.capture.optics.projection import camera_numbers
from skelgen.geometry.rotations import cross_matrix
from skelgen.model.arrays import Floats, Ints
from skelgen.model.rig import Camera, StereoRig


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
    return triangulate_pairs(rig, *views, np.stack([both, both], axis=1))


def triangulate_pairs(rig: StereoRig, left: View, right: View, pairs: Ints) -> Triangulated:
    """Return the most likely points of pairs of pixels.

    Parameters
    ----------
    rig : StereoRig
        Both cameras.
    left, right : View
        What they see; see `view_of`.
    pairs : ndarray of intp, shape (n, 2)
        The left and the right pixel of each.
    """
    found = stereo_matching.triangulate(left, right, geometry_of(rig), pairs)
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
    return View(np.array(pixels, dtype=np.float64, order="C"), np.array(std, dtype=np.float64), camera_numbers(camera))


def geometry_of(rig: StereoRig) -> Geometry:
    """Return where the right camera is, seen from the left one, as kernels take it."""
    right_from_left = rig.right_from_left
    rotation, shift = np.array(right_from_left[:3, :3], order="C"), np.array(right_from_left[:3, 3])
    return Geometry(rotation, shift, essential_matrix(rig))


def essential_matrix(rig: StereoRig) -> Floats:
    """Return E with x'^T E x = 0 for normalised coordinates x of the left, x' of the right camera, shape (3, 3)."""
    right_from_left = rig.right_from_left
    return np.asarray(cross_matrix(right_from_left[:3, 3]) @ right_from_left[:3, :3])
