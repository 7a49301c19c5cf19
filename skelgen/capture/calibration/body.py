"""Rigid bodies measured by the rig itself: the balls of a target, with deviations (Gaschler 2011, 4.2).

A frame that shows the target alone gives the order of the balls and a first shape. The search for bodies then finds it
in all other frames, among whatever else they hold; their points, put in order, give the shape by maximum likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from skelgen.capture.bodies import BodyFinder
from skelgen.capture.bodies.design import AmbiguousTargetError, check_targets, propose_move
from skelgen.capture.calibration.joints import LEAST_TURN, thinned
from skelgen.capture.calibration.verdict import GOOD, REPEAT, USABLE, Row, Verdict, as_sentence, hundredths
from skelgen.capture.parameters import BodyParameters
from skelgen.capture.values import FoundBody, StereoPoints
from skelgen.errors import InputError
from skelgen.geometry.rotations import N_POSE, moved_pose, slopes_by_motion, vector_from_matrix
from skelgen.kinematics import calibrate_rigid_body
from skelgen.kinematics.chain.schur_complement import LinearisedProblem, gauss_newton
from skelgen.model.arrays import Floats, Ints
from skelgen.model.rig import BodyTarget
from skelgen.progress import SILENT, Monitor, counted, with_progress

MIN_FRAMES = 3
ENOUGH_FRAMES = 10
"""Frames that Gaschler (2011) takes at least; fewer calibrate a target, but not well."""

MAX_FRAMES = 300
"""Frames that are used, evenly spread: neighbours of these show the same."""

FIRST_FRAMES = 5
"""Frames that are tried as the one that shows the target alone."""

MAX_PROPOSED = 8
"""Balls up to which a better design is looked for: it takes three seconds, and grows with their fourth power."""

DOUBTFUL_NOISE = 2.0
"""Residuals in stated deviations above which the rig's noise is wrong, or the target bends."""

LEAST_NOISE = 0.005
"""px; balls in images without any noise still err by so much."""


@dataclass(frozen=True, eq=False)
class BodyCalibration:
    """A calibrated target.

    Attributes
    ----------
    target : BodyTarget
        Balls in the normal form, with standard deviations: the first at the origin, the second on x, the third in the
        xy plane.
    noise : float
        Root mean square residual in stated standard deviations.
    n_frames : int
        Frames that the shape was fitted to.
    n_left_out : int
        Frames in which the target was not found.
    turn : float, degrees
        How far it turned at most from where it was first seen.
    notices : tuple of str
        What the user should know.
    """

    target: BodyTarget
    noise: float
    n_frames: int
    n_left_out: int
    turn: float
    notices: tuple[str, ...]

    def image_noise(self, stated: float) -> float:
        """Return the noise of the balls' centres [px]; 0 where too few frames, too little turning or bending hide it.

        Parameters
        ----------
        stated : float, px
            Noise of the rig that the points' covariances came from.
        """
        is_known = self.is_complete and self.noise <= DOUBTFUL_NOISE
        return max(stated * self.noise, LEAST_NOISE) if is_known else 0.0

    @property
    def is_complete(self) -> bool:
        """Whether it rests on enough frames, from enough sides."""
        return self.n_frames >= ENOUGH_FRAMES and self.turn >= LEAST_TURN

    @property
    def verdict(self) -> Verdict:
        """What it is worth, in words."""
        grade = REPEAT if self.noise > DOUBTFUL_NOISE else GOOD if self.is_complete else USABLE
        worst, n_tried = float(np.asarray(self.target.std).max()), self.n_frames + self.n_left_out
        first = (
            f"{grade.capitalize()}: its balls are known to {worst:.2f} mm, from {self.n_frames} of {n_tried} frames, "
            f"in which it turned by {self.turn:.0f} degrees; residuals are {self.noise:.2f} times the stated noise. "
            "Its design is not ambiguous."
        )
        return Verdict(grade, (first, *map(as_sentence, self.notices)))


