r"""All joint angles in one extended Kalman filter (future work in Gaschler 2011, 6.3.1).

The state of a tree of targets is the pose of its root and the angles of its joints, with their velocities and
accelerations, which stay up to white jerk. Poses of targets that were found correct all of it, each weighted with its
covariance and with what its joints leave open: errors of their calibration, and the play that they show. A target of
which too few balls are seen to be found is looked for where the joints expect it, and each ball that is there counts.

Where a joint has play, a target is not quite where the chain has it. Of the way r to where it was found, the part
:math:`V (V + R)^{-1} r` is the joint's, with the variances V of the play and R of the pose; so that nothing gets worse.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from skelgen._kernels.kalman import GROWTH
from skelgen.capture.bodies import ExpectedPose, prediction
from skelgen.capture.calibration.joints import trees_of
from skelgen.capture.error_propagation import HINGE, block_diagonal, constraint_slope
from skelgen.capture.target_joints import (
    ChainState,
    JointAngle,
    TargetChain,
    find_angles,
    pose_error,
    turned_and_shifted,
    violation_of,
)
from skelgen.capture.values import FoundBody, StereoPoints
from skelgen.geometry.rotations import N_POSE, matrix_from_vector, slopes_by_motion, vector_from_matrix
from skelgen.kinematics.joints.angles import rotation_vector_deviations
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import AnySettings, BodyTarget, TargetJoint

ITERATIONS = 2
"""Of each correction: angles that changed much since the last frame bend the chain's path."""

GATE = 4.0
"""Standard deviations from where a ball is expected, up to which a point may be it."""

LEAST = np.diag([1e-6] * 3 + [1e-4] * 3) ** 2
"""Variances [rad^2, mm^2] that are added to poses, so that exact ones can be weighted."""


@dataclass(frozen=True, eq=False)
class _Measured:
    """Numbers that correct the chain: how far they are off, how they follow its freedoms, and their covariance."""

    error: Floats
    slope: Floats
    covariance: Floats


_Measure = Callable[[ChainState], list[_Measured]]


