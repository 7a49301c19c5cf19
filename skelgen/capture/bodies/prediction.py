r"""Where a body will be: a Kalman filter per body (future work in Gaschler 2011, 7).

The state is pose, velocity and acceleration; errors of the rotation are small rotations about the world's axes. Between
frames the accelerations stay, up to white jerk; a pose that was found corrects all of them, weighted with its
covariance. The prediction for the next frame says where to look for the balls. The corrected poses are smoother than
the found ones, but lag behind sudden motion.

The jerk adapts to the motion, for rotation and shift apart: innovations that are larger than expected raise it, smaller
ones lower it. So a body at rest is smoothed more than one that is waved about. The noise of the found poses is measured
by how far balls were from where their target puts them, in the last second: with a noise that is stated too large,
motion would be smoothed away.
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from skelgen._kernels.kalman import N_STATE, BodyState, correct, predict
from skelgen.capture.bodies import ExpectedPose
from skelgen.capture.values import FoundBody
from skelgen.parameters import StageParameters, declare

FRAME = 1 / 60
"""s; how long a jerk lasts: a frame of the cameras of Gaschler (2011)."""

FASTEST = (3_000.0, 30_000.0, 15.0, 300.0)
"""mm/s, mm/s^2, rad/s and rad/s^2 of a body that has just appeared, as standard deviations: those of a quick arm."""

PACE = 0.1
"""How fast the jerk adapts: it doubles or halves within some ten frames."""

SCALES = (0.003, 30.0)
"""Least and largest part of the typical jerk: a body at rest, and one that is hit."""

MAX_INNOVATION = 8.0
"""Largest squared deviation per freedom of one pose that counts."""

_POSE, _VELOCITY, _ACCELERATION = slice(0, 6), slice(6, 12), slice(12, 18)  # each turn, then place
_ROTATIONS = np.array([True, True, True, False, False, False])

HISTORY = 60
"""Frames over which the noise is measured: of five balls each tells nine numbers, so that it is known to 3 %."""

UNUSUAL = 2.1
"""Mean square of nine normal numbers that two of a hundred exceed: as where a ball is half hidden."""

LEAST_NOISE = 0.02
"""Of the stated standard deviations: balls of exact images are no more certain than that."""

LEAST_CENTRE_NOISE = 0.01
"""px; what errors of the calibration and of lenses leave even where targets fit better."""

DOUBT = 25.0
"""Squared Mahalanobis distance per freedom from the predicted pose, above which the filter starts anew."""


@dataclass(frozen=True)
class PredictionParameters(StageParameters):
    """Parameters of the prediction."""

    stage: ClassVar[str] = "prediction"

    jerk: float = declare(
        100_000.0,
        "Typical change of acceleration; followed from there as the body moves.",
        unit="mm/s^3",
        within=(1.0, 1e9),
    )
    turning_jerk: float = declare(1_000.0, "The same of angular acceleration.", unit="rad/s^3", within=(0.01, 1e7))
    hold: float = declare(
        0.5, "A body that was not found for longer is looked for everywhere.", unit="s", within=(0.0, 10.0)
    )
    balls: bool = declare(True, "Whether balls are followed from image to image, so that time tells wrong pairs.")
    joints: bool = declare(False, "Whether bodies that joints hold together are predicted together, by their angles.")


class MeasuredNoise:
    """How far balls are from their target, in stated standard deviations, over the last frames."""

    def __init__(self) -> None:
        self._squares: deque[float] = deque(maxlen=HISTORY)

    def applied(self, found: FoundBody) -> FoundBody:
        """Return a body, its covariance scaled by the misfit of the last frames, or by its own where that is larger."""
        square = found.noise**2
        self._squares.append(square)
        usual = max(float(np.median(self._squares)), LEAST_NOISE**2)
        return replace(found, covariance=max(usual, square / UNUSUAL) * found.covariance)

    def in_units_of(self, factor: float) -> None:
        """Rescale what was learned: stated standard deviations are `factor` times what they were."""
        self._squares = deque((square / factor**2 for square in self._squares), maxlen=HISTORY)


class CentreNoise:
    """Noise of the centres of balls [px]: as the rig states it, or as the targets of the last second show it if less.

    Parameters
    ----------
    stated : float, px
        The rig's.
    """

    def __init__(self, stated: float) -> None:
        self.stated = self.used = stated
        self._squares: list[float] = []
        self._n_frames = 0

    def seen(self, found: Iterable[FoundBody]) -> float:
        """Learn from the targets of a frame as they were found; return how many times as large the noise is now."""
        self._squares += [body.noise**2 for body in found]
        self._n_frames += 1
        if self._n_frames < HISTORY or not self._squares:
            return 1.0
        measured = self.used * float(np.sqrt(np.mean(self._squares)))
        before, self.used = self.used, min(max(measured, LEAST_CENTRE_NOISE), self.stated)
        self._squares, self._n_frames = [], 0
        return self.used / before


class BodyFilter:
    """Pose, velocity and acceleration of one body, from frame to frame.

    Parameters
    ----------
    parameters : PredictionParameters
        How fast motion may change, and how long it is predicted.
    """

    def __init__(self, parameters: PredictionParameters) -> None:
        self._parameters = parameters
        self._time: float | None = None
        self._seen = 0.0
        self._state = BodyState(np.eye(4), np.zeros(12), np.eye(N_STATE))
        self._scales = np.ones(2)  # of the jerk of rotations and of shifts
        self._ahead: tuple[float, BodyState] | None = None  # what was predicted last, and for when
        self._noise = MeasuredNoise()

    def in_units_of(self, factor: float) -> None:
        """Rescale what was learned: stated standard deviations are `factor` times what they were."""
        self._noise.in_units_of(factor)

    def expected(self, time: float) -> ExpectedPose | None:
        """Return where the body will be at a time [s]; None if it was not seen, or too long ago."""
        if self._time is None or time - self._seen > self._parameters.hold:
            return None
        state = self._predicted(time)
        return ExpectedPose(state.pose, state.covariance[_POSE, _POSE])

    def corrected(self, time: float, found: FoundBody) -> FoundBody:
        """Correct the filter by a pose that was found; return the body with the smoothed pose and its covariance.

        Parameters
        ----------
        time : float, s
            When it was found.
        found : FoundBody
            With its pose and covariance.
        """
        found = self._noise.applied(found)
        if self._time is None or time - self._seen > self._parameters.hold or time < self._time:
            return self._begun(time, found)
        pose, covariance = (np.array(part, np.float64, order="C") for part in (found.world_from_body, found.covariance))
        state, innovation = correct(self._predicted(time), pose, covariance)
        if not innovation.deviation <= DOUBT * _POSE.stop:
            return self._begun(time, found)
        self._ahead = None
        for part, deviation in enumerate((innovation.rotation, innovation.shift)):  # in units of what is expected
            scale = self._scales[part] * math.exp(PACE * (min(deviation, MAX_INNOVATION) - 1))
            self._scales[part] = min(max(scale, SCALES[0]), SCALES[1])
        self._state = BodyState(*state)
        self._time = self._seen = time
        return replace(found, world_from_body=self._state.pose, covariance=self._state.covariance[_POSE, _POSE].copy())

    def _begun(self, time: float, found: FoundBody) -> FoundBody:
        """Start anew where the body was found, with unknown velocity."""
        self._ahead = None
        self._scales = np.ones(2)
        self._time = self._seen = time
        speed, acceleration, turning, turning_acceleration = FASTEST
        covariance = np.zeros((N_STATE, N_STATE))
        covariance[_POSE, _POSE] = found.covariance
        covariance[_VELOCITY, _VELOCITY] = np.diag(np.where(_ROTATIONS, turning, speed) ** 2)
        covariance[_ACCELERATION, _ACCELERATION] = np.diag(
            np.where(_ROTATIONS, turning_acceleration, acceleration) ** 2
        )
        self._state = BodyState(np.array(found.world_from_body, np.float64, order="C"), np.zeros(12), covariance)
        return found

    def _predicted(self, time: float) -> BodyState:
        """The state at a later time."""
        if self._ahead is None or self._ahead[0] != time:  # asked twice a frame: before the search and after it
            turning, shifting = self._scales * [self._parameters.turning_jerk, self._parameters.jerk]
            power = np.where(_ROTATIONS, turning, shifting) ** 2 * FRAME
            self._ahead = time, BodyState(*predict(self._state, power, time - (self._time or 0.0)))
        return self._ahead[1]


class Prediction:
    """One filter per target."""

    def __init__(self, names: Iterable[str], parameters: PredictionParameters | None = None) -> None:
        self._filters = {name: BodyFilter(parameters or PredictionParameters()) for name in names}

    def load(self) -> None:
        """Load the kernels, before cameras run."""
        trial, body = BodyFilter(PredictionParameters()), FoundBody("trial", np.eye(4), np.eye(6), np.arange(0), 0.0)
        for frame in range(2):
            trial.corrected(frame * FRAME, body)

    def in_units_of(self, factor: float) -> None:
        """Rescale what was learned: stated standard deviations are `factor` times what they were."""
        for one in self._filters.values():
            one.in_units_of(factor)

    def expected(self, time: float) -> Mapping[str, ExpectedPose]:
        """Return where bodies will be at a time [s], by name; without those that were not seen or too long ago."""
        expected = {name: one.expected(time) for name, one in self._filters.items()}
        return {name: pose for name, pose in expected.items() if pose is not None}

    def corrected(self, time: float, found: Iterable[FoundBody]) -> list[FoundBody]:
        """Correct the filters by the bodies that were found, and return these smoothed.

        Parameters
        ----------
        time : float, s
            When they were found.
        found : iterable of FoundBody
            With their poses and covariances.
        """
        return [self._filters[body.name].corrected(time, body) for body in found]
