"""Start values of a wand calibration, from nothing but views of the wand.

The two cameras that share most views come first. Their essential matrix gives their places for any focal lengths; those
are right for which the wand is always equally long. Every other camera is placed by the wands that those before have
placed (direct linear transform), the one with most of them first, and all are adjusted together after each.

A mirrored image fits no rotation: its camera comes out as a reflection.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.sparse.csgraph import connected_components

from skelgen.capture.calibration.bundle_adjustment import free_numbers, residuals_of
from skelgen.capture.images import opencv
from skelgen.capture.optics import undistort
from skelgen.capture.room.bundles import Resected, WandBundle, adjust_room, resected
from skelgen.capture.room.wand_and_ground import TWO
from skelgen.errors import InputError
from skelgen.geometry.rotations import nearest_rotation, transform_from, unit_vectors
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.model.arrays import Bools, Floats, Ints, evenly_spread
from skelgen.model.rig import Camera
from skelgen.progress import counted

LEAST_SHARED = 30
"""Views that a camera must share with others to be placed."""

MOST_FRAMES, FRAMES_OF_PAIR = 300, 100
"""Frames that are enough to begin with, for all cameras and for two."""

PAIRS_TRIED = 6
FOCAL = np.geomspace(0.35, 3.0, 14)
"""Focal lengths that are tried, as parts of the width: 110 to 19 degrees."""

CONSTANT = 0.12
"""Relative spread of the wand's length up to which two cameras are placed: lenses not yet known bend it by some per
cent, a mirrored image or a wrong focal length by much more."""

STEADY = 0.04
"""The same below which no other pair is tried."""

NEAR = 20.0
"""px from an epipolar line, with a lens that is not known."""

SUSPICIOUS, MOST_LATE = 8.0, 20
"""px: where most points are farther off, an unknown lens is not the cause; and frames that a camera may be late."""

FALSE, FALSE_BY = 8.0, 10.0
"""px, and times the error of the median view, from which on a view shows no wand."""

UNEVEN = 0.02
"""Of the wand's length: how far its middle ball may be from where it is said to be."""

MIDDLE, LENS = (0, 1, 4), (0, 1, 2, 3, 4, 5, 6, 7)
"""What is adjusted at first, fx, fy and k1, and at the end: all but k3."""


def start_values(seen: Floats, wand: Floats, sizes: list[tuple[int, int]], names: list[str]) -> WandBundle:
    """Return cameras and wands near the truth; the first camera's frame is the world.

    Parameters
    ----------
    seen : ndarray, shape (n_frames, n_cameras, n_balls, 2), px
        Where the wand was seen; see `skelgen.capture.room.wand_and_ground`.
    wand : ndarray, shape (n_balls,), mm
        Its balls.
    sizes : list of tuple of int, px
        Width and height of each camera's images.
    names : list of str
        What the cameras are called.

    Raises
    ------
    InputError
        If a camera shares too few views with the others, its images are mirrored, or no places explain the views.
    """
    shows = np.asarray(np.isfinite(seen[..., 0]).all(axis=2))
    check_overlap(shows, names)
    first, second, bundle = _first_pair(seen, wand, sizes, names, shows)
    order = [first, second]
    while len(order) < len(names):
        placed = np.isfinite(bundle.first[:, 0])
        shared = [-1 if camera in order else int((shows[:, camera] & placed).sum()) for camera in range(len(names))]
        camera = int(np.argmax(shared))
        if shared[camera] < LEAST_SHARED:
            raise InputError(_too_few_shared(names[camera], [names[index] for index in order], shared[camera]))
        cameras = (*bundle.cameras, _placed_camera(seen[:, camera], bundle, sizes[camera], names[camera]))
        order.append(camera)
        bundle = _adjusted(replace(bundle, cameras=cameras, seen=seen[:, order]), seen[:, order])
    cameras = tuple(bundle.cameras[order.index(camera)] for camera in range(len(names)))
    return _without_false(_in_first(replace(bundle, cameras=cameras, seen=seen)))


