"""What an adjustment of a room moves beside the cameras: the places of a wand, without the balls that fit nothing.

`resected` finds a camera of which nothing is known from points in space and where it sees them.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Self, TypeVar

import numpy as np

from skelgen.capture.calibration.bundle_adjustment import Adjusted, Bundle, adjust
from skelgen.geometry.rotations import frame_along, matrix_from_vector
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.model.arrays import Bools, Floats

MAX_ROUNDS = 6
OUTLIER = 5.0
"""Standard deviations beyond which a ball is left out: of a million true ones one is."""

_B = TypeVar("_B", bound=Bundle)


def adjust_room(bundle: _B, free: Bools) -> Adjusted[_B]:
    """Return the most likely cameras and wands; balls that fit nothing are NaN in `seen`.

    Parameters
    ----------
    bundle : Bundle
        Near the solution.
    free : ndarray of bool, shape (15 n_cameras,)
        Which numbers are adjusted; see `free_numbers`.

    Raises
    ------
    InputError
        If the waves do not determine the cameras.
    """
    for _ in range(MAX_ROUNDS):
        found = adjust(bundle, free)
        spread = float(SIGMA_OF_MEDIAN * np.nanmedian(np.abs(found.residuals))) or 1.0  # px, of most residuals
        with np.errstate(invalid="ignore"):
            is_out = (found.residuals**2).sum(axis=-1) > 2.0 * (OUTLIER * spread) ** 2
        if not is_out.any():
            break
        bundle = replace(found.bundle, seen=np.where(is_out[..., np.newaxis], np.nan, found.bundle.seen))
    return found


@dataclass(frozen=True, eq=False)
class WandBundle(Bundle):
    """A wand: five numbers in a frame, its first ball and two of its direction.

    Attributes
    ----------
    distances : ndarray, shape (n_balls,), mm
        Of the balls along the wand, from the first one.
    first : ndarray, shape (n_frames, 3), mm
        Places of the first ball.
    direction : ndarray, shape (n_frames, 3)
        Along the wand, of length 1.
    """

    distances: Floats
    first: Floats
    direction: Floats

    n_own, fewest_cameras = 5, 2
    advice = "move the wand longer, in all parts of the room, near and far from each camera, upright and level"

    @property
    def places(self) -> Floats:
        """Places of all balls, shape (n_frames, n_balls, 3), mm."""
        return np.asarray(self.first[:, np.newaxis] + self.distances[:, np.newaxis] * self.direction[:, np.newaxis])

    def slopes(self) -> Floats:
        """Return how balls change with the first ball and with a tilt across the wand."""
        out = np.zeros((len(self.first), len(self.distances), 3, self.n_own))
        out[..., :3] = np.eye(3)
        out[..., 3:] = self.distances[:, np.newaxis, np.newaxis] * frame_along(self.direction)[:, np.newaxis, :, :2]
        return out

    def moved(self, steps: Floats) -> Self:
        """Return the bundle after a shift and a tilt of each wand."""
        tilt = (frame_along(self.direction)[..., :2] @ steps[:, 3:, np.newaxis])[..., 0]
        turns = matrix_from_vector(np.cross(self.direction, tilt))
        direction = (turns @ self.direction[..., np.newaxis])[..., 0]
        return replace(self, first=self.first + steps[:, :3], direction=direction)

    def of(self, frames: Bools) -> Self:
        """Return the bundle of some frames."""
        return replace(self, first=self.first[frames], direction=self.direction[frames], seen=self.seen[frames])


SAMPLES, OF_A_SAMPLE, TRIMMED = 30, 12, 3
"""Samples and their points of which the one with the least median places a camera, then rounds with the points that fit
better than three times the middle one: balls that are none may not drag it along."""


class Resected(NamedTuple):
    """A camera without a lens.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3), px
        The camera matrix.
    turn : ndarray, shape (3, 3)
        Orthogonal; a reflection if the images are mirrored.
    shift : ndarray, shape (3,), mm
        With `turn` the camera in the points' world.
    off : float, px
        How far off it sees the middle one of all points.
    """

    matrix: Floats
    turn: Floats
    shift: Floats
    off: float


def resected(points: Floats, pixels: Floats, size: tuple[int, int]) -> Resected:
    """Return the camera that sees known points, from most of them (Hartley and Zisserman 2004, 7.1).

    Parameters
    ----------
    points : ndarray, shape (n, 3), mm
        The points.
    pixels : ndarray, shape (n, 2), px
        Where it sees them.
    size : (int, int), px
        Width and height of its images.
    """
    rng, flat = np.random.default_rng(0), np.column_stack([points, np.ones(len(points))])

    def off_of(projection: Floats) -> Floats:
        seen = flat @ projection.T
        return np.asarray(np.linalg.norm(seen[:, :2] / seen[:, 2:] - pixels, axis=1))

    samples = [rng.choice(len(points), OF_A_SAMPLE, replace=False) for _ in range(SAMPLES)]
    tried = [off_of(_linear(points[sample], pixels[sample], size)) for sample in samples]
    off = min(tried, key=lambda one: float(np.median(one)))
    for _ in range(TRIMMED):
        kept = off <= 3.0 * np.median(off)
        projection = _linear(points[kept], pixels[kept], size)
        off = off_of(projection)
    flat = flat @ projection.T
    if np.median(flat[:, 2]) < 0:
        projection = -projection
    # RQ decomposition by QR of the reversed matrix
    q, r = np.linalg.qr(np.flipud(projection[:, :3]).T)
    matrix, turn = np.fliplr(np.flipud(r.T)), np.flipud(q.T)
    signs = np.diag(np.sign(np.diag(matrix)))
    matrix, turn = matrix @ signs, signs @ turn
    shift = np.linalg.solve(matrix, projection[:, 3])
    return Resected(matrix / matrix[2, 2], turn, shift, float(np.median(off)))


def _linear(points: Floats, pixels: Floats, size: tuple[int, int]) -> Floats:
    """The projection that sees points at pixels, shape (3, 4), by the direct linear transform."""
    middle, scale = points.mean(axis=0), points.std()
    world = np.column_stack([(points - middle) / scale, np.ones(len(points))])
    image = (pixels - np.array(size) / 2) / size[0]
    zeros = np.zeros_like(world)
    rows = np.concatenate(
        [np.hstack([world, zeros, -image[:, :1] * world]), np.hstack([zeros, world, -image[:, 1:] * world])]
    )
    solution = np.linalg.eigh(rows.T @ rows)[1][:, 0].reshape(3, 4)
    to_world = np.eye(4) / scale
    to_world[:3, 3], to_world[3, 3] = -middle / scale, 1.0
    to_pixels = np.array([[size[0], 0, size[0] / 2], [0, size[0], size[1] / 2], [0, 0, 1.0]])
    return np.asarray(to_pixels @ solution @ to_world)