class ChainFilter:
    """Targets that joints hold together, from frame to frame.

    Parameters
    ----------
    joints : sequence of TargetJoint
        Of one tree, each one's parent before it.
    targets : mapping of str to BodyTarget
        All targets, by name.
    parameters : PredictionParameters
        How fast motion may change, and how long it is predicted.
    """

    def __init__(
        self,
        joints: Sequence[TargetJoint],
        targets: Mapping[str, BodyTarget],
        parameters: prediction.PredictionParameters,
    ) -> None:
        self._tree, self._targets, self._parameters = TargetChain(joints), targets, parameters
        self._groups = [slice(0, 3), slice(3, N_POSE), *self._tree.of_joint]
        self._typical = np.full(self._tree.n, parameters.turning_jerk)
        self._typical[3:N_POSE] = parameters.jerk
        self._scales = np.ones(len(self._groups))
        self._noise = {name: prediction.MeasuredNoise() for name in self._tree.names}
        self._play = [_Play(joint) for joint in joints]
        self._chain: ChainState | None = None
        self._time, self._seen = 0.0, dict.fromkeys(self._tree.names, -math.inf)
        self._ahead: tuple[float, ChainState] | None = None  # what was predicted last, and for when
        self.angles: dict[str, JointAngle] = {}

    def in_units_of(self, factor: float) -> None:
        """Rescale what was learned: stated standard deviations are `factor` times what they were."""
        for noise in self._noise.values():
            noise.in_units_of(factor)

    def expected(self, time: float) -> dict[str, ExpectedPose]:
        """Return where targets will be at a time [s], by name; none before all were seen, or long after."""
        if self._chain is None or time - min(self._seen.values()) > self._parameters.hold or time < self._time:
            return {}
        ahead = self._at(self._chain, time)
        poses = self._tree.poses(ahead)
        return {name: ExpectedPose(poses[name], self._spread(ahead, poses, name)) for name in self._tree.names}

    def corrected(self, time: float, found: Iterable[FoundBody], points: StereoPoints) -> list[FoundBody] | None:
        """Correct the filter by what was found; return the targets as the chain has them, None while it has none.

        Parameters
        ----------
        time : float, s
            When they were found.
        found : iterable of FoundBody
            Targets of the frame; others than those of the chain are passed over.
        points : StereoPoints
            All points of the frame.
        """
        bodies = {body.name: self._noise[body.name].applied(body) for body in found if body.name in self._noise}
        for play in self._play:
            play.look(bodies)
        known = self.expected(time)
        self._seen |= dict.fromkeys(bodies, time)
        if not known:
            self._begin(bodies)
        elif self._chain is not None:
            self._chain, deviation = self._corrected(self._at(self._chain, time), bodies)
            if deviation > prediction.DOUBT * N_POSE * max(len(bodies), 1):
                self._begin(bodies)
        self._time, self._ahead = time, None
        if self._chain is None:
            self.angles = {}
            return None
        seen = self._with_few_balls(self._chain, bodies, points) if known else {}
        self._seen |= dict.fromkeys(seen, time)
        return self._result(self._chain, bodies, seen)

    def _begin(self, bodies: Mapping[str, FoundBody]) -> None:
        """Start anew where all targets were found, with unknown velocities; or not at all."""
        self._chain, self._ahead, self._scales = None, None, np.ones(len(self._groups))
        if any(name not in bodies for name in self._tree.names):
            return
        turns = []
        for joint in self._tree.joints:
            ends = bodies[joint.parent].world_from_body, bodies[joint.child].world_from_body
            turn = (ends[0] @ joint.parent_from_joint)[:3, :3].T @ (ends[1] @ joint.child_from_joint)[:3, :3]
            if joint.kind == HINGE:
                angle = math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
                turn = matrix_from_vector(np.array([0.0, 0.0, angle]))
            turns.append(turn)
        speed, acceleration, turning, turning_acceleration = prediction.FASTEST
        fast, faster = np.full(self._tree.n, turning), np.full(self._tree.n, turning_acceleration)
        fast[3:N_POSE], faster[3:N_POSE] = speed, acceleration
        covariance = np.diag(np.concatenate([np.full(self._tree.n, 1.0), fast, faster]) ** 2)
        covariance[3:N_POSE, 3:N_POSE] *= 100.0**2  # mm: what is found now says where it is
        root = np.array(bodies[self._tree.names[0]].world_from_body)
        start = ChainState(root, tuple(turns), np.zeros((2, self._tree.n)), covariance)
        self._chain, _ = self._corrected(start, bodies, adapts=False)

    def _at(self, chain: ChainState, time: float) -> ChainState:
        """The chain as predicted for a time, which is asked for before the search and after it."""
        if self._ahead is None or self._ahead[0] != time:
            self._ahead = time, self._predicted(chain, time - self._time)
        return self._ahead[1]

    def _predicted(self, chain: ChainState, step: float) -> ChainState:
        """The chain some time [s] later."""
        growth = np.array([[1.0, step, step**2 / 2], [0.0, 1.0, step], [0.0, 0.0, 1.0]])
        rows, n = np.arange(3), self._tree.n
        scales = np.repeat(self._scales, [group.stop - group.start for group in self._groups])
        power = (scales * self._typical) ** 2 * prediction.FRAME
        carried = np.einsum("ab,bicj,dc->aidj", growth, chain.covariance.reshape(3, n, 3, n), growth)
        grown = GROWTH * step ** (5.0 - rows[:, np.newaxis] - rows)
        carried[:, np.arange(n), :, np.arange(n)] += grown * power[:, np.newaxis, np.newaxis]
        velocity, acceleration = chain.rates
        moved = self._tree.moved(chain, step * velocity + step**2 / 2 * acceleration)
        rates = np.stack([velocity + step * acceleration, acceleration])
        return replace(moved, rates=rates, covariance=carried.reshape(3 * n, 3 * n))

    def _open(self, poses: Mapping[str, Floats], name: str) -> Floats:
        """Covariance of a target's pose that the joints on its path leave open, shape (6, 6)."""
        return LEAST + sum(
            (self._play[number].covariance(poses) for number in self._tree.paths[name]), np.zeros((6, 6))
        )

    def _spread(self, chain: ChainState, poses: Mapping[str, Floats], name: str) -> Floats:
        """Covariance of a target's pose, shape (6, 6)."""
        slope = self._tree.slope(poses, name)
        return np.asarray(slope @ chain.covariance[: self._tree.n, : self._tree.n] @ slope.T + self._open(poses, name))

    def _corrected(
        self, prior: ChainState, bodies: Mapping[str, FoundBody], *, adapts: bool = True
    ) -> tuple[ChainState, float]:
        """The chain after targets were found, and their squared deviation from the prediction."""

        def measured(chain: ChainState) -> list[_Measured]:
            poses = self._tree.poses(chain)
            return [
                _Measured(
                    pose_error(poses[name], body.world_from_body),
                    self._tree.slope(poses, name),
                    body.covariance + self._open(poses, name),
                )
                for name, body in bodies.items()
            ]

        return self._after(prior, measured, adapts=adapts) if bodies else (prior, 0.0)

    def _after(self, prior: ChainState, measure: _Measure, *, adapts: bool) -> tuple[ChainState, float]:
        """The chain after a measurement, by an iterated step of the filter, and its squared deviation."""
        n, now = self._tree.n, prior
        step, deviation = np.zeros(3 * n), 0.0
        gain: Floats = np.zeros((3 * n, 0))
        slope: Floats = np.zeros((0, n))
        for iteration in range(ITERATIONS):
            parts = measure(now)
            slope = np.concatenate([part.slope for part in parts])
            error = np.concatenate([part.error for part in parts]) + slope @ step[:n]
            total = slope @ prior.covariance[:n, :n] @ slope.T + block_diagonal(*(part.covariance for part in parts))
            gain = np.asarray(np.linalg.solve(total, slope @ prior.covariance[:n]).T, dtype=np.float64)
            step = gain @ error
            if iteration == 0:
                deviation = float(error @ np.linalg.solve(total, error))
            now = self._tree.moved(prior, step[:n])
        left = prior.covariance - gain @ slope @ prior.covariance[:n]
        covariance = np.asarray((left + left.T) / 2)
        if adapts:
            self._adapt(step[:n], (prior.covariance - covariance)[:n, :n])
        return replace(now, rates=prior.rates + step[n:].reshape(2, n), covariance=covariance), deviation

    def _adapt(self, step: Floats, spread: Floats) -> None:
        """Raise the jerk of freedoms whose corrections are larger than expected, lower that of others."""
        for number, group in enumerate(self._groups):
            own, change = spread[group, group], step[group]
            if np.linalg.eigvalsh(own)[0] <= 0:  # nothing was seen of it
                continue
            ratio = float(change @ np.linalg.solve(own, change)) / len(change)
            scale = self._scales[number] * math.exp(prediction.PACE * (min(ratio, prediction.MAX_INNOVATION) - 1))
            self._scales[number] = min(max(scale, prediction.SCALES[0]), prediction.SCALES[1])

    def _with_few_balls(
        self, chain: ChainState, bodies: Mapping[str, FoundBody], points: StereoPoints
    ) -> dict[str, Ints]:
        """Correct the chain by single balls of targets that were not found; return the points of their balls."""
        free = np.ones(len(points), dtype=np.bool_)
        for body in bodies.values():
            free[body.points[body.points >= 0]] = False
        seen: dict[str, Ints] = {}
        for name in self._tree.names:
            matched = None if name in bodies else self._balls_at(chain, name, points, free)
            if matched is None or (matched < 0).all():
                continue
            ball = np.flatnonzero(matched >= 0)
            free[matched[ball]] = False

            def measured(
                now: ChainState, name: str = name, ball: Ints = ball, matched: Ints = matched
            ) -> list[_Measured]:
                places, slopes, spreads = self._balls(now, name, ball)
                spreads = spreads + points.covariance[matched[ball]]
                errors = points.points[matched[ball]] - places
                return [_Measured(*one) for one in zip(errors, slopes, spreads, strict=True)]

            chain, _ = self._after(chain, measured, adapts=True)
            seen[name] = matched
        self._chain = chain
        return seen

    def _balls(self, chain: ChainState, name: str, ball: Ints) -> tuple[Floats, Floats, Floats]:
        """Places of a target's balls, how they follow the chain's freedoms, and what joints and target leave open."""
        poses, target = self._tree.poses(chain), self._targets[name]
        turn = poses[name][:3, :3]
        arms = target.points[ball] @ turn.T
        columns = slopes_by_motion(arms)
        own = (turn * np.asarray(target.std)[ball, np.newaxis] ** 2) @ turn.T
        spreads = columns @ self._open(poses, name) @ columns.swapaxes(1, 2) + own
        return arms + poses[name][:3, 3], columns @ self._tree.slope(poses, name), spreads

    def _balls_at(self, chain: ChainState, name: str, points: StereoPoints, free: Bools) -> Ints:
        """The only free point near where each ball is expected, -1 where there is none or a second one."""
        every = np.arange(len(self._targets[name].points))
        places, slopes, spreads = self._balls(chain, name, every)
        spreads = spreads + slopes @ chain.covariance[: self._tree.n, : self._tree.n] @ slopes.swapaxes(1, 2)
        away = points.points - places[:, np.newaxis]
        total = spreads[:, np.newaxis] + points.covariance
        near = np.einsum("kpi,kpi->kp", away, np.linalg.solve(total, away[..., np.newaxis])[..., 0]) <= GATE**2
        near &= free & ~points.ambiguous
        alone = near & (near.sum(axis=1, keepdims=True) == 1) & (near.sum(axis=0) == 1)
        return np.where(alone.any(axis=1), alone.argmax(axis=1), -1)

    def _result(self, chain: ChainState, bodies: Mapping[str, FoundBody], seen: Mapping[str, Ints]) -> list[FoundBody]:
        """The targets that were seen, as the chain has them; the angles of joints between them are kept beside."""
        poses, out = self._tree.poses(chain), []
        for name in self._tree.names:
            slope = self._tree.slope(poses, name)
            spread = slope @ chain.covariance[: self._tree.n, : self._tree.n] @ slope.T
            if name in bodies:
                found, left = bodies[name], self._open(poses, name)
                part = np.linalg.solve(left + found.covariance, left).T
                pose = turned_and_shifted(poses[name], part @ pose_error(poses[name], found.world_from_body))
                out.append(replace(found, world_from_body=pose, covariance=spread + left - part @ left))
            elif name in seen:
                covariance = spread + self._open(poses, name)
                out.append(FoundBody(name, poses[name], covariance, seen[name], 0.0))
        there = {body.name: body for body in out}
        self.angles = {
            joint.name: angle
            for number, joint in enumerate(self._tree.joints)
            if (angle := self._angle(chain, number, there)) is not None
        }
        return out

    def _angle(self, chain: ChainState, number: int, bodies: Mapping[str, FoundBody]) -> JointAngle | None:
        """The angle of a joint with its deviation."""
        joint, own, turn = self._tree.joints[number], self._tree.of_joint[number], chain.turns[number]
        found = find_angles(joint, bodies)
        if found is None:
            return None
        spread = chain.covariance[own, own]
        if joint.kind == HINGE:
            return replace(found, angles=vector_from_matrix(turn)[2:], std=np.sqrt(np.diag(spread)))
        std = rotation_vector_deviations(turn[np.newaxis], spread[np.newaxis])[0]
        return replace(found, angles=vector_from_matrix(turn), std=std)


