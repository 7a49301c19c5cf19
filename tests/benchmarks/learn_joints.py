"""Learn where joints lie: ``python tests/benchmarks/learn_joints.py [n_people]``.

For skelgen/kinematics/calibration/joint_places.py. True joints of real people (``../shared/data/bodies`` beside the
project, those with joints) and of simulated people in all marker sets and motions, with limbs and tree given, seen from
the markers of their limbs, in units of the distance between the middles of both limbs' markers. Real and simulated
people weigh alike, and so does everybody among them. So is how far inward the joints of arms and legs lie, for
skelgen/kinematics/calibration/mirrored_halves.py. Printed are the constants, and for each real person how well those
learned from all others describe the joints: mean surprise of a coordinate [nats], beside that with the constants of
skelgen. Deviations are median absolute ones times 1.48.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from people import USUAL_PLACE, load
from shown import show

from skelgen.benchmark.people import simulated_person
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.kinematics.calibration import joint_places as known_places
from skelgen.kinematics.calibration.joint_places import JointPlace, joint_places
from skelgen.kinematics.calibration.mirrored_halves import INWARD, InwardPlace, inward_places, twins
from skelgen.kinematics.chain.chain import ChainPoses, ObservedChain
from skelgen.kinematics.inverse.skeleton_tree import SkeletonTree
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.stages.joints import JointConstraints, find_joints
from skelgen.stages.names import segments_by_shape
from skelgen.stages.skeleton import fit_skeleton

N_PEOPLE = 50  # simulated
LOOKED_AT = 100  # frames
FAR = 0.99  # of the joints are in reach


class Known(NamedTuple):
    """A take, the limb of each marker, the parent of each limb, and the joint to it, NaN for a root [mm]."""

    name: str
    take: Trajectories
    limb_of_marker: Ints
    parents: Ints
    joints: Floats


@dataclass(frozen=True, eq=False)
class Seen:
    """A true joint as its limbs' markers see it, in units of D; NaN where a question does not arise.

    Attributes
    ----------
    name : str
        Of the person.
    share : float
        Part of the way from the parent's nearest marker to the child's nearest one that it lies along.
    off : ndarray, shape (3,)
        From the expected place, along the axes of the limbs' turns, the largest first.
    aside : float
        From the line between both nearest markers.
    to_middles : ndarray, shape (2,)
        From the middles of both limbs' markers, along the one axis.
    to_next : ndarray, shape (2,)
        From the next joint above and below in a row of limbs, along the one axis.
    segment : str
        What a person's limb below is; empty where nobody knows.
    inward : float
        Inward of the expected place.
    """

    name: str
    share: float
    off: Floats
    aside: float
    to_middles: Floats
    to_next: Floats
    segment: str
    inward: float

    @property
    def along(self) -> float:
        """Off along the one axis, NaN if there are several."""
        return float(self.off[0]) if np.isfinite(self.to_middles).any() else np.nan

    @property
    def across(self) -> Floats:
        """Off along all axes but the one."""
        return self.off[1:] if np.isfinite(self.to_middles).any() else self.off


class Constants(NamedTuple):
    """What stands in joint_places.py; `along` is not in units of `near`."""

    towards: float
    near: float
    along: float
    off_middle: float
    above: float
    below: float


def main() -> None:
    """Print how well joints of each real person are told by all others, then the constants."""
    seen = [one for known in people() for one in seen_joints(known)]
    rows = []
    for name in sorted({one.name for one in seen} - {"simulated"}):
        own, others = ([one for one in seen if (one.name == name) == is_own] for is_own in (True, False))
        both = learned(others), in_use()
        rows.append((name, str(len(own)), *(f"{surprise(own, constants):.3f}" for constants in both)))
    show("Surprise of true joints [nats]", ("person", "joints", "learned from all others", "in use"), rows)
    show_inward(seen)
    for name in ("simulated", *sorted({one.name for one in seen} - {"simulated"}), ""):
        chosen = [one for one in seen if not name or one.name == name]
        print(
            f"{name or 'all':10}", *(f"{key} {value:.3f}" for key, value in learned(chosen)._asdict().items()), end=""
        )
        print(f"  aside: {FAR} below {np.quantile([one.aside for one in chosen], FAR):.2f}, {len(chosen)} joints")


def show_inward(seen: Sequence[Seen]) -> None:
    """Print how far inward joints of each segment lie: median and deviation, of simulated people and of all others."""
    rows = []
    for segment in sorted({one.segment for one in seen} - {""}):
        own = [one for one in seen if one.segment == segment]
        parts = [[one.inward for one in own if (one.name == "simulated") == is_made] for is_made in (True, False)]
        cells = []
        for part in parts:
            median = np.median(part) if part else np.nan
            spread = SIGMA_OF_MEDIAN * np.median(np.abs(part - median)) if part else np.nan
            cells += [str(len(part)), f"{median:.3f}", f"{spread:.3f}"]
        in_use = INWARD.get(segment, (np.nan, np.nan))
        rows.append((segment, *cells, *(f"{one:.2f}" for one in in_use)))
    columns = ("segment", "simulated", "inward [D]", "deviation", "real", "inward [D]", "deviation", "in use", "")
    show("Joints inward of where those of any body are expected", columns, rows)


def in_use() -> Constants:
    """What skelgen uses."""
    near = known_places.NEAR_MARKER
    return Constants(
        known_places.TOWARDS_CHILD,
        near,
        near * known_places.ALONG,
        known_places.OFF_MIDDLE,
        known_places.TO_JOINT_ABOVE,
        known_places.TO_JOINT_BELOW,
    )


def people() -> Iterator[Known]:
    """Real people with joints, and simulated ones."""
    for path in sorted(USUAL_PLACE.glob("*.truth.npz")):
        person = load(USUAL_PLACE, path.name.removesuffix(".truth.npz"))
        if person.joints is not None:
            yield carried(path.name.split(".")[0], person.take, person.body, person.parents, person.joints)
    for index in range(int(sys.argv[1]) if len(sys.argv) > 1 else N_PEOPLE):
        made = simulated_person(index)[0]
        truth = made.truth
        joints = np.full((made.take.n_frames, len(truth.limb_names), 3), np.nan)
        joints[:, truth.edges[:, 1]] = truth.joint_positions
        assert isinstance(made.take, Trajectories)
        yield carried("simulated", made.take, truth.limb_of_marker, truth.parents, joints)


def carried(name: str, take: Trajectories, body: Ints, parents: Ints, joints: Floats) -> Known:
    """Bodies with markers alone; what hangs on one without hangs on the next above."""
    bodies, limb_of_marker = np.unique(body, return_inverse=True)
    place = {int(one): limb for limb, one in enumerate(bodies)}
    above = []
    for one in bodies.tolist():
        parent = int(parents[one])
        while parent >= 0 and parent not in place:
            parent = int(parents[parent])
        above.append(place.get(parent, -1))
    return Known(name, take, limb_of_marker, np.array(above), joints[:, bodies])


def seen_joints(known: Known) -> Iterator[Seen]:
    """Every joint of a person whose place is known."""
    limbs = Limbs(known.limb_of_marker, np.zeros((len(known.limb_of_marker),) * 2))
    topology = find_joints(known.take, limbs, constraints=JointConstraints(parents=known.parents))
    skeleton, motion = fit_skeleton(known.take, limbs, topology)
    frames = spread_frames(known.take.n_frames, LOOKED_AT)
    for root in np.flatnonzero(known.parents < 0).tolist():
        tree = SkeletonTree(skeleton, root, None)
        poses = motion.world_from_limb[frames][:, tree.limbs]
        chain_poses = ChainPoses(poses[:, 0, :3, 3], poses[:, :, :3, :3])
        fit = tree.observed(chain_poses, known.take.positions[frames][:, tree.markers])
        joints = known.joints[frames][:, tree.limbs]
        every = joint_places(fit)
        inward = inward_places(fit, every, twins(fit.chain, every), segments_by_shape(fit))
        inner = {one.place.limb: one for one in inward}
        for place in every:
            if np.isfinite(joints[:, place.limb]).any():
                yield seen_joint(known.name, place, fit, joints, inner.get(place.limb))


def seen_joint(name: str, place: JointPlace, fit: ObservedChain, joints: Floats, inner: InwardPlace | None) -> Seen:
    """One joint, in the median over frames."""
    chain, markers, limb = fit.chain, fit.poses.markers(fit.chain), place.limb
    parent, joint, size = int(chain.parents[limb]), joints[:, limb], place.distance
    axes = np.einsum("fij,aj->fai", fit.poses.rotations[:, parent], place.axes_in_parent)
    first, last = (markers[:, one] for one in place.nearest)
    way, off = last - first, joint - first
    part = (way * off).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1.0)
    aside = np.linalg.norm(off - np.clip(part, 0, 1)[:, np.newaxis] * way, axis=1)
    in_axes = (axes @ (off - known_places.TOWARDS_CHILD * way)[:, :, np.newaxis])[:, :, 0]

    def along_axis(apart: Floats) -> float:
        return float(np.nanmedian((apart * axes[:, 0]).sum(axis=1))) / size

    middles, ends = np.full(2, np.nan), np.full(2, np.nan)
    if place.has_one_axis:
        middles[:] = [
            along_axis(joint - markers[:, chain.limb_of_marker == one].mean(axis=1)) for one in (parent, limb)
        ]
        is_in_row = parent and (chain.parents == parent).sum() == 1 and place.turns[0] > known_places.ROW_TURN
        below = np.flatnonzero(chain.parents == limb)
        if is_in_row:
            ends[0] = along_axis(joint - joints[:, parent])
        if is_in_row and len(below) == 1:
            ends[1] = along_axis(joints[:, below[0]] - joint)
    median = np.nanmedian(in_axes, axis=0) / size
    segment, inward = "", np.nan
    if inner is not None:
        there = fit.poses.rotations[:, parent] @ inner.in_parent
        segment = inner.segment
        inward = float(np.nanmedian(((off - known_places.TOWARDS_CHILD * way) * there).sum(axis=1))) / inner.size
    return Seen(
        name, float(np.nanmedian(part)), median, float(np.nanmedian(aside)) / size, middles, ends, segment, inward
    )


def learned(seen: Sequence[Seen]) -> Constants:
    """Constants of these joints."""
    n_real = Counter(one.name for one in seen)
    kinds = len(set(n_real) - {"simulated"})
    weight = np.array([1 / n_real[one.name] / (1 if one.name == "simulated" else max(kinds, 1)) for one in seen])

    def spread(rows: Sequence[Floats | float]) -> float:
        values = np.concatenate([np.atleast_1d(np.abs(row)) for row in rows])
        each = np.repeat(weight, [np.size(row) for row in rows])
        return SIGMA_OF_MEDIAN * middle(values, each)

    return Constants(
        middle(np.array([one.share for one in seen]), weight),
        spread([one.across for one in seen]),
        spread([one.along for one in seen]),
        spread([one.to_middles for one in seen]),
        spread([one.to_next[0] for one in seen]),
        spread([one.to_next[1] for one in seen]),
    )


def middle(values: Floats, weight: Floats) -> float:
    """Weighted median of the values that are known; NaN without any."""
    known = np.isfinite(values)
    order = np.argsort(values[known])
    total = np.cumsum(weight[known][order])
    return float(values[known][order][np.searchsorted(total, total[-1] / 2)]) if known.any() else np.nan


def surprise(seen: Sequence[Seen], constants: Constants) -> float:
    """Mean of what joints tell beyond what was expected, with Cauchy's tails beyond three deviations [nats]."""
    found = []
    for one in seen:
        for values, deviation in (
            (one.across, constants.near),
            (one.along, constants.along),
            (one.to_middles, constants.off_middle),
            (one.to_next[0], constants.above),
            (one.to_next[1], constants.below),
        ):
            in_units = np.atleast_1d(values) / deviation
            tail = known_places.TAIL
            told = tail**2 / 2 * np.log1p((in_units / tail) ** 2) + np.log(deviation) + np.log(2 * np.pi) / 2
            found.append(told[np.isfinite(told)])
    return float(np.concatenate(found).mean())


if __name__ == "__main__":
    main()
