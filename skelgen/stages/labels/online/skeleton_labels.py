"""Labels by the skeleton of a subject: its pose predicts every marker, and tracks keep labels from frame to frame."""

import numpy as np

from skelgen.model import Skeleton
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.online.links import TrackLabels
from skelgen.stages.labels.online.pose_filter import PoseFilter, PosePrediction
from skelgen.stages.labels.online.pose_search import PoseSearch, chance

ROUNDS = 2
"""Rounds of pose and assignment in a frame: a point that was just recognised helps to find others on its limb."""

TRUSTED_SQUARE = 25.0
"""A track keeps its label while the squared distance of its point from the predicted marker, in deviations, is less."""

SEARCH_EVERY = 10
"""Frames between two searches for the pose, which cost as much as some frames."""

LEAST_SHARE = 0.4
"""A pose is accepted if it explains at least this part of the markers or of the points."""

OLD_TRACK = 20
"""Frames after which a track without a marker is no false point: these do not last that long."""

MANY_ALONE = 3
"""Old tracks without a marker, as many as a limb has, that make the pose doubtful."""

CLEARLY_MORE = 2
"""Points that a new pose must explain beyond the present one."""


class SkeletonLabels:
    """Labels of points by the skeleton of a subject; a label is the index of the skeleton's marker.

    Parameters
    ----------
    skeleton : Skeleton
        The rigid limbs with their markers.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._pose: PoseFilter | None = None
        self._track_labels = TrackLabels()
        self._until_search = 0
        pose = PoseFilter(skeleton)
        pose.load_kernels()
        self._pose_search = PoseSearch(pose)

    @property
    def n_markers(self) -> int:
        """Number of markers that limbs carry."""
        return int((self._skeleton.limb_of_marker >= 0).sum())

    def forget_pose(self) -> None:
        """Forget the pose, so that it is searched again: after a jump in time."""
        self._pose = None
        self._track_labels.clear()
        self._until_search = 0

    def update(self, points: Floats, tracks: Ints, n_steps: int, spacing: float) -> Ints:
        """Label one frame.

        Parameters
        ----------
        points : ndarray, shape (n, 3), mm
            The frame.
        tracks : ndarray of intp, shape (n,)
            Track of each point, -1 for none.
        n_steps : int
            Frame periods since the frame before.
        spacing : float, mm
            Typical distance of a point from its nearest neighbour.

        Returns
        -------
        ndarray of intp, shape (n,)
            Marker of each point, -1 for none.
        """
        labels = np.full(len(points), -1, dtype=np.intp)
        if self._pose is not None:
            labels = self._continued(self._pose, points, tracks, n_steps, spacing)
        self._track_labels.grow_older(tracks)
        self._until_search -= 1
        if self._until_search <= 0 and self._is_doubtful(tracks, labels):
            labels = self._search(points, tracks, labels, spacing)
        self._track_labels.keep(tracks, labels)
        return labels

    def _continued(self, pose: PoseFilter, points: Floats, tracks: Ints, n_steps: int, spacing: float) -> Ints:
        labels = self._track_labels.of(tracks)
        rotations, origins = pose.rotations, pose.origins
        pose.advance(n_steps)
        labels = _fitted(pose, points, labels, tracks >= 0, spacing)
        pose.learn_motion(rotations, origins, n_steps)
        return labels

    def _is_doubtful(self, tracks: Ints, labels: Ints) -> bool:
        """Whether the pose is unknown, or many points that have been followed for long have no marker."""
        if self._pose is None:
            return True
        alone = tracks[(labels < 0) & (tracks >= 0)].tolist()
        n_alone = sum(self._track_labels.age[track] >= OLD_TRACK for track in alone)
        return n_alone >= MANY_ALONE or int((labels >= 0).sum()) < LEAST_SHARE * len(tracks)

    def _search(self, points: Floats, tracks: Ints, labels: Ints, spacing: float) -> Ints:
        """Search the pose in this frame; one that explains more points than the present one replaces it."""
        self._until_search = SEARCH_EVERY
        followed = np.flatnonzero(tracks >= 0)
        pose = PoseFilter(self._skeleton)
        start = self._pose_search.find(points[followed], spacing) if len(followed) else None
        if start is None:
            return labels
        pose.set_pose(*start)
        found = _fitted(pose, points, _nearest(points, followed, pose), tracks >= 0, spacing)
        n_found, n_before = int((found >= 0).sum()), int((labels >= 0).sum())
        wanted = LEAST_SHARE * min(len(followed), int(pose.carried.sum()))
        if n_found < max(wanted, n_before + CLEARLY_MORE):
            return labels
        pose.learn_motion(pose.rotations, pose.origins, 1)
        self._pose = pose
        self._track_labels.clear()
        return found


def _fitted(pose: PoseFilter, points: Floats, labels: Ints, usable: Bools, spacing: float) -> Ints:
    """Fit the pose to labelled points, remove labels that do not fit, and label other points; in rounds."""
    known = labels >= 0
    prediction = pose.fit(points[known], labels[known])
    for _ in range(ROUNDS):
        labels, changed = _corrected(points, labels, usable, prediction, spacing)
        if not changed:
            break
        known = labels >= 0
        prediction = pose.fit(points[known], labels[known])
    return labels


def _nearest(points: Floats, followed: Ints, pose: PoseFilter) -> Ints:
    """First labels from a rough pose: pairs of points and markers that are nearest to each other."""
    labels = np.full(len(points), -1, dtype=np.intp)
    markers = np.flatnonzero(pose.carried)
    squares = ((points[followed, np.newaxis] - pose.positions_of(markers)) ** 2).sum(axis=2)
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    rows, columns = linear_sum_assignment(squares)
    near = squares[rows, columns] < TRUSTED_SQUARE * pose.deviation[markers[columns]] ** 2
    labels[followed[rows[near]]] = markers[columns[near]]
    return labels


def _corrected(
    points: Floats, labels: Ints, usable: Bools, prediction: PosePrediction, spacing: float
) -> tuple[Ints, bool]:
    """Labels without those that do not fit and with those that do, and whether any changed."""
    corrected = labels.copy()
    known = np.flatnonzero(labels >= 0)
    markers = labels[known]
    error = points[known] - prediction.positions[markers]
    solved = np.linalg.solve(prediction.covariances[markers], error[..., np.newaxis])[..., 0]
    wrong = known[(error * solved).sum(axis=1) > TRUSTED_SQUARE]
    corrected[wrong] = -1
    free = np.flatnonzero((corrected < 0) & usable)
    is_missing = ~np.isnan(prediction.positions[:, 0])
    is_missing[corrected[corrected >= 0]] = False
    missing = np.flatnonzero(is_missing)
    if len(free) and len(missing):
        scores = explained(points[free], prediction, missing, spacing)
        from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

        rows, columns = linear_sum_assignment(scores, maximize=True)
        good = scores[rows, columns] > 0
        corrected[free[rows[good]]] = missing[columns[good]]
    return corrected, bool((corrected != labels).any())


def explained(points: Floats, prediction: PosePrediction, markers: Ints, spacing: float) -> Floats:
    """Log likelihood of points by some markers, over that by chance [nats], shape (n_points, n_markers); at least 0.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        Points.
    prediction : PosePrediction
        All markers.
    markers : ndarray of intp, shape (n_markers,)
        Which of them are compared.
    spacing : float, mm
        Typical distance of a point from its nearest neighbour.
    """
    covariance = prediction.covariances[markers]
    error = points[:, np.newaxis] - prediction.positions[markers]
    squares = np.einsum("nmi,mij,nmj->nm", error, np.linalg.inv(covariance), error)
    _, volume = np.linalg.slogdet(2 * np.pi * covariance)
    return np.asarray(np.maximum(chance(spacing) - 0.5 * (squares + volume), 0.0))
