r"""Where a body will be: a Kalman filter per body (the seed's future work, Gaschler 2011, 7).

The state is pose, velocity and acceleration, with small turns about the world's axes in place of the rotation. Between
frames the accelerations stay, up to white jerk; a pose that was found corrects all of them, weighed with its
covariance. What is predicted for the next frame says where to look for the balls, and the corrected poses are smoother
than the found ones; the price is that they lag behind sudden motion.

How large the jerk is, the body tells itself: poses that are farther from the predicted ones than both are uncertain
raise it, nearer ones lower it, turns and shifts apart. A body at rest is smoothed more than one that is waved about.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from skelgen.capture.blobs import FoundBody
from skelgen.capture.bodies import ExpectedPose
from skelgen.geometry.rotations import matrix_from_vector, vector_from_matrix
from skelgen.model.arrays import Floats
from skelgen.parameters import StageParameters, declare

FRAME = 1 / 60
"""s; how long a jerk lasts: a frame of the seed's cameras."""

FASTEST = (3_000.0, 30_000.0, 15.0, 300.0)
"""mm/s, mm/s^2, rad/s and rad/s^2 of a body that has just appeared, as standard deviations: those of a quick arm."""

PACE = 0.1
"""How fast the jerk follows what the poses say: it doubles or halves within some ten frames."""

SCALES = (0.003, 30.0)
"""Least and largest part of the typical jerk: a body at rest, and one that is hit."""

MOST_SURPRISE = 8.0
"""Of one pose, in squared deviations per freedom: more says nothing more."""

N_STATE = 18
_POSE, _VELOCITY, _ACCELERATION = slice(0, 6), slice(6, 12), slice(12, 18)  # each turn, then place
_TURNS = np.array([True, True, True, False, False, False])
_EACH = np.arange(6)
_GROWTH = {
    (0, 0): 1 / 20,
    (0, 1): 1 / 8,
    (0, 2): 1 / 6,
    (1, 0): 1 / 8,
    (1, 1): 1 / 3,
    (1, 2): 1 / 2,
    (2, 0): 1 / 6,
    (2, 1): 1 / 2,
    (2, 2): 1.0,
}
"""How white jerk grows in the covariances of pose, velocity and acceleration, times a power of the time step."""

DOUBT = 25.0
"""Squared Mahalanobis distance per freedom of a found pose from the predicted one above which the filter starts anew:
the body did what the jerk does not allow."""


@dataclass(frozen=True)
class PredictionParameters(StageParameters):
    """Parameters of the prediction."""

    stage: ClassVar[str] = "prediction"

    jerk: float = declare(
        100_000.0,
        "Typical change of acceleration; followed from there as the body moves.",
        unit="mm/s^3",
        low=1.0,
        high=1e9,
    )
    turning_jerk: float = declare(1_000.0, "The same of angular acceleration.", unit="rad/s^3", low=0.01, high=1e7)
    hold: float = declare(
        0.5, "A body that was not found for longer is looked for everywhere.", unit="s", low=0.0, high=10.0
    )


