"""Labels without a skeleton: tracks become markers, and a lost marker is found where its neighbours predict it."""

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels.online.group_search import find_group
from skelgen.stages.labels.online.learning import LearnedPose, Learner
from skelgen.stages.labels.online.links import TrackLabels
from skelgen.stages.labels.online.marker_history import PAST, RECENT_SECONDS, MarkerHistory
from skelgen.stages.labels.online.pose_filter import PoseFilter, PosePrediction
from skelgen.stages.labels.online.pose_search import chance
from skelgen.stages.labels.online.skeleton_labels import explained

PLAUSIBLE = 3.0
"""A point may be a lost marker if its distances to that marker's neighbours deviate by no more than this, in standard
deviations."""

CONVINCING = 2.0
"""nats by which the predicted place must explain a point better than chance."""

LATE, CLEAR = -1.0, 2.0
"""The same for a track that has waited long, because markers come back far more often than new ones are put on; and
nats by which the explanation must then be better than those of other lost markers and other tracks."""

WRONG = 6.0
"""Standard deviations by which the distances of a doubtful marker to its most rigid neighbours deviate."""

WRONG_SECONDS = 0.1
"""s for which they deviate before the track loses its label."""

DOUBT_EVERY, LEARN_EVERY = 3, 2
"""Frames between two comparisons of all distances, to find wrong labels and to learn."""

NEW_SECONDS = 0.1
"""s after which a track that resembles no lost marker is a new one: false points last a few frames."""

DOUBT_SECONDS = 0.3
"""s that a track waits which resembles a lost marker, but is not convincing."""

JOIN_VOTES = 3
"""Times that a marker must be found in the place of a lost one before they are merged."""

MOST_TRIALS, MOST_RECONSIDERED = 20, 5
"""Lost markers that are tried for the points of a frame, and markers that are reconsidered in it: bounds the work."""

MANY_FREE, REGROUP_EVERY = 4, 3
"""Tracks without a label from which on rigid groups are searched, and frames between two such searches."""

RECONSIDER_SECONDS, YOUNG_SECONDS = 0.25, 10.0
"""s between two comparisons of a young marker with lost ones, and s after which a marker is no longer young."""

TOGETHER = 2
"""Frames in which two labels of one marker may have been seen together: by a merged blob, or a reflection."""