def _without_false(bundle: WandBundle) -> WandBundle:
    """Leave out views that show no wand: the other cameras of that moment place it elsewhere."""
    off = _views_off(bundle)
    limit = max(FALSE, FALSE_BY * float(np.median(off[off > 0])))
    wrong = np.flatnonzero((off > limit).any(axis=1))
    without = np.full((len(wrong), len(bundle.cameras)), np.inf)
    part = bundle.of(np.isin(np.arange(len(bundle.seen)), wrong))
    for camera in range(len(bundle.cameras)):
        others = part.seen.copy()
        others[:, camera] = np.nan
        trial = _with_wands_placed(replace(part, seen=others))
        placed = np.isfinite(trial.first[:, 0]) & np.isfinite(part.seen[:, camera, 0, 0])
        without[placed, camera] = _views_off(trial.of(placed)).max(axis=1)
    seen, best = bundle.seen.copy(), without.argmin(axis=1)
    is_one = without[np.arange(len(wrong)), best] <= limit
    seen[wrong[is_one], best[is_one]] = np.nan
    seen[wrong[~is_one]] = np.nan
    return _with_wands_placed(replace(bundle, seen=seen))


def _views_off(bundle: WandBundle) -> Floats:
    """How far off each view of the wand is [px], shape (n_frames, n_cameras); 0 where there is none."""
    return np.asarray(np.nan_to_num(np.linalg.norm(residuals_of(bundle), axis=-1), nan=0.0).max(axis=2))


def check_overlap(shows: Bools, names: list[str]) -> None:
    """Check that views of the wand connect all cameras.

    Parameters
    ----------
    shows : ndarray of bool, shape (n_frames, n_cameras)
        Whether a camera shows the wand.
    names : list of str
        What the cameras are called.

    Raises
    ------
    InputError
        If they do not; the sentence names who shares nothing with whom.
    """
    for camera in np.flatnonzero(shows.sum(axis=0) < LEAST_SHARED):
        raise InputError(
            f"{names[camera]} shows the wand in {counted(int(shows[:, camera].sum()), 'image')}; at least "
            f"{LEAST_SHARED} are needed: is it covered, dark or blinded, do the settings say the right "
            "distances of the wand's balls, does it show other bright things?"
        )
    shared = shows.T.astype(np.intp) @ shows
    part = connected_components(shared >= LEAST_SHARED, directed=False)[1]
    inside, outside = np.flatnonzero(part == part[0]), np.flatnonzero(part != part[0])
    if len(outside):
        connected = [names[index] for index in inside]
        raise InputError(_too_few_shared(names[outside[0]], connected, int(shared[outside[0], inside].max())))


def _too_few_shared(name: str, others: list[str], shared: int) -> str:
    return (
        f"{name} shares {shared} views of the wand with {', '.join(others)}; at least {LEAST_SHARED} are needed: wave "
        "the wand where both see it"
    )


def _first_pair(
    seen: Floats, wand: Floats, sizes: list[tuple[int, int]], names: list[str], shows: Bools
) -> tuple[int, int, WandBundle]:
    """Two cameras that see the wand equally long everywhere, and where."""
    shared = shows.T.astype(np.intp) @ shows
    pairs = sorted(combinations(range(len(names)), 2), key=lambda pair: -int(shared[pair]))
    best: tuple[float, int, int, WandBundle] | None = None
    for one, two in pairs[:PAIRS_TRIED]:
        if shared[one, two] < LEAST_SHARED or (best is not None and best[0] < STEADY):
            continue
        pair = _pair(seen[:, [one, two]], wand, (sizes[one], sizes[two]), (names[one], names[two]))
        if pair is not None and (best is None or pair[0] < best[0]):
            best = pair[0], one, two, pair[1]
    if best is None or best[0] > CONSTANT:
        raise InputError(
            f"no focal lengths make the wand equally long everywhere (it varies by "
            f"{100 * (best[0] if best else 1.0):.0f} %): are the images of one camera mirrored, were they taken at "
            "other times than the others', are the distances of the wand's balls right?"
        )
    _, one, two, bundle = best
    _check_middle(bundle)
    bundle = _adjusted(bundle, seen[:, [one, two]])
    return one, two, bundle


def _check_middle(bundle: WandBundle) -> None:
    """Refuse a wand whose middle ball is elsewhere."""
    if len(bundle.distances) == TWO:
        return
    balls = _nearest_to_rays(bundle)
    gaps = np.linalg.norm(balls - balls[:, :1], axis=2)
    part, stated = float(np.nanmedian(gaps[:, 1] / gaps[:, 2])), float(bundle.distances[1] / bundle.distances[2])
    if abs(part - stated) > UNEVEN:
        raise InputError(
            f"the middle ball of the wand is seen at {100 * part:.0f} % of its length, and said to be at "
            f"{100 * stated:.0f} %: measure the distances of its balls"
        )