def calibrate_body(
    frames: Sequence[StereoPoints],
    name: str,
    n_balls: int | None = None,
    beside: Sequence[BodyTarget] = (),
    parameters: BodyParameters | None = None,
    monitor: Monitor = SILENT,
) -> BodyCalibration:
    """Calibrate a target that is moved in front of the cameras.

    Parameters
    ----------
    frames : sequence of StereoPoints
        At least one of them shows the target alone, all its balls and nothing else.
    name : str
        What the target is called.
    n_balls : int, optional
        Its number of balls; by default the most frequent number of points in a frame.
    beside : sequence of BodyTarget
        Other targets, which it must not be taken for.
    parameters : BodyParameters, optional
        Limits of the search.
    monitor : Monitor
        Reports progress, and may cancel.

    Raises
    ------
    InputError
        If no frame shows the target alone, too few show it at all, or its design is ambiguous.
    """
    parameters = parameters or BodyParameters()
    chosen = thinned(frames, MAX_FRAMES)
    n_balls = n_balls or _typical_number(chosen, parameters.min_points)
    target = _first_target(chosen, name, n_balls, parameters)
    monitor.begin("body")
    found = _find_in_frames(chosen, target, parameters, monitor)
    shape = _shape(chosen, found, name, n_balls)
    std = np.sqrt(np.maximum(np.diag(shape.covariance), 0.0)).reshape(shape.points.shape)
    target = BodyTarget(name, shape.points, std)
    try:
        check_targets([*beside, target], parameters)
    except AmbiguousTargetError as error:
        raise InputError(_with_advice(error, beside, parameters)) from error
    n_frames = len(shape.world_from_body)
    turns = shape.world_from_body[:, :3, :3] @ shape.world_from_body[0, :3, :3].T
    turn = float(np.rad2deg(np.linalg.norm(vector_from_matrix(turns), axis=1).max()))
    done = BodyCalibration(
        target, shape.noise, n_frames, len(chosen) - n_frames, turn, tuple(_notices(name, shape, turn))
    )
    if done.is_complete and shape.noise < 1.0:  # the balls are less noisy than the rig says
        done = replace(done, target=replace(target, std=shape.noise * std))
    return done


def _typical_number(frames: Sequence[StereoPoints], fewest: int) -> int:
    counts = np.array([len(sure_points(frame)) for frame in frames if len(sure_points(frame)) >= fewest])
    if not len(counts):
        raise InputError(f"no frame shows {fewest} points or more, so that there is no body to calibrate")
    return int(np.bincount(counts).argmax())


def sure_points(frame: StereoPoints) -> Ints:
    """Return the indices of points that share no ball with another candidate."""
    return np.flatnonzero(~frame.ambiguous)


def _first_target(frames: Sequence[StereoPoints], name: str, n_balls: int, parameters: BodyParameters) -> BodyTarget:
    """A target from one frame that shows nothing else: of some such frames, that which agrees with most others."""
    alone = [frame for frame in frames if len(sure_points(frame)) == n_balls == len(frame)]
    if not alone:
        most = max((len(frame) for frame in frames), default=0)
        raise InputError(
            f"no frame shows exactly {n_balls} points, the balls of body {name!r} and nothing else (the fullest shows "
            f"{most}); cover what else reflects, or state the number of balls"
        )
    trials = [first_shape(frame, name) for frame in thinned(alone, FIRST_FRAMES)]
    samples = thinned(frames, 10 * FIRST_FRAMES)
    try:
        agreeing = [sum(map(bool, _find_in_frames(samples, trial, parameters, SILENT))) for trial in trials]
    except InputError as error:
        raise InputError(
            f"{_with_advice(error, (), parameters)}. The pictures show {n_balls} balls at once; if those are not all "
            f"of body {name!r}, cover the others, or state its number of balls"
        ) from error
    return trials[int(np.argmax(agreeing))]


def _with_advice(error: InputError, beside: Sequence[BodyTarget], parameters: BodyParameters) -> str:
    """What is wrong with a target, and if it is ambiguous, which ball to move and where to."""
    if not isinstance(error, AmbiguousTargetError):
        return str(error)
    few = len(error.target.points) <= MAX_PROPOSED
    move = propose_move(error.target, beside, parameters) if few else None
    advice = "choose one whose distances all differ" if move is None else move.sentence
    return f"{error.confusion.sentence}; {advice}"


def first_shape(frame: StereoPoints, name: str) -> BodyTarget:
    """Return a target as seen in one frame that shows nothing else.

    Parameters
    ----------
    frame : StereoPoints
        Its balls.
    name : str
        What the target is called.
    """
    order = _spanning_order(frame.points)
    std = np.sqrt(np.einsum("nii->ni", frame.covariance))
    return BodyTarget(name, frame.points[order] - frame.points[order[0]], std[order])


def _spanning_order(points: Floats) -> Ints:
    """An order in which the first three points span the largest triangle."""

    def area(three: tuple[int, ...]) -> float:
        a, b, c = points[list(three)]
        return float(np.linalg.norm(np.cross(b - a, c - a)))

    first = max(combinations(range(len(points)), 3), key=area)
    return np.array([*first, *(index for index in range(len(points)) if index not in first)])


def _find_in_frames(
    frames: Sequence[StereoPoints], target: BodyTarget, parameters: BodyParameters, monitor: Monitor
) -> list[list[FoundBody]]:
    finder = BodyFinder([target], parameters)
    return [finder.find(frame) for frame in with_progress(frames, len(frames), monitor)]


def _shape(frames: Sequence[StereoPoints], found: Sequence[list[FoundBody]], name: str, n_balls: int) -> WeightedShape:
    """The shape by the positions and covariances of the balls in the frames that show the target."""
    shown = [(frame, bodies[0]) for frame, bodies in zip(frames, found, strict=True) if bodies]
    if len(shown) < MIN_FRAMES:
        raise InputError(
            f"body {name!r} was found in {counted(len(shown), 'frame')}; {MIN_FRAMES} are the least, "
            f"{ENOUGH_FRAMES} or more from many sides are better"
        )
    positions = np.full((len(shown), n_balls, 3), np.nan)
    covariances = np.full((len(shown), n_balls, 3, 3), np.nan)
    for index, (frame, body) in enumerate(shown):
        seen = body.points >= 0
        positions[index, seen] = frame.points[body.points[seen]]
        covariances[index, seen] = frame.covariance[body.points[seen]]
    start = calibrate_rigid_body(positions)
    return fit_weighted_shape(start.points, start.world_from_body, positions, covariances)


