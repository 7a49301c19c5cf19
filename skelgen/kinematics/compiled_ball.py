"""Compiled loops over frames of two bodies and a point of both; `plain_ball` is the NumPy twin.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats


@compile_function
def fixed_point_sums(first: Floats, second: Floats, weights: Floats) -> tuple[Floats, Floats, Floats, float, int]:
    """Return what frames say of a point that is fixed in two bodies; see `plain_ball.fixed_point_sums`."""
    relative, seen_from_first, seen_from_second = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    between, total, square, n_frames = np.empty(3), 0.0, 0.0, 0
    for frame in range(len(weights)):
        if math.isnan(first[frame, 0, 0]) or math.isnan(second[frame, 0, 0]):
            continue
        n_frames += 1
        weight = weights[frame]
        total += weight
        for i in range(3):
            between[i] = second[frame, i, 3] - first[frame, i, 3]
            square += weight * between[i] ** 2
        for i in range(3):
            for k in range(3):
                weighted = weight * first[frame, k, i]
                seen_from_first[i] += weighted * between[k]
                seen_from_second[i] += weight * second[frame, k, i] * between[k]
                for j in range(3):
                    relative[i, j] += weighted * second[frame, k, j]
    return relative / total, seen_from_first / total, seen_from_second / total, square / total, n_frames


@compile_function
def both_images(first: Floats, second: Floats, in_first: Floats, in_second: Floats) -> tuple[Floats, Floats]:
    """Return the middle of a point's two images, and the square of their distance; see `plain_ball.both_images`."""
    middles, gaps = np.empty((len(first), 3)), np.empty(len(first))
    for frame in range(len(first)):
        gaps[frame] = 0.0
        for i in range(3):
            one, other = first[frame, i, 3], second[frame, i, 3]
            for j in range(3):
                one += first[frame, i, j] * in_first[j]
                other += second[frame, i, j] * in_second[j]
            gaps[frame] += (one - other) ** 2
            if math.isnan(one):
                middles[frame, i] = other
            else:
                middles[frame, i] = one if math.isnan(other) else (one + other) / 2.0
    return middles, gaps


@compile_function
def mean_distances(joint: Floats, markers: Floats) -> tuple[Floats, Floats]:
    """Return mean and standard deviation of markers' distances to a joint; see `plain_ball.mean_distances`."""
    n_frames, n_markers = markers.shape[:2]
    means, spreads, counts = np.zeros(n_markers), np.zeros(n_markers), np.zeros(n_markers)
    distances = np.empty((n_frames, n_markers))
    for frame in range(n_frames):
        for marker in range(n_markers):
            square = 0.0
            for i in range(3):
                square += (joint[frame, i] - markers[frame, marker, i]) ** 2
            distances[frame, marker] = math.sqrt(square)
            if not math.isnan(square):
                means[marker] += distances[frame, marker]
                counts[marker] += 1.0
    for marker in range(n_markers):
        means[marker] /= max(counts[marker], 1.0)
    for frame in range(n_frames):
        for marker in range(n_markers):
            if not math.isnan(distances[frame, marker]):
                spreads[marker] += (distances[frame, marker] - means[marker]) ** 2
    for marker in range(n_markers):
        spreads[marker] = math.sqrt(spreads[marker] / max(counts[marker], 1.0))
    return means, spreads