def _spread(shows: Bools, most: int = MOST_FRAMES) -> Ints:
    return evenly_spread(np.flatnonzero(shows), most)


def _guess(size: tuple[int, int], name: str, focal: float) -> Camera:
    width, height = size
    matrix = np.array([[focal * width, 0, (width - 1) / 2], [0, focal * width, (height - 1) / 2], [0, 0, 1.0]])
    return Camera(width, height, matrix, name=name)


def _pair(
    seen: Floats, wand: Floats, sizes: tuple[tuple[int, int], tuple[int, int]], names: tuple[str, str]
) -> tuple[float, WandBundle] | None:
    """How much the wand's length varies for the best focal lengths of two cameras, and the bundle; None without one."""
    frames = _spread(np.asarray(np.isfinite(seen[..., 0]).all(axis=(1, 2))), FRAMES_OF_PAIR)
    best: tuple[float, WandBundle] | None = None
    for focal in FOCAL:
        for ratio in (0.7, 1.0, 1.4):
            cameras = _guess(sizes[0], names[0], focal), _guess(sizes[1], names[1], focal * ratio)
            found = _placed_pair(seen[frames], wand, cameras)
            if found is not None and (best is None or found[0] < best[0]):
                best = found
    if best is None:
        return None
    whole = replace(
        best[1], first=np.full((len(seen), 3), np.nan), direction=np.full((len(seen), 3), np.nan), seen=seen
    )
    return best[0], _with_wands_placed(whole)


def _placed_pair(seen: Floats, wand: Floats, cameras: tuple[Camera, Camera]) -> tuple[float, WandBundle] | None:
    """The second camera by its essential matrix, and how much the wand's length varies then."""
    cv2 = opencv()
    rays = [undistort(camera, seen[:, index].reshape(-1, 2)) for index, camera in enumerate(cameras)]
    gate = NEAR / min(camera.matrix[0, 0] for camera in cameras)
    essential, _ = cv2.findEssentialMat(*rays, np.eye(3), method=cv2.LMEDS, threshold=gate)
    if essential is None or essential.shape != (3, 3):
        return None
    _, turn, shift, _ = cv2.recoverPose(essential, *rays, np.eye(3), distanceThresh=1e6)[:4]
    second = transform_from(nearest_rotation(turn), shift.ravel())
    start = WandBundle((cameras[0], replace(cameras[1], camera_from_world=second)), seen, wand, *np.empty((2, 0, 3)))
    balls = _nearest_to_rays(start)
    lengths = np.linalg.norm(balls[:, -1] - balls[:, 0], axis=1)
    usable = np.isfinite(lengths) & (balls[..., 2] > 0).all(axis=1)
    if usable.sum() < LEAST_SHARED:
        return None
    typical = float(np.median(lengths[usable]))
    spread = float(SIGMA_OF_MEDIAN * np.median(np.abs(lengths[usable] / typical - 1.0)) + (~usable).mean())
    second[:3, 3] *= wand[-1] / typical
    return spread, replace(start, cameras=(cameras[0], replace(cameras[1], camera_from_world=second)))


def _with_wands_placed(bundle: WandBundle) -> WandBundle:
    """The bundle with the wand placed in all frames in which two of its cameras show it; NaN elsewhere."""
    balls = _nearest_to_rays(bundle)
    direction = unit_vectors(balls[:, -1] - balls[:, 0])
    return replace(bundle, first=balls.mean(axis=1) - bundle.distances.mean() * direction, direction=direction)


