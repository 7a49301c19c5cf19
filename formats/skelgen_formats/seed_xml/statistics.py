"""The figures that the seed's file holds beside the results: marker-joint distances and centres of mass."""

from __future__ import annotations

import numpy as np

from skelgen.model import Project, Skeleton
from skelgen.model.arrays import Floats
from skelgen_formats.seed_xml.values import JointStats, MarkerDistance


def joint_stats(project: Project) -> tuple[JointStats, ...]:
    """Return the statistics of every joint, in the order of the topology's children."""
    topology = project.topology
    return tuple(
        JointStats(
            first_bone=int(parent),
            second_bone=int(child),
            alpha=topology.alpha,
            first=_marker_distances(project, int(parent), joint),
            second=_marker_distances(project, int(child), joint),
            n_iterations=int(topology.n_iterations[joint]),
            value=float(topology.values[joint]),
        )
        for joint, (parent, child) in enumerate(topology.edges)
    )


def centers_of_mass(skeleton: Skeleton) -> Floats:
    """Return the mean of each limb's marker offsets [mm] in the limb's frame, NaN without markers, (n_limbs, 3)."""
    centers = np.full((skeleton.n_limbs, 3), np.nan)
    for limb in range(skeleton.n_limbs):
        offsets = skeleton.marker_offsets[skeleton.markers_of(limb)]
        known = offsets[~np.isnan(offsets).any(axis=1)]
        if len(known):
            centers[limb] = known.mean(axis=0)
    return centers


def _marker_distances(project: Project, limb: int, joint: int) -> tuple[MarkerDistance, ...]:
    """Mean and deviation of the distance to the raw joint [mm] of each marker on a limb, frames with both known."""
    found = []
    for marker in project.skeleton.markers_of(limb).tolist():
        apart = project.trajectories.positions[:, marker] - project.topology.raw_joint_positions[:, joint]
        distances = np.linalg.norm(apart, axis=1)
        known = distances[~np.isnan(distances)]
        if len(known):
            found.append(MarkerDistance(marker, float(known.mean()), float(known.std())))
    return tuple(found)
