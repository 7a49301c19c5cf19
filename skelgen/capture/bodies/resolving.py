"""Which of the candidates that share a ball are real, once the bodies are known."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from skelgen.capture.blobs import FoundBody, StereoPoints
from skelgen.model.arrays import Ints


def resolved_points(points: StereoPoints, bodies: Iterable[FoundBody]) -> Ints:
    """Return the points that are left when every ball of an image is used once.

    Points of bodies are real; of the others those go first whose balls fit best together.

    Parameters
    ----------
    points : StereoPoints
        All candidates of one frame.
    bodies : iterable of FoundBody
        What was found among them.

    Returns
    -------
    ndarray of intp, shape (n,)
        Indices, rising.
    """
    certain = [int(point) for body in bodies for point in body.points if point >= 0]
    order = [*certain, *np.argsort(points.epipolar_distance, kind="stable").tolist()]
    used_left: set[int] = set()
    used_right: set[int] = set()
    kept = []
    for point in order:
        left, right = int(points.left[point]), int(points.right[point])
        if left not in used_left and right not in used_right:
            kept.append(point)
            used_left.add(left)
            used_right.add(right)
    return np.array(sorted(kept), dtype=np.intp)
