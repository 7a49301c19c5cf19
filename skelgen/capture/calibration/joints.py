"""Joints between targets, measured from their motion: each by itself, then the whole chain together (Gaschler 2011, 5).

Balls and hinges are fitted to the relative poses of two targets, weighted with the covariance of every pose; then all
joints of a tree together. Which targets are joined, and how, is found if the user does not say so.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from skelgen.capture.calibration.verdict import GOOD, REPEAT, USABLE, Row, Verdict, as_sentence, hundredths
from skelgen.capture.calibration.whole_chain import fit_whole_chain
from skelgen.capture.target_joints import find_angles
from skelgen.capture.values import FoundBody, JointRequest
from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector, nearest_rotation, vector_from_matrix
from skelgen.kinematics import JointFit, TypeChoice, find_hierarchy
from skelgen.kinematics.joints.fit import choose_type
from skelgen.kinematics.joints.relative_poses import relative_poses
from skelgen.model import Poses
from skelgen.model.arrays import Floats
from skelgen.model.rig import JOINT_TYPES, TargetJoint
from skelgen.model.topology import joint_children
from skelgen.progress import counted

MIN_FRAMES = 20
"""Frames that show all targets of a chain at once, below which its joints are not fitted together."""

MAX_FRAMES = 400
"""Frames that a chain is fitted to, and that a motion is found from, evenly spread."""

GOOD_PLACE, USABLE_PLACE = 1.0, 5.0
"""Standard deviations [mm] of a joint's place: 1 mm, 0.2 m from a target's middle, turns the angle by 0.3 degrees."""

DOUBTFUL_NOISE = 2.0
"""Residuals of a joint in stated deviations above which it has play, or its targets are not stiff."""

ANY_RATE = 30.0
"""Hz, where the rate is unknown: fits with covariances do not depend on it."""

_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class JointCalibration:
    """Calibrated joints.

    Attributes
    ----------
    joints : tuple of TargetJoint
        With standard deviations of place and axis.
    fits : tuple of JointFit
        Each joint by itself, in the same order.
    noise : float
        Root mean square residual of the whole chain in stated standard deviations; NaN if it was not fitted together.
    motions : tuple of JointMotion
        How far each joint was moved.
    notices : tuple of str
        What the user should know.
    """

    joints: tuple[TargetJoint, ...]
    fits: tuple[JointFit, ...]
    noise: float
    motions: tuple[JointMotion, ...]
    notices: tuple[str, ...]

    @property
    def verdict(self) -> Verdict:
        """What it is worth, in words."""
        worst = max((float(joint.std.max()) for joint in self.joints), default=np.inf)
        grade = GOOD if worst <= GOOD_PLACE else USABLE if worst <= USABLE_PLACE else REPEAT
        if grade == GOOD and self.notices:
            grade = USABLE
        first = f"{grade.capitalize()}: no joint was found."
        if self.joints:
            sentences = [
                f"{joint.name} is a {joint.kind}, turned by {motion.spans[0]:.0f} degrees, its place known to "
                f"{joint.std.max():.2f} mm"
                for joint, motion in zip(self.joints, self.motions, strict=True)
            ]
            first = f"{grade.capitalize()}: {'; '.join(sentences)}."
        return Verdict(grade, (first, *map(as_sentence, self.notices)))


def calibrate_joints(
    frames: Sequence[Sequence[FoundBody]],
    bodies: Sequence[str],
    requests: Sequence[JointRequest] = (),
    rate: float | None = None,
    use_frames: int | Sequence[int] | None = None,
) -> JointCalibration:
    """Calibrate the joints between targets.

    Parameters
    ----------
    frames : sequence of sequence of FoundBody
        The targets that were found in each frame, while all joints were moved as far as they go. The first frame that
        shows both targets of a joint is where its angles are zero.
    bodies : sequence of str
        Names of all targets.
    requests : sequence of JointRequest
        The joints; found if there are none.
    rate : float, Hz, optional
        Frames a second.
    use_frames : int or sequence of int, optional
        So many frames, evenly spaced, or those of these indices (Gaschler 2011, 7.1.4); all if not given.

    Raises
    ------
    InputError
        If there is no frame of an index, a request names a target that is not there, two targets are not seen
        together, or their motion does not tell the type of a joint that a request leaves open.
    """
    frames = frames if use_frames is None else _chosen(frames, use_frames)
    world, own = _pose_tables(frames, bodies)
    poses = Poses(world, tuple(bodies), rate or ANY_RATE, "capture")
    notices: list[str] = []
    named = [(request, _fit_requested(poses, own, request)) for request in requests]
    found = named or list(_fit_hierarchy(poses, own, notices))
    models = [_model(request, choice.fit) for request, choice in found]
    fits = tuple(choice.fit for _, choice in found)
    fitted, noise = _fit_chains(models, fits, frames, notices)
    motions = tuple(joint_motion(frames, joint.parent, joint.child) for joint in fitted)
    notices += _joint_notices(fitted, fits, motions)
    joints = tuple(_with_zero_angles(joint, frames) for joint in fitted)
    return JointCalibration(joints, fits, noise, motions, tuple(notices))


def _chosen(frames: Sequence[_T], use: int | Sequence[int]) -> Sequence[_T]:
    """A number of frames, evenly spaced, or the frames at some indices."""
    if isinstance(use, int):
        if use < 2:
            raise InputError(f"{counted(use, 'frame')} cannot show a motion; use 2 or more, {MIN_FRAMES} are better")
        return thinned(frames, use)
    missing = [index for index in use if not 0 <= index < len(frames)]
    if missing:
        raise InputError(f"there is no frame {missing[0]}: {len(frames)} were captured, the first is 0")
    return [frames[index] for index in use]


def _joint_notices(
    joints: Sequence[TargetJoint], fits: Sequence[JointFit], motions: Sequence[JointMotion]
) -> list[str]:
    """What speaks against joints: too little motion, or more play than the noise explains."""
    advice = [motion.advice(joint.kind) for joint, motion in zip(joints, motions, strict=True)]
    play = [
        f"joint {joint.name!r} is off by {fit.noise:.1f} times what the noise says; it has play, or a target bends"
        for joint, fit in zip(joints, fits, strict=True)
        if fit.noise > DOUBTFUL_NOISE
    ]
    return [*filter(None, advice), *play]


def _pose_tables(frames: Sequence[Sequence[FoundBody]], bodies: Sequence[str]) -> tuple[Floats, Floats]:
    """Poses, shape (n_frames, n_bodies, 4, 4), and covariances of shift and turn in the bodies' own frames."""
    world = np.full((len(frames), len(bodies), 4, 4), np.nan)
    own = np.full((len(frames), len(bodies), 6, 6), np.nan)
    for number, frame in enumerate(frames):
        for body in frame:
            place = number, list(bodies).index(body.name)
            world[place] = body.world_from_body
            turn = np.zeros((6, 6))  # takes (turn, shift) in the world to (shift, turn) in the body
            turn[:3, 3:] = turn[3:, :3] = body.world_from_body[:3, :3].T
            own[place] = turn @ body.covariance @ turn.T
    return world, own


