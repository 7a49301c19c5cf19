"""How far two targets have turned against each other: what a joint between them can be measured from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skelgen.capture.blobs import FoundBody
from skelgen.geometry.rotations import nearest_rotation, vector_from_matrix
from skelgen.model.arrays import Floats

LEAST_TURN = 20.0
"""Degrees; what turns less is seen from one side, and its place is known worse along one direction than others."""

MOST_FRAMES = 400
"""Frames that a motion is told from, evenly spread."""


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
        """Return what to do for a joint of a kind, or of any kind if it is empty; empty if the motion is enough."""
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
    n_frames = len(both)
    if n_frames > MOST_FRAMES:
        both = [both[index] for index in np.linspace(0, n_frames - 1, MOST_FRAMES).round().astype(int)]
    if not both:
        return JointMotion(parent, child, 0, np.zeros((0, 3)))
    turns = [frame[parent].world_from_body[:3, :3].T @ frame[child].world_from_body[:3, :3] for frame in both]
    return JointMotion(parent, child, n_frames, _main_turns(np.array(turns)))


def _main_turns(relative: Floats) -> Floats:
    """Turns [degrees] from the mean attitude about their main axes, the largest first."""
    middle = nearest_rotation(relative.mean(axis=0))
    vectors = np.rad2deg(vector_from_matrix(relative @ middle.T))
    _, axes = np.linalg.eigh(vectors.T @ vectors)
    return np.asarray(vectors @ axes[:, ::-1])
