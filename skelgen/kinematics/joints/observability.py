"""What the motion of a joint does not determine of its position, in plain sentences."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.joint_models import relative_vectors
from skelgen.geometry.rotations import nearest_rotation
from skelgen.kinematics.joints.angles import turns_that_are_seen
from skelgen.model import Joint, Motion, Skeleton
from skelgen.model.arrays import Floats, evenly_spread
from skelgen.model.placed_joints import Place, place_of

DETERMINED_PART = 0.1
"""Of a limb's size: a position with a larger standard deviation is called not determined."""

STILL = np.deg2rad(2.0)
"""rad; a joint with a smaller range does not turn."""

ALIGNED = 0.8
"""Cosine of the angle between directions that a person who moves would take for one."""

AMPLE = np.deg2rad(60.0)
"""rad; from this range on, a limb whose joint is off swings beside its markers by as much as the joint is off."""

ALL_OF_IT = 0.99
"""Of the limb's size: a position with a larger standard deviation is not determined at all."""

MOST_FRAMES = 20_000
"""Frames from which the range is computed, evenly spread: neighbouring ones differ little."""


@dataclass(frozen=True, eq=False)
class RangeOfMotion:
    """Range of motion of a joint, by direction.

    Attributes
    ----------
    directions : ndarray, shape (3, 3)
        Unit axes in the parent as rows, that with the largest range first.
    ranges : ndarray, shape (3,), rad
        From the smallest to the largest rotation about each; of hinges, as those of wheels, all full turns count.
    """

    directions: Floats
    ranges: Floats


def range_of_motion(relative: Floats) -> RangeOfMotion:
    """Return the range of motion of a joint about its three principal directions.

    Parameters
    ----------
    relative : ndarray, shape (n_frames, 3, 3)
        Rotations child against parent.
    """
    if not len(relative):
        return RangeOfMotion(np.eye(3), np.zeros(3))
    turns = _turns(relative)
    _, vectors = np.linalg.eigh(turns.T @ turns)
    directions = vectors[:, ::-1].T
    along = turns @ directions.T
    ranges = np.ptp(along, axis=0)
    order = np.argsort(-ranges, kind="stable")
    return RangeOfMotion(directions[order], ranges[order])


def _with_all_turns(found: RangeOfMotion, joint: Joint, motion: Motion) -> RangeOfMotion:
    """The range of a hinge that turns farther than rotations tell: half a turn from the middle they begin anew."""
    if joint.kind != "hinge":
        return found
    shown = motion.limb_seen[:, [joint.parent, joint.child]].all(axis=1)
    turn = float(np.ptp(turns_that_are_seen(joint, motion)[shown])) if shown.any() else 0.0
    return found if turn <= np.pi else RangeOfMotion(found.directions, np.array([turn, *found.ranges[1:]]))


def turned_about_and_across(relative: Floats, direction: Floats) -> tuple[float, float]:
    """Return by how much [rad] a joint turns about a direction, and at most about an axis across it.

    Turns about the direction leave what lies along it where it is: only those across it tell the place along it.

    Parameters
    ----------
    relative : ndarray, shape (n_frames, 3, 3)
        Rotations child against parent.
    direction : ndarray, shape (3,)
        Unit vector in the parent.
    """
    if not len(relative):
        return 0.0, 0.0
    turns = _turns(relative)
    about = turns @ direction
    across = turns - about[:, np.newaxis] * direction
    return float(np.ptp(about)), float(np.ptp(across @ np.linalg.eigh(across.T @ across)[1][:, -1]))


def _turns(relative: Floats) -> Floats:
    """Rotation vectors [rad] from the mean of rotations, in the parent, shape (n_frames, 3)."""
    middle = middle_of(relative)
    return np.asarray(relative_vectors(*contiguous(middle[np.newaxis], relative)) @ middle.T)


@dataclass(frozen=True, eq=False)
class Observed:
    """What the motion of a joint determines.

    Attributes
    ----------
    motion : RangeOfMotion
        Its range of motion.
    open_direction : ndarray, shape (3,)
        Unit vector in the parent along which its position is known least.
    open_std : float, mm
        Standard deviation of the position along it.
    n_open : int
        In how many directions the position is not determined.
    sentence : str
        What is not determined, in words; empty if all is.
    advice : str
        Which motion would determine it, or which limb needs a second marker; empty if all is determined, or no motion
        of a hinge would.
    """

    motion: RangeOfMotion
    open_direction: Floats
    open_std: float
    n_open: int
    sentence: str
    advice: str = ""

    @property
    def notice(self) -> str:
        """What is not determined, and which motion would determine it; empty if all is."""
        return f"{self.sentence}; {self.advice}" if self.sentence and self.advice else self.sentence