def _fit_requested(poses: Poses, own: Floats, request: JointRequest) -> TypeChoice:
    start = None if request.start is None else np.ravel(request.start)
    measured = relative_poses(poses, request.parent, request.child, own)
    choice = choose_type(measured, request.kind or None, start=start)
    if request.kind:
        return choice
    if choice.kind == "universal":
        return choose_type(measured, "ball", start=start)
    if choice.kind not in JOINT_TYPES:
        raise InputError(f"joint {request.name!r} is {choice.sentence}; move it further, or state its type")
    return choice


def _fit_hierarchy(poses: Poses, own: Floats, notices: list[str]) -> Iterable[tuple[JointRequest, TypeChoice]]:
    """Joints of the hierarchy that the motion shows, named after their targets, each after that of its parent."""
    hierarchy = find_hierarchy(poses, covariances=own)
    for child in joint_children(hierarchy.parents).tolist():
        if child not in hierarchy.joints:
            continue
        parent = poses.names[hierarchy.parents[child]]
        request = JointRequest(f"{parent}-{poses.names[child]}", parent, poses.names[child])
        try:
            yield request, _fit_requested(poses, own, request)
        except InputError as error:
            notices.append(f"left out: {error}")


def _model(request: JointRequest, fit: JointFit) -> TargetJoint:
    tilts = [np.sqrt(max(np.trace(fit.axis_covariance[at : at + 3, at : at + 3]) / 2, 0.0)) for at in (0, 3)]
    frames = fit.parent_from_joint, fit.child_from_joint
    return TargetJoint(request.name, fit.kind, request.parent, request.child, *frames, fit.std, np.array(tilts))