class _Play:
    """What a joint leaves open: errors of its calibration, and the gap and tilt that it showed beyond noise."""

    def __init__(self, joint: TargetJoint) -> None:
        self._joint, self._n = joint, 0
        self._squares = np.zeros(2)  # of the gap [mm^2] and of the tilt [rad^2] along one axis, beyond noise

    def look(self, bodies: Mapping[str, FoundBody]) -> None:
        """Take one more frame, if it shows both targets."""
        if self._joint.parent not in bodies or self._joint.child not in bodies:
            return
        parent, child = bodies[self._joint.parent], bodies[self._joint.child]
        poses = parent.world_from_body, child.world_from_body
        violation, slope = violation_of(self._joint, poses), constraint_slope(self._joint, poses)
        noise = slope @ block_diagonal(parent.covariance, child.covariance) @ slope.T
        excess = violation**2 - np.diag(noise)
        self._n = min(self._n + 1, prediction.HISTORY)
        tilt = excess[3:].mean() if len(excess) > 3 else 0.0
        self._squares += (np.array([excess[:3].mean(), tilt]) - self._squares) / self._n

    def covariance(self, poses: Mapping[str, Floats]) -> Floats:
        """Return the covariance of the child's pose, shape (6, 6).

        Parameters
        ----------
        poses : mapping of str to ndarray, shape (4, 4), mm
            World from body.
        """
        joint, out = self._joint, np.zeros((6, 6))
        gap, tilt = np.maximum(self._squares, 0.0)
        out[:3, :3] = ((joint.axis_std**2).sum() + tilt) * np.eye(3)
        out[3:, 3:] = gap * np.eye(3)
        for name, std in zip((joint.parent, joint.child), joint.std, strict=True):
            turn = poses[name][:3, :3]
            out[3:, 3:] += (turn * std**2) @ turn.T
        return out


def chain_filters(settings: AnySettings, parameters: prediction.PredictionParameters) -> tuple[ChainFilter, ...]:
    """Return a filter for each tree of targets that joints hold together.

    Parameters
    ----------
    settings : CaptureSettings or RoomSettings
        Targets and joints.
    parameters : PredictionParameters
        How fast motion may change.
    """
    targets = {body.name: body for body in settings.bodies}
    trees = trees_of(settings.joints)
    return tuple(ChainFilter([settings.joints[joint] for joint in tree], targets, parameters) for tree in trees if tree)