def open_directions(covariance: Floats, size: float, axis: Floats | None = None) -> int:
    """Return in how many directions a joint's place is not determined; the axis of a hinge is the first of them.

    Parameters
    ----------
    covariance : ndarray, shape (3, 3), mm^2
        Of its place.
    size : float, mm
        Of the limb below it.
    axis : ndarray, shape (3,), optional
        Of a hinge, in the frame of the covariance.
    """
    limit = (DETERMINED_PART * size) ** 2
    n_open = int((np.linalg.eigvalsh(covariance) > limit).sum())
    if axis is None or not n_open:
        return n_open
    across = np.eye(3) - np.outer(axis, axis)
    return 1 + int((np.linalg.eigvalsh(across @ covariance @ across) > limit).sum())


def observed_joints(skeleton: Skeleton, motion: Motion) -> tuple[Observed, ...]:
    """Return what the motion determines of every joint, from the frames that show both of its limbs.

    Parameters
    ----------
    skeleton : Skeleton
        With the covariances of its joints, where they were estimated.
    motion : Motion
        How it moves.
    """
    found = []
    for joint in skeleton.joints:
        shown = np.flatnonzero(motion.limb_seen[:, [joint.parent, joint.child]].all(axis=1))
        frames = evenly_spread(shown, MOST_FRAMES)
        parent, child = (motion.world_from_limb[frames, limb, :3, :3] for limb in (joint.parent, joint.child))
        relative = parent.swapaxes(1, 2) @ child
        turned = _with_all_turns(range_of_motion(relative), joint, motion)
        covariance = joint.place_covariance
        values, vectors = np.linalg.eigh(covariance)
        worst = float(np.sqrt(max(values[-1], 0.0)))
        limbs, size = (joint.parent, joint.child), size_of_limb(skeleton, joint.child)
        n_open = open_directions(covariance, size, joint.axis if joint.kind == "hinge" else None)
        way = _way(skeleton, joint, vectors[:, -1])
        place = _undetermined(joint, turned, relative, vectors[:, -1], (worst, size), way)
        place = place if len(shown) else _never_shown(worst, size)
        findings = [*_not_by_motion(joint, turned, n_open, len(shown) > 0), *([place] if place else [])]
        sentence = (
            f"the joint between limb {joint.parent} and {joint.child} {'; it '.join(findings)}" if findings else ""
        )
        advice = ""
        if not joint.is_determined or n_open > (joint.kind == "hinge") or joint.kind == "undetermined":
            markers = skeleton.marker_offsets[skeleton.markers_of(joint.child)]
            middle = (markers - joint.position_in_child).mean(axis=0) if len(markers) else np.zeros(3)
            open_direction = vectors[:, -1] if n_open else None
            advice = _missing_marker(skeleton, limbs) or _better_markers(relative, open_direction)
            advice = advice or _missing_motion(joint.child, turned, open_direction, middle_of(relative) @ middle)
        found.append(Observed(turned, vectors[:, -1], worst, n_open, sentence, advice))
    return tuple(found)


def _not_by_motion(joint: Joint, motion: RangeOfMotion, n_open: int, is_shown: bool) -> Iterator[str]:
    """Say what places a joint where motion alone does not, and that its type is open although frames show its turns.

    Choices are said with their deviations, unless none is stated that large (`n_open` is 0).
    """
    place = place_of(joint)
    if place in {Place.MARKER_SET, Place.USUAL}:
        yield f"is {place.words}: the motion alone does not determine where it is"
    elif place is Place.USUAL_ALONG_AXIS:
        yield f"turns about one axis only: it is {place.words}"
    elif place is not Place.MOTION and not n_open:
        yield f"is left open by the motion: {place.words}"
    if joint.kind == "undetermined" and is_shown:
        turn = motion.ranges[0]
        hidden = f"turns by {np.rad2deg(turn):.0f} deg, but errors of the markers hide its type"
        yield hidden if turn >= AMPLE else "turns too little to tell its type"


def middle_of(relative: Floats) -> Floats:
    """Return the mean of rotations, shape (n_frames, 3, 3); none at all if there are no frames."""
    return nearest_rotation(relative.mean(axis=0)) if len(relative) else np.eye(3)