def _fit_chains(
    models: Sequence[TargetJoint], fits: Sequence[JointFit], frames: Sequence[Sequence[FoundBody]], notices: list[str]
) -> tuple[list[TargetJoint], float]:
    """The joints of each tree fitted together where there are several, and the noise of the last."""
    fitted, noise = list(models), float("nan")
    for tree in trees_of(models):
        if len(tree) < 2:
            continue
        joints = [models[index] for index in tree]
        names = list(dict.fromkeys(name for joint in joints for name in (joint.parent, joint.child)))
        poses, covariances = _poses_in_common(frames, names)
        if len(poses[names[0]]) < MIN_FRAMES:
            notices.append(
                f"{', '.join(names)} are seen together in {counted(len(poses[names[0]]), 'frame')}; below "
                f"{MIN_FRAMES} their joints are fitted one by one"
            )
            continue
        chain = fit_whole_chain(joints, poses, covariances)
        noise = chain.noise
        for index, joint in zip(tree, chain.joints, strict=True):
            lasting = np.sqrt(len(fits[index].frames) / fits[index].n_effective)
            fitted[index] = replace(joint, std=lasting * joint.std, axis_std=lasting * joint.axis_std)
    return fitted, noise


def _with_zero_angles(joint: TargetJoint, frames: Sequence[Sequence[FoundBody]]) -> TargetJoint:
    """The joint with all angles zero in the first frame that shows both targets, as in Gaschler (2011, 7.1.4)."""
    for frame in frames:
        bodies = {body.name: body for body in frame}
        first = find_angles(joint, bodies)
        if first is not None:
            vector = first.angles if joint.kind == "ball" else np.append([0.0, 0.0], first.angles)
            turned = joint.child_from_joint.copy()
            turned[:3, :3] = turned[:3, :3] @ matrix_from_vector(vector).T
            return replace(joint, child_from_joint=turned)
    return joint


def trees_of(models: Sequence[TargetJoint]) -> list[list[int]]:
    """Return the joints that hang together, each after the joint above it; joints that close a loop are left alone."""
    left, trees = list(range(len(models))), []
    children = {model.child for model in models}
    while left:
        first = next((index for index in left if models[index].parent not in children), left[0])
        tree, known = [], {models[first].parent}
        grown = True
        while grown:
            grown = False
            for index in left:
                if models[index].parent in known and models[index].child not in known:
                    tree.append(index)
                    known.add(models[index].child)
                    grown = True
            left = [index for index in left if index not in tree]
        if not tree:
            left = left[1:]
        trees.append(tree)
    return trees


