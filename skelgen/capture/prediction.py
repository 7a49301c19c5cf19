r"""Where a body will be: a Kalman filter per body (the seed's future work, Gaschler 2011, 7).

The state is pose and velocity, with small turns about the world's axes in place of the rotation:
:math:`x = (\theta, p, \omega, v)`. Between frames both velocities stay, up to white accelerations; a pose that was found
corrects them, weighed with its covariance. What is predicted for the next frame says where to look for the balls, and
the corrected poses are smoother than the found ones; the price is that they lag behind sudden motion, the more the
smaller the accelerations are said to be.
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

N_STATE = 12
_POSE = slice(0, 6)  # turn, place
_VELOCITY = slice(6, 12)
_TURNS = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
DOUBT = 25.0
"""Squared Mahalanobis distance per freedom of a found pose from the predicted one above which the filter starts anew:
the body did what the accelerations do not allow."""


@dataclass(frozen=True)
class PredictionParameters(StageParameters):
    """Parameters of the prediction."""

    stage: ClassVar[str] = "prediction"

    acceleration: float = declare(
        10_000.0, "Typical acceleration of a body; less is smoother and lags more.", unit="mm/s^2", low=1.0, high=1e7
    )
    turning: float = declare(
        100.0,
        "Typical angular acceleration of a body; less is smoother and lags more.",
        unit="rad/s^2",
        low=0.01,
        high=1e5,
    )
    hold: float = declare(
        0.5, "A body that was not found for longer is looked for everywhere.", unit="s", low=0.0, high=10.0
    )


class BodyFilter:
    """Pose and velocity of one body, from frame to frame.

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
        self._velocity = np.zeros(6)
        self._covariance = np.eye(N_STATE)

    def expected(self, time: float) -> ExpectedPose | None:
        """Return where the body will be at a time [s], or None if nobody knows."""
        if self._time is None or time - self._seen > self._parameters.hold:
            return None
        pose, covariance = self._predicted(time)
        return ExpectedPose(pose, covariance[_POSE, _POSE])

    def corrected(self, time: float, found: FoundBody) -> FoundBody:
        """Take in a pose that was found at a time [s]; return the body with the smoothed pose and its covariance."""
        if self._time is None or time - self._seen > self._parameters.hold or time < self._time:
            return self._begun(time, found)
        pose, covariance = self._predicted(time)
        turn = vector_from_matrix(found.world_from_body[:3, :3] @ pose[:3, :3].T)
        error = np.concatenate([turn, found.world_from_body[:3, 3] - pose[:3, 3]])
        spread = covariance[_POSE, _POSE] + found.covariance
        if error @ np.linalg.solve(spread, error) > DOUBT * len(error):
            return self._begun(time, found)
        gain = np.linalg.solve(spread, covariance[_POSE]).T
        step = gain @ error
        self._pose = _moved(pose, step[_POSE])
        self._velocity = self._velocity + step[_VELOCITY]
        self._covariance = covariance - gain @ covariance[_POSE]
        self._covariance = (self._covariance + self._covariance.T) / 2
        self._time = self._seen = time
        return replace(found, world_from_body=self._pose, covariance=self._covariance[_POSE, _POSE].copy())

    def _begun(self, time: float, found: FoundBody) -> FoundBody:
        """Start anew: where it was found, with a velocity that nobody knows."""
        self._time = self._seen = time
        self._pose, self._velocity = np.array(found.world_from_body), np.zeros(6)
        self._covariance = np.zeros((N_STATE, N_STATE))
        self._covariance[_POSE, _POSE] = found.covariance
        limits = self._accelerations() * max(self._parameters.hold, 0.1)
        self._covariance[_VELOCITY, _VELOCITY] = np.diag(limits**2)
        return found

    def _predicted(self, time: float) -> tuple[Floats, Floats]:
        """Pose and covariance of the state at a later time."""
        step = time - (self._time or 0.0)
        carry = np.eye(N_STATE)
        carry[_POSE, _VELOCITY] = step * np.eye(6)
        power = self._accelerations() ** 2 * FRAME  # mm^2/s^3: the acceleration lasts for one frame of a camera
        noise = np.zeros((N_STATE, N_STATE))
        noise[_POSE, _POSE] = np.diag(power * step**3 / 3)
        noise[_POSE, _VELOCITY] = noise[_VELOCITY, _POSE] = np.diag(power * step**2 / 2)
        noise[_VELOCITY, _VELOCITY] = np.diag(power * step)
        return _moved(self._pose, step * self._velocity), carry @ self._covariance @ carry.T + noise

    def _accelerations(self) -> Floats:
        return np.where(_TURNS > 0, self._parameters.turning, self._parameters.acceleration)


FRAME = 1 / 60
"""s; how long an acceleration lasts: that of a frame of the seed's cameras."""


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