def _nearest_to_rays(bundle: WandBundle) -> Floats:
    """The points nearest to the rays of all cameras, shape (n_frames, n_balls, 3), mm; NaN where less than two show it.

    A camera alone places nothing, and two of one place only what they see from there.
    """
    n_frames, _, n_balls = bundle.seen.shape[:3]
    normal, pulled = np.zeros((n_frames, n_balls, 3, 3)), np.zeros((n_frames, n_balls, 3))
    count = np.zeros(n_frames, dtype=np.intp)
    for index, camera in enumerate(bundle.cameras):
        rays = undistort(camera, bundle.seen[:, index])
        shown = np.isfinite(rays).all(axis=(1, 2))
        turn, shift = camera.camera_from_world[:3, :3], camera.camera_from_world[:3, 3]
        along = unit_vectors(np.concatenate([rays[shown], np.ones((int(shown.sum()), n_balls, 1))], axis=2) @ turn)
        across = np.eye(3) - along[..., np.newaxis] * along[..., np.newaxis, :]
        normal[shown] += across
        pulled[shown] += across @ (-turn.T @ shift)
        count += shown
    normal[count < TWO] = np.nan
    return np.asarray(np.linalg.solve(normal + 1e-9 * np.eye(3), pulled[..., np.newaxis])[..., 0])


def _adjusted(bundle: WandBundle, seen: Floats) -> WandBundle:
    """The bundle of all frames after an adjustment of some."""
    whole = _with_wands_placed(replace(bundle, seen=seen))
    frames = np.zeros(len(seen), dtype=np.bool_)
    frames[_spread(np.isfinite(whole.first[:, 0]))] = True
    part = whole.of(frames)
    for numbers in (MIDDLE, LENS):
        part = adjust_room(part, free_numbers(len(part.cameras), numbers)).bundle
    return _with_wands_placed(replace(whole, cameras=part.cameras))


def _placed_camera(seen: Floats, bundle: WandBundle, size: tuple[int, int], name: str) -> Camera:
    """Place a camera by the wands whose places are known (Hartley and Zisserman 2004, 7.1); refuse mirrored images."""
    found = _resected_at(seen, bundle, size, 0)
    if found.off > SUSPICIOUS:
        late = min(range(-MOST_LATE, MOST_LATE + 1), key=lambda frames: _resected_at(seen, bundle, size, frames).off)
        if late and _resected_at(seen, bundle, size, late).off < found.off / 2:
            raise InputError(
                f"the images of {name} are {abs(late)} frames {'late' if late > 0 else 'early'} against the others': "
                "trigger all cameras by one line, and start them before it"
            )
    if np.linalg.det(found.turn) < 0:
        raise InputError(
            f"the images of {name} are mirrored against those of {', '.join(one.name for one in bundle.cameras)}: "
            "switch off the flipping of images in its driver, or in that of the others"
        )
    focal = float(np.sqrt(found.matrix[0, 0] * found.matrix[1, 1])) / size[0]
    camera = _guess(size, name, float(np.clip(focal, FOCAL[0], FOCAL[-1])))
    return replace(camera, camera_from_world=transform_from(nearest_rotation(found.turn), found.shift))


def _resected_at(seen: Floats, bundle: WandBundle, size: tuple[int, int], late: int) -> Resected:
    """A camera whose images are so many frames late."""
    then = np.full_like(seen, np.nan)
    then[max(-late, 0) : len(seen) - max(late, 0)] = seen[max(late, 0) : len(seen) - max(-late, 0)]
    off = np.linalg.norm(np.nan_to_num(residuals_of(bundle), nan=0.0), axis=-1).max(axis=(1, 2))
    usable = np.isfinite(bundle.first[:, 0]) & np.isfinite(then[..., 0]).all(axis=1)
    fits = usable & (off <= SUSPICIOUS)
    frames = _spread(np.asarray(fits if fits.sum() >= LEAST_SHARED else usable))
    return resected(bundle.places[frames].reshape(-1, 3), then[frames].reshape(-1, 2), size)


def _in_first(bundle: WandBundle) -> WandBundle:
    """The bundle in the first camera's frame."""
    world_from_first = np.asarray(np.linalg.inv(bundle.cameras[0].camera_from_world), dtype=np.float64)
    cameras = tuple(placed_in(camera, world_from_first) for camera in bundle.cameras)
    return _with_wands_placed(replace(bundle, cameras=cameras))


def placed_in(camera: Camera, before_from_world: Floats) -> Camera:
    """Return a camera in another world.

    Parameters
    ----------
    camera : Camera
        In the world before.
    before_from_world : ndarray, shape (4, 4), mm
        The new world in the one before.
    """
    pose = camera.camera_from_world @ before_from_world
    return replace(camera, camera_from_world=transform_from(nearest_rotation(pose[:3, :3]), pose[:3, 3]))