class BodyFilter:
    """Pose, velocity and acceleration of one body, from frame to frame.

    Parameters
    ----------
    parameters : PredictionParameters
        How fast motion may change, and how long it is foretold.
    """

    def __init__(self, parameters: PredictionParameters) -> None:
        self._parameters = parameters
        self._time: float | None = None
        self._seen = 0.0
        self._pose = np.eye(4)
        self._rates = np.zeros(12)
        self._covariance = np.eye(N_STATE)
        self._scales = np.ones(2)  # of the jerk of turns and of shifts
        self._ahead: tuple[float, Floats, Floats, Floats] | None = None  # what was predicted last, and for when

    def expected(self, time: float) -> ExpectedPose | None:
        """Return where the body will be at a time [s], or None if nobody knows."""
        if self._time is None or time - self._seen > self._parameters.hold:
            return None
        pose, _, covariance = self._predicted(time)
        return ExpectedPose(pose, covariance[_POSE, _POSE])

    def corrected(self, time: float, found: FoundBody) -> FoundBody:
        """Take in a pose that was found at a time [s]; return the body with the smoothed pose and its covariance."""
        if self._time is None or time - self._seen > self._parameters.hold or time < self._time:
            return self._begun(time, found)
        pose, rates, covariance = self._predicted(time)
        turn = vector_from_matrix(found.world_from_body[:3, :3] @ pose[:3, :3].T)
        error = np.concatenate([turn, found.world_from_body[:3, 3] - pose[:3, 3]])
        spread = covariance[_POSE, _POSE] + found.covariance
        if error @ np.linalg.solve(spread, error) > DOUBT * len(error):
            return self._begun(time, found)
        self._ahead = None
        self._learn(error, spread)
        gain = np.linalg.solve(spread, covariance[_POSE]).T
        step = gain @ error
        self._pose = _moved(pose, step[_POSE])
        self._rates = rates + step[_POSE.stop :]
        self._covariance = covariance - gain @ covariance[_POSE]
        self._covariance = (self._covariance + self._covariance.T) / 2
        self._time = self._seen = time
        return replace(found, world_from_body=self._pose, covariance=self._covariance[_POSE, _POSE].copy())

    def _learn(self, error: Floats, spread: Floats) -> None:
        """Let the jerk follow how far poses are from the predicted ones, in units of what is to be expected."""
        for part, at in enumerate((slice(0, 3), slice(3, 6))):
            surprise = float(error[at] @ np.linalg.solve(spread[at, at], error[at])) / 3
            self._scales[part] *= np.exp(PACE * (min(surprise, MOST_SURPRISE) - 1))
        self._scales = np.clip(self._scales, *SCALES)

    def _begun(self, time: float, found: FoundBody) -> FoundBody:
        """Start anew: where it was found, with velocities that nobody knows."""
        self._ahead = None
        self._scales = np.ones(2)
        self._time = self._seen = time
        self._pose, self._rates = np.array(found.world_from_body), np.zeros(12)
        speed, acceleration, turning, turning_acceleration = FASTEST
        self._covariance = np.zeros((N_STATE, N_STATE))
        self._covariance[_POSE, _POSE] = found.covariance
        self._covariance[_VELOCITY, _VELOCITY] = np.diag(np.where(_TURNS, turning, speed) ** 2)
        fastest = np.where(_TURNS, turning_acceleration, acceleration)
        self._covariance[_ACCELERATION, _ACCELERATION] = np.diag(fastest**2)
        return found

    def _predicted(self, time: float) -> tuple[Floats, Floats, Floats]:
        """Pose, rates and covariance at a later time."""
        if self._ahead is None or self._ahead[0] != time:  # asked twice a frame: before the search and after it
            self._ahead = time, *self._carried(time - (self._time or 0.0))
        return self._ahead[1:]

    def _carried(self, step: float) -> tuple[Floats, Floats, Floats]:
        carry = np.eye(N_STATE)
        carry[_EACH, _EACH + 6] = carry[_EACH + 6, _EACH + 12] = step
        carry[_EACH, _EACH + 12] = step**2 / 2
        turning, shifting = self._scales * [self._parameters.turning_jerk, self._parameters.jerk]
        power = np.where(_TURNS, turning, shifting) ** 2 * FRAME
        noise = np.zeros((N_STATE, N_STATE))
        for (row, column), grown in _GROWTH.items():
            noise[_EACH + 6 * row, _EACH + 6 * column] = power * step ** (5 - row - column) * grown
        moved = carry @ np.concatenate([np.zeros(6), self._rates])
        return _moved(self._pose, moved[_POSE]), moved[_POSE.stop :], carry @ self._covariance @ carry.T + noise


class Prediction:
    """One filter per target."""

    def __init__(self, names: Iterable[str], parameters: PredictionParameters | None = None) -> None:
        self._filters = {name: BodyFilter(parameters or PredictionParameters()) for name in names}

    def expected(self, time: float) -> Mapping[str, ExpectedPose]:
        """Return where bodies will be at a time [s], those of which nobody knows left out."""
        told = {name: one.expected(time) for name, one in self._filters.items()}
        return {name: pose for name, pose in told.items() if pose is not None}

    def corrected(self, time: float, found: Iterable[FoundBody]) -> list[FoundBody]:
        """Take in the bodies that were found at a time [s], and return them smoothed."""
        return [self._filters[body.name].corrected(time, body) for body in found]


def _moved(pose: Floats, step: Floats) -> Floats:
    """A pose after a turn about the world's axes and a shift."""
    out = pose.copy()
    out[:3, :3] = matrix_from_vector(step[:3]) @ pose[:3, :3]
    out[:3, 3] += step[3:]
    return out