def _missing_marker(skeleton: Skeleton, limbs: tuple[int, int]) -> str:
    """Say which of two limbs need a second marker: no motion shows how a limb with one marker turns."""
    alone = [f"limb {limb}" for limb in limbs if len(skeleton.markers_of(limb)) == 1]
    return f"one marker only: put a second one on {' and '.join(alone)}" if alone else ""


def _better_markers(relative: Floats, open_direction: Floats | None) -> str:
    """Say that markers are what is missing, where a joint turns far enough to tell its place in the open direction."""
    if open_direction is None or turned_about_and_across(relative, open_direction)[1] < AMPLE:
        return ""
    return "markers nearer to the bone, or more of them, would tell it"


def _missing_motion(limb: int, motion: RangeOfMotion, open_direction: Floats | None, along: Floats) -> str:
    """Say which motion would determine a joint: a turn about an axis across the direction that is open.

    Parameters
    ----------
    limb : int
        The child.
    motion : RangeOfMotion
        Of the joint.
    open_direction : ndarray, shape (3,), or None
        Unit vector in the parent; None where only the type is open.
    along : ndarray, shape (3,), mm
        From the joint to the middle of the child's markers, in the parent.
    """
    if motion.ranges[0] < STILL:
        return f"bend and turn limb {limb}"
    across = np.ones(3, dtype=np.bool_)
    if open_direction is not None:
        across = np.abs(motion.directions @ open_direction) < ALIGNED
    axis = motion.directions[np.flatnonzero(across)[-1] if across.any() else -1]
    is_long = abs(axis @ along) > ALIGNED * np.linalg.norm(along)
    return f"turn limb {limb} about its long axis" if is_long else f"swing limb {limb} in another plane"


def size_of_limb(skeleton: Skeleton, limb: int) -> float:
    """Return the root mean square distance [mm] of a limb's markers from its joint; of all markers where it has none.

    Parameters
    ----------
    skeleton : Skeleton
        The skeleton.
    limb : int
        The limb.
    """
    own = skeleton.markers_of(limb)
    offsets = skeleton.marker_offsets[own if len(own) else skeleton.limb_of_marker >= 0]
    return float(np.sqrt((offsets**2).sum(axis=1).mean())) if len(offsets) else 0.0


def _never_shown(std: float, size: float) -> str:
    """Say that no frame shows how a joint turns, and how well its place is known if that is not determined."""
    place = f": its place is not determined, +-{std:.0f} mm" if std > DETERMINED_PART * size else ""
    return f"has no frame that shows how it turns{place}"


def _way(skeleton: Skeleton, joint: Joint, direction: Floats) -> str:
    """Say where a direction in the parent of a joint points, seen from the joint."""
    markers = skeleton.marker_offsets[skeleton.markers_of(joint.parent)]
    along = markers.mean(axis=0) - joint.position_in_parent if len(markers) else np.zeros(3)
    inward, length = abs(direction @ along), np.linalg.norm(along)
    if inward > ALIGNED * length:
        return f"towards the middle of limb {joint.parent}"
    return f"{'sideways of' if inward < np.sqrt(1 - ALIGNED**2) * length else 'obliquely to'} limb {joint.parent}"


def _undetermined(
    joint: Joint, motion: RangeOfMotion, relative: Floats, direction: Floats, deviation: tuple[float, float], way: str
) -> str:
    """Say which direction of a joint's position is not determined, after the joint's name; empty if all are.

    The deviation [mm] along that direction stands beside the size of the limb [mm], which it does not exceed.
    """
    std, size = deviation
    if std <= DETERMINED_PART * size:
        return ""
    at_all = std >= ALL_OF_IT * size
    spread = f" (anywhere within the limb's size, +-{size:.0f} mm)" if at_all else f", +-{std:.0f} mm"
    if motion.ranges[0] < STILL:
        return f"does not turn: its place is not determined{spread}"
    if joint.kind == "hinge" and abs(joint.free_axis() @ direction) > ALIGNED:
        return f"turns about one axis only: its place along that axis is not determined{spread}"
    about, across = np.rad2deg(turned_about_and_across(relative, direction))
    known = f"is not determined{spread}" if at_all else f"is known to +-{std:.0f} mm only"
    if np.deg2rad(across) >= AMPLE:
        return f"turns by {across:.0f} deg, but its place {way} {known}"
    if about > across:
        ranges = f"by {about:.0f} deg about one axis, by {across:.0f} deg about those across it"
        return f"turns {ranges}: its place along that axis {known}"
    return f"turns too little ({across:.0f} deg) to tell its place {way}: that {known}"
