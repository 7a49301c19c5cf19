"""A chain with its poses in some frames and the markers that were measured there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from skelgen._kernels.posing import FREEDOMS, PARENT, START, ChainTable
from skelgen.kinematics.chain.articulation import FREEDOMS as FREEDOMS_OF_TYPE
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, residuals, seen_weights
from skelgen.model.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class ObservedChain:
    """A chain in some frames, with what was measured there.

    Attributes
    ----------
    chain : Chain
        The limbs.
    articulation : Articulation
        What the joints allow.
    poses : ChainPoses
        Poses in the frames.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    weights : ndarray, shape (n_frames, n_markers)
        Of the squared distances, 0 where unseen.
    """

    chain: Chain
    articulation: Articulation
    poses: ChainPoses
    positions: Floats
    weights: Floats

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def n_constants(self) -> int:
        """Number of constants: marker offsets, joints 1 .. n_limbs - 1, and those of the joints' axes."""
        return 3 * (self.chain.n_markers + self.chain.n_limbs - 1) + self.articulation.n_constants

    @property
    def residuals(self) -> Floats:
        """Measured minus predicted markers [mm], 0 where unseen, shape (n_frames, n_markers, 3)."""
        return residuals(self.chain, self.poses, self.positions)

    @property
    def squares(self) -> float:
        """Weighted sum of the squared residuals [mm^2]."""
        error = self.residuals
        return float(np.einsum("fmi,fmi,fm->", error, error, self.weights))

    @property
    def table(self) -> ChainTable:
        """Chain and joints as kernels take them."""
        return chain_table(self.chain, self.articulation)

    def at(self, frames: slice | Ints | Bools) -> ObservedChain:
        """Return some of the frames."""
        observations = self.poses[frames], self.positions[frames], self.weights[frames]
        return ObservedChain(self.chain, self.articulation, *observations)

    def in_parts(self, together: int) -> Iterator[ObservedChain]:
        """Return all frames, so many at a time."""
        return (self.at(slice(first, first + together)) for first in range(0, self.n_frames, together))

    def stepped(self, offsets: Floats, joints: Floats, tilts: Floats) -> Self:
        """Return the chain after a step of its constants; the limbs turn as the tilted axes demand.

        Parameters
        ----------
        offsets : ndarray, 3 n_markers numbers, mm
            Steps of the markers in their limbs.
        joints : ndarray, 3 (n_limbs - 1) numbers, mm
            Steps of joints 1 .. n_limbs - 1 in their parents.
        tilts : ndarray, shape (n_axis_constants,), rad
            Steps of the constants of the axes, see `Articulation.tilted`.
        """
        places = self.chain.joints.copy()
        places[1:] += joints.reshape(-1, 3)
        chain = self.chain.moved(places, self.chain.offsets + offsets.reshape(-1, 3))
        articulation, rotations = self.articulation.tilted(chain.parents, self.poses.rotations, tilts)
        return replace(self, chain=chain, articulation=articulation, poses=ChainPoses(self.poses.root, rotations))


def observed(
    chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, weights: Floats | None = None
) -> ObservedChain:
    """Return a chain with what was measured.

    Parameters
    ----------
    chain, articulation, poses : Chain, Articulation and ChainPoses
        The limbs, what their joints allow, and their poses.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    weights : ndarray, shape (n_frames, n_markers), optional
        Of the squared distances; 1 if not given.
    """
    return ObservedChain(chain, articulation, poses, positions, seen_weights(positions, weights))


def chain_table(chain: Chain, articulation: Articulation) -> ChainTable:
    """Return a chain as the table that kernels take: copies in the order of memory that they were compiled for.

    Parameters
    ----------
    chain : Chain
        The limbs.
    articulation : Articulation
        What their joints allow.
    """
    markers = np.argsort(chain.limb_of_marker, kind="stable").astype(np.intp)
    limbs = np.zeros((chain.n_limbs + 1, 3), dtype=np.intp)
    limbs[:-1, PARENT] = chain.parents
    limbs[:-1, FREEDOMS] = [FREEDOMS_OF_TYPE[kind] for kind in articulation.kinds]
    limbs[:, START] = np.searchsorted(chain.limb_of_marker[markers], np.arange(chain.n_limbs + 1))
    joints = np.concatenate([articulation.in_parent, articulation.in_child, chain.joints], axis=1)
    return ChainTable(limbs, writable(joints), markers, writable(chain.offsets[markers]))


def rows(values: Floats, length: int) -> Floats:
    """Return values of all frames one below the other, in rows of some length: a copy that may be written to."""
    return writable(values).reshape(-1, length)


def writable(values: Floats) -> Floats:
    """Return a contiguous copy that may be written to."""
    return np.array(values, dtype=np.float64, order="C")