def _notices(name: str, shape: WeightedShape, turn: float) -> list[str]:
    notices = []
    if len(shape.world_from_body) < ENOUGH_FRAMES:
        notices.append(
            f"body {name!r} rests on {counted(len(shape.world_from_body), 'frame')}; {ENOUGH_FRAMES} or more are better"
        )
    if turn < LEAST_TURN:
        notices.append(
            f"body {name!r} turned by {turn:.0f} degrees only; turn it further, so that depth is seen from many sides"
        )
    if shape.noise > DOUBTFUL_NOISE:
        notices.append(
            f"the points of body {name!r} are off by {shape.noise:.1f} times what the rig's noise says; the target "
            "bends, or the cameras have moved since their calibration"
        )
    return notices


LEAST_GAIN = 1e-12
"""Part of the sum of squares below which steps change nothing that anyone could measure."""


@dataclass(frozen=True, eq=False)
class WeightedShape:
    """A rigid body in its normal form.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        First at the origin, second on x, third in the xy plane.
    covariance : ndarray, shape (3 n_points, 3 n_points), mm^2
        Of all coordinates; 0 for those that the normal form fixes.
    world_from_body : ndarray, shape (n_frames, 4, 4)
        Poses.
    noise : float
        Root mean square residual in stated standard deviations, freedoms taken off; 1 if they are true.
    """

    points: Floats
    covariance: Floats
    world_from_body: Floats
    noise: float


def fit_weighted_shape(points: Floats, poses: Floats, positions: Floats, covariances: Floats) -> WeightedShape:
    """Refine a body's shape and poses.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        First guess, in the normal form.
    poses : ndarray, shape (n_frames, 4, 4)
        World from body, first guess.
    positions : ndarray, shape (n_frames, n_points, 3), mm
        Measured; NaN where unseen. Every frame must fix a pose.
    covariances : ndarray, shape (n_frames, n_points, 3, 3), mm^2
        Of the measured points; what is unseen is not looked at.

    Returns
    -------
    WeightedShape
        Its covariance is never smaller than the residuals say.
    """
    seen, measured = ~np.isnan(positions[:, :, 0]), np.nan_to_num(positions)
    roots = np.linalg.inv(np.linalg.cholesky(np.where(seen[..., np.newaxis, np.newaxis], covariances, np.eye(3))))
    roots[~seen] = 0.0
    point, axis = np.divmod(np.arange(points.size), 3)
    free = axis < point  # the coordinates that the normal form leaves free

    def linearised(body: _PosedShape) -> LinearisedProblem:
        turns = body.poses[:, np.newaxis, :3, :3]
        arms = (turns @ body.points[..., np.newaxis])[..., 0]
        off = measured - arms - body.poses[:, np.newaxis, :3, 3]
        by_pose = slopes_by_motion(arms)
        by_points = np.einsum("fkij,kl->fkilj", roots @ turns, np.eye(len(points)))
        return LinearisedProblem(
            (roots @ off[..., np.newaxis]).reshape(len(poses), -1),
            by_points.reshape(len(poses), points.size, points.size)[..., free],
            (roots @ by_pose).reshape(len(poses), points.size, N_POSE),
        )

    def stepped(body: _PosedShape, step: Floats, moves: Floats) -> _PosedShape:
        change = np.zeros(points.size)
        change[free] = step
        return _PosedShape(body.points + change.reshape(points.shape), moved_pose(body.poses, moves))

    found = gauss_newton(_PosedShape(points, poses), linearised, stepped, least_gain=LEAST_GAIN)
    freedoms = 3 * int(seen.sum()) - N_POSE * len(poses) - int(free.sum())
    noise = float(np.sqrt(found.squares / max(freedoms, 1)))
    covariance = np.zeros((points.size, points.size))
    covariance[np.ix_(free, free)] = max(noise, 1.0) ** 2 * found.solution.covariance
    return WeightedShape(found.state.points, covariance, found.state.poses, noise)


class _PosedShape(NamedTuple):
    """A shape and its poses."""

    points: Floats
    poses: Floats


def ball_rows(target: BodyTarget) -> list[Row]:
    """Return where the balls of a target are [mm], by the titles of columns."""
    balls = zip(target.points.tolist(), np.asarray(target.std).tolist(), strict=True)
    return [
        {"ball": number} | {f"{axis} [mm]": hundredths(*pair) for axis, *pair in zip("xyz", place, std, strict=True)}
        for number, (place, std) in enumerate(balls, start=1)
    ]
