"""Live use of a known skeleton: one frame after the other, each posed from what it shows and from the frame before."""

from __future__ import annotations

import numpy as np

from skelgen.errors import InputError
from skelgen.kinematics.chain import ChainPoses
from skelgen.kinematics.closed_form import Outward
from skelgen.kinematics.inverse import Posture, check_method, posture, solve_tree
from skelgen.kinematics.known_tree import KnownTree
from skelgen.kinematics.pose_covariances import pose_covariances
from skelgen.model import Skeleton
from skelgen.model.arrays import Floats, check_floats


class LiveSkeleton:
    """Poses a known skeleton frame by frame.

    Limbs that a frame does not show keep their turn against the parent from the frame before; trees that it does not
    show at all stay where they were. Both are marked, and their deviations say so.

    Parameters
    ----------
    skeleton : Skeleton
        With its kinds of joints and axes, as a project has it.
    method : str
        ``root-outward``, the closed form, which is quick; or ``whole-chain``, which is nearer to the truth.
    noise : float, mm, optional
        Standard deviation of a marker's coordinate; what the skeleton's markers showed, if not given.

    Raises
    ------
    InputError
        If there is no such method.

    Examples
    --------
    >>> live = LiveSkeleton(project.skeleton)  # doctest: +SKIP
    >>> for frame in camera:  # doctest: +SKIP
    ...     posture = live.see(frame)
    ...     print(posture.angles[3][0], posture.angle_std[3][0])
    """

    def __init__(self, skeleton: Skeleton, *, method: str = "root-outward", noise: float | None = None) -> None:
        check_method(method)
        self._skeleton, self._method = skeleton, method
        self._trees = [KnownTree(skeleton, int(root), noise) for root in skeleton.roots]
        self._before: list[ChainPoses | None] = [None] * len(self._trees)

    def see(self, positions: Floats) -> Posture:
        """Pose the skeleton in the next frame.

        Parameters
        ----------
        positions : ndarray, shape (n_markers, 3), mm
            Measured markers, NaN where unseen.

        Returns
        -------
        Posture
            Of one frame.

        Raises
        ------
        InputError
            If the markers are not those of the skeleton, or a tree has never been seen.
        """
        positions = check_floats(positions, (len(self._skeleton.limb_of_marker), 3), "positions")
        found = [self._posed(index, positions[np.newaxis, tree.markers]) for index, tree in enumerate(self._trees)]
        self._before = [one.poses for one in found]
        return posture(self._skeleton, self._trees, found)

    def _posed(self, index: int, positions: Floats) -> Outward:
        tree, before = self._trees[index], self._before[index]
        if not np.isnan(positions[:, :, 0]).all():
            return solve_tree(tree, positions, self._method, None if before is None else before.rotations[0])
        if before is None:
            raise InputError(f"the first frame shows no marker of limb {tree.limbs[0]} and those beyond it")
        unknown = pose_covariances(tree.chain, tree.articulation, before, positions, tree.noise)
        return Outward(before, np.zeros((1, len(tree.limbs)), dtype=bool), unknown)
