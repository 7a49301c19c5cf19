"""Bodies of which the number is stated and that stay too near each other to be parted by distances: joints part them.

Limbs are found as if all were one body, with the joints between them. Two bodies are held together by no joint, so that
the joints that fit worst are those between bodies.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from skelgen.app.configuration import Settings
from skelgen.model import Limbs, Project
from skelgen.progress import Monitor, listed

if TYPE_CHECKING:
    from skelgen.stages.limbs import LimbConstraints

UNSURE = 0.5
"""Probability of a body below which distances alone would not part it."""


def bodies_by_joints(
    project: Project, settings: Settings, limbs: Limbs, stated: LimbConstraints, monitor: Monitor
) -> LimbConstraints | None:
    """Return constraints with the markers of each body by the joints between limbs, where distances are unsure.

    Parameters
    ----------
    project : Project
        With labels.
    settings : Settings
        Parameters of the stages; that of limbs states the number of bodies.
    limbs : Limbs
        As distances part the bodies.
    stated : LimbConstraints
        What the user states.
    monitor : Monitor
        Receives a notice of what parts the bodies.

    Returns
    -------
    LimbConstraints or None
        None where distances are sure, bodies are stated, or a limb goes across the bodies that distances tell, as the
        feet of several people who stand still: its joints say nothing of bodies.
    """
    from skelgen.stages.joints import JointSearch  # noqa: PLC0415 - loads the stage
    from skelgen.stages.limbs import find_limbs  # noqa: PLC0415 - loads the stage

    n_bodies = settings.limbs.n_bodies
    if n_bodies < 2 or stated.bodies or limbs.body_probability.min() >= UNSURE:
        return None
    trajectories = project.trajectories
    as_one = find_limbs(trajectories, replace(settings.limbs, n_bodies=1), constraints=stated, seed=project.seed)
    on_both = (limbs.limb_of_marker >= 0) & (as_one.limb_of_marker >= 0)
    pairs = np.stack([as_one.limb_of_marker, limbs.body_of_limb[limbs.limb_of_marker]], axis=1)[on_both]
    if len(np.unique(pairs, axis=0)) > len(np.unique(pairs[:, 0])):
        return None
    parted = JointSearch(trajectories, as_one, settings.joints, project.seed).parted(n_bodies)
    if parted is None:
        return None
    body_of_marker = np.where(as_one.limb_of_marker >= 0, parted.body_of_limb[as_one.limb_of_marker], -1)
    names = np.array(trajectories.names)
    bodies = tuple(tuple(names[body_of_marker == body].tolist()) for body in range(n_bodies))
    monitor.notice(
        f"{n_bodies} bodies, as stated, of {listed(str(len(body)) for body in bodies)} markers: they are too near each "
        "other for distances to part them; the joints that would hold them together have "
        f"{parted.gap_ratio:.1f} times the gap of any other joint"
    )
    return replace(stated, bodies=bodies, body_probability=parted.probability)