class RigidLabels:
    """Labels of points by what is learned of distances and poses while it runs.

    Parameters
    ----------
    n_slots : int
        Most markers that are remembered.
    window : float, s
        Time over which distances are averaged.

    Attributes
    ----------
    merged : dict of int to int
        Labels that turned out to mean another marker, and its label.
    """

    def __init__(self, n_slots: int, window: float) -> None:
        self.merged: dict[int, int] = {}
        self._history = MarkerHistory(n_slots)
        MarkerHistory.load_kernels()
        self._window = window
        self._rate = 1.0
        self._track_slots = TrackLabels()
        self._n_wrong: dict[int, int] = {}
        self._resembles: set[int] = set()
        self._votes: dict[tuple[int, int], int] = {}
        self._learner = Learner()
        self._learned: LearnedPose | None = None
        self._prediction: PosePrediction | None = None
        self._n_labels = 0
        self._frame = 0
        self._time = 0.0

    @property
    def n_remembered(self) -> int:
        """Number of markers that are remembered."""
        return int((self._history.label >= 0).sum())

    def update(self, points: Floats, tracks: Ints, n_steps: int, rate: float, spacing: float) -> Ints:
        """Label one frame.

        Parameters
        ----------
        points : ndarray, shape (n, 3), mm
            The frame.
        tracks : ndarray of intp, shape (n,)
            Track of each point, -1 for none.
        n_steps : int
            Frame periods since the frame before.
        rate : float, Hz
            Frame rate.
        spacing : float, mm
            Typical distance of a point from its nearest neighbour.

        Returns
        -------
        ndarray of intp, shape (n,)
            Label of each point, -1 for none.
        """
        self._frame += 1
        self._time += n_steps / rate
        self._rate, self._history.window = rate, max(2, round(self._window * rate / LEARN_EVERY))
        self._track_slots.grow_older(tracks)
        age = self._track_slots.age
        self._n_wrong = {track: count for track, count in self._n_wrong.items() if track in age}
        self._resembles &= age.keys()
        slots = self._track_slots.of(tracks)
        self._doubt(points, tracks, slots)
        self._predict(points, slots, n_steps)
        self._regroup(points, tracks, slots, spacing)
        self._recognise(points, tracks, slots, spacing)
        self._begin(tracks, slots)
        self._reconsider(points, slots, spacing)
        self._learn(points, slots, spacing)
        self._track_slots.keep(tracks, slots)
        return np.where(slots >= 0, self._history.label[slots], -1)

    def _doubt(self, points: Floats, tracks: Ints, slots: Ints) -> None:
        """Remove labels from tracks that have left their place among their neighbours."""
        known = np.flatnonzero(slots >= 0)
        if len(known) < 4 or self._history.noise == 0.0 or self._frame % DOUBT_EVERY:
            return
        misfit = self._history.own_misfits(slots[known], points[known])
        for index, off in zip(known.tolist(), misfit.tolist(), strict=True):
            track = int(tracks[index])
            if off <= WRONG:
                self._n_wrong.pop(track, None)
                continue
            self._n_wrong[track] = self._n_wrong.get(track, 0) + 1
            if self._n_wrong[track] * DOUBT_EVERY > WRONG_SECONDS * self._rate:
                slots[index] = -1
                self._track_slots.age[track] = 1
                del self._n_wrong[track]

    def _predict(self, points: Floats, slots: Ints, n_steps: int) -> None:
        """Follow the pose of the learned skeleton; a new skeleton replaces it when its fit is due."""
        labels = np.where(slots >= 0, self._history.label[slots], -1)
        found = self._learner.result(self._time)
        if found is not None:
            learned = LearnedPose(PoseFilter(found[0]), found[1])
            self._learned = learned if learned.start(points, labels) else self._learned
        if self._learned is not None:
            self._prediction = self._learned.follow(points, labels, n_steps)

    def _regroup(self, points: Floats, tracks: Ints, slots: Ints, spacing: float) -> None:
        """Find a rigid group again where many tracks have no label; all other tracks are compared anew."""
        free = np.flatnonzero((slots < 0) & (tracks >= 0))
        if len(free) < MANY_FREE or self._frame % REGROUP_EVERY:
            return
        lost = self._history.lost(slots[slots >= 0])
        for slot, index in find_group(self._history, lost, points[free], spacing).items():
            slots[free[index]] = slot
            for track in tracks[free].tolist():
                self._track_slots.age[track] = 1

    def _recognise(self, points: Floats, tracks: Ints, slots: Ints, spacing: float) -> None:
        """Give each track without a label the lost marker whose predicted place explains it best."""
        young = np.flatnonzero((slots < 0) & (tracks >= 0))
        young = np.array([index for index in young.tolist() if self._is_due(int(tracks[index]))], dtype=np.intp)
        known = np.flatnonzero(slots >= 0)
        if not len(young) or not len(known):
            return
        found = self._explanations(points, young, slots[known], points[known], spacing)
        resembling = {int(tracks[index]) for _, index, _ in found}
        self._resembles = (self._resembles - set(tracks[young].tolist())) | resembling
        late = {index for index in young.tolist() if self._track_slots.age[int(tracks[index])] == self._last_look}
        for score, index, slot in sorted(found, key=lambda entry: (-entry[0], entry[1], entry[2])):
            wanted = LATE if index in late and _is_clear(found, (score, index, slot)) else CONVINCING
            if score > wanted and slots[index] < 0 and slot not in slots:
                slots[index] = slot

    def _explanations(
        self, points: Floats, young: Ints, visible: Ints, positions: Floats, spacing: float
    ) -> list[tuple[float, int, int]]:
        """Score, point and slot of each pair of a point and a lost marker that may be one."""
        lost = self._history.lost(visible)
        scores = self._remembered_scores(points[young], lost, visible, positions, spacing)
        scores = np.maximum(scores, self._learned_scores(points[young], lost, spacing))
        rows, columns = np.nonzero(scores > -np.inf)
        found = scores[rows, columns].tolist(), young[rows].tolist(), lost[columns].tolist()
        return list(zip(*found, strict=True))

    def _remembered_scores(
        self, points: Floats, lost: Ints, visible: Ints, positions: Floats, spacing: float
    ) -> Floats:
        """Log likelihood of points by lost markers in remembered poses, over chance [nats]; -inf where implausible."""
        neighbours = self._history.neighbours(lost, visible)
        misfit = self._history.misfits(neighbours, points, positions)
        scores = np.full(misfit.shape, -np.inf)
        least = misfit.min(axis=0, initial=np.inf)
        for column in np.argsort(least, kind="stable")[: min(MOST_TRIALS, int((least < PLAUSIBLE).sum()))].tolist():
            expected = self._history.expected(neighbours, column, positions)
            if expected is not None:
                place, variance = expected
                squares = ((points - place) ** 2).sum(axis=1)
                score = chance(spacing) - 0.5 * squares / variance - 1.5 * np.log(2 * np.pi * variance)
                scores[:, column] = np.where(misfit[:, column] < PLAUSIBLE, score, -np.inf)
        return scores

    def _learned_scores(self, points: Floats, lost: Ints, spacing: float) -> Floats:
        """Log likelihood of points by lost markers of the learned skeleton, over chance [nats]."""
        scores = np.full((len(points), len(lost)), -np.inf)
        if self._learned is None or self._prediction is None:
            return scores
        known = self._learned.markers_of(self._history.label[lost])
        columns = np.flatnonzero(known >= 0)
        if len(columns):
            markers = known[columns]
            found = explained(points, self._prediction, markers, spacing)
            scores[:, columns] = np.where(found > 0, found, -np.inf)
        return scores

    def _is_due(self, track: int) -> bool:
        """Whether to compare a track: when its age has doubled, so that the work is bounded, and when it has waited."""
        age = self._track_slots.age[track]
        return age & (age - 1) == 0 or age == self._last_look

    @property
    def _last_look(self) -> int:
        """Age at which a track that resembles a lost marker becomes that marker, or a new one."""
        return max(1, round(DOUBT_SECONDS * self._rate))

    def _begin(self, tracks: Ints, slots: Ints) -> None:
        """Make markers of tracks that have lasted long enough without being recognised."""
        for index in np.flatnonzero((slots < 0) & (tracks >= 0)).tolist():
            track = int(tracks[index])
            least = DOUBT_SECONDS if track in self._resembles else NEW_SECONDS
            if self._track_slots.age[track] < least * self._rate:
                continue
            slot = self._history.add(self._n_labels, self._frame)
            if slot >= 0:
                slots[index] = slot
                self._n_labels += 1

    def _reconsider(self, points: Floats, slots: Ints, spacing: float) -> None:
        """Merge markers with lost ones in whose place they are found repeatedly."""
        history = self._history
        for index in self._due_to_be_reconsidered(slots)[:MOST_RECONSIDERED]:
            young = int(slots[index])
            others = np.flatnonzero((slots >= 0) & (slots != young))
            if not len(others):
                continue
            found = self._explanations(points, np.array([index]), slots[others], points[others], spacing)
            found = [entry for entry in found if entry[2] != young and history.common[young, entry[2]] <= TOGETHER]
            for score, _, old in sorted(found, reverse=True)[:1]:
                pair = (int(history.label[young]), int(history.label[old]))
                self._votes[pair] = self._votes.get(pair, 0) + 1 if score > CONVINCING else 0
                if self._votes[pair] >= JOIN_VOTES:
                    self._join(young, old)
                    slots[index] = old

    def _due_to_be_reconsidered(self, slots: Ints) -> list[int]:
        """Points whose markers are young and are compared now; slots take turns, to spread the work."""
        known = np.flatnonzero(slots >= 0)
        n_seen = self._history.n_seen[slots[known]]
        turn = max(1, round(RECONSIDER_SECONDS * self._rate))
        is_due = (n_seen < YOUNG_SECONDS * self._rate) & ((n_seen + slots[known]) % turn == 0)
        return [int(index) for index in known[is_due]]

    def _join(self, young: int, old: int) -> None:
        label, older = int(self._history.label[young]), int(self._history.label[old])
        self.merged = {one: older if other == label else other for one, other in self.merged.items()}
        self.merged[label] = older
        self._history.join(young, old)
        self._track_slots.drop(np.array([young]))
        remembered = set(self._history.label.tolist())
        self._votes = {pair: votes for pair, votes in self._votes.items() if remembered.issuperset(pair)}

    def _learn(self, points: Floats, slots: Ints, spacing: float) -> None:
        known = np.flatnonzero(slots >= 0)
        self._history.note(slots[known], self._frame)
        if self._frame % LEARN_EVERY == 0:
            self._history.learn(slots[known], points[known])
        if self._frame % max(1, round(RECENT_SECONDS * self._rate)) == 0:
            most_every = max(1, int(2 * self._window / (PAST * RECENT_SECONDS)))
            self._history.keep_pose(slots[known], points[known], most_every)
            self._history.find_noise(slots[known], spacing)
            self._learner.begin(*self._history.poses(), self._time)


def _is_clear(found: list[tuple[float, int, int]], entry: tuple[float, int, int]) -> bool:
    """Whether a pair of point and lost marker is much better than others of the same point or marker."""
    score, index, slot = entry
    rivals = [other for other, i, s in found if (i == index) != (s == slot)]
    return score > max(rivals, default=-np.inf) + CLEAR