def _poses_in_common(
    frames: Sequence[Sequence[FoundBody]], names: Sequence[str]
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Poses and covariances of some targets in frames that show them all."""
    by_name = [{body.name: body for body in frame} for frame in frames]
    shown = thinned([frame for frame in by_name if all(name in frame for name in names)], MAX_FRAMES)
    poses = {name: np.array([frame[name].world_from_body for frame in shown]).reshape(-1, 4, 4) for name in names}
    covariances = {name: np.array([frame[name].covariance for frame in shown]).reshape(-1, 6, 6) for name in names}
    return poses, covariances


def thinned(items: Sequence[_T], most: int) -> Sequence[_T]:
    """Return at most so many of some things, evenly spread over them, the first and the last among them.

    Parameters
    ----------
    items : sequence
        All, in their order.
    most : int
        How many may be left.
    """
    if len(items) <= most:
        return items
    return [items[index] for index in np.linspace(0, len(items) - 1, most).round().astype(np.intp).tolist()]


LEAST_TURN = 20.0
"""Degrees; a joint that turns less is seen from one side, and its place is less certain along one direction."""


@dataclass(frozen=True, eq=False)
class JointMotion:
    """The motion of one target in another.

    Attributes
    ----------
    parent, child : str
        Names of the targets.
    n_frames : int
        Frames that show both.
    turns : ndarray, shape (n, 3), degrees
        Turns from the mean attitude about three perpendicular axes, those about which most is turned first.
    """

    parent: str
    child: str
    n_frames: int
    turns: Floats

    @property
    def spans(self) -> tuple[float, float, float]:
        """Degrees from one end to the other about each of the three axes."""
        if not len(self.turns):
            return 0.0, 0.0, 0.0
        first, second, third = np.ptp(self.turns, axis=0).tolist()
        return first, second, third

    def advice(self, kind: str = "") -> str:
        """Return what to do for a joint of a kind, of any kind if that is empty; empty if the motion is enough."""
        if not self.n_frames:
            return f"{self.parent} and {self.child} were not seen together yet; hold both before the cameras"
        if self.spans[0] < LEAST_TURN:
            return f"{self.child} turned by {self.spans[0]:.0f} degrees in {self.parent}; move the joint further"
        if kind == "ball" and self.spans[1] < LEAST_TURN:
            return f"{self.child} turned in {self.parent} about one axis only; a ball joint is measured about all axes"
        return ""


def joint_motion(frames: Sequence[Sequence[FoundBody]], parent: str, child: str) -> JointMotion:
    """Return how a target moved in another one.

    Parameters
    ----------
    frames : sequence of sequence of FoundBody
        The targets that were found in each frame.
    parent, child : str
        Names of two targets.
    """
    found: list[Mapping[str, FoundBody]] = [{body.name: body for body in frame} for frame in frames]
    both = [frame for frame in found if parent in frame and child in frame]
    if not both:
        return JointMotion(parent, child, 0, np.zeros((0, 3)))
    used = thinned(both, MAX_FRAMES)
    turns = np.array([one[parent].world_from_body[:3, :3].T @ one[child].world_from_body[:3, :3] for one in used])
    vectors = np.rad2deg(vector_from_matrix(turns @ nearest_rotation(turns.mean(axis=0)).T))
    _, axes = np.linalg.eigh(vectors.T @ vectors)
    return JointMotion(parent, child, len(both), vectors @ axes[:, ::-1])


def joint_rows(done: JointCalibration) -> list[Row]:
    """Return where joints are in both targets [mm], by the titles of columns."""
    return [
        {
            "joint": joint.name,
            "kind": joint.kind,
            "parent": joint.parent,
            "child": joint.child,
            "in parent [mm]": " ".join(place_texts(joint)[0]),
            "in child [mm]": " ".join(place_texts(joint)[1]),
            "gap [mm]": round(fit.gap, 2),
            "frames": len(fit.frames),
        }
        for joint, fit in zip(done.joints, done.fits, strict=True)
    ]


def place_texts(joint: TargetJoint) -> tuple[list[str], list[str]]:
    """Return x, y and z [mm] of a joint in its parent, then in its child."""
    in_parent, in_child = (
        [hundredths(*pair) for pair in zip(place.tolist(), std.tolist(), strict=True)]
        for place, std in zip((joint.parent_from_joint[:3, 3], joint.child_from_joint[:3, 3]), joint.std, strict=True)
    )
    return in_parent, in_child
