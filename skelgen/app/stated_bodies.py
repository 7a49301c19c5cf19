"""As many bodies and limbs as the user states.

Bodies that stay too near each other to be parted by distances are parted by joints: limbs are found as if all were one
body, with the joints between them. Two bodies are held together by no joint, so that the joints that fit worst are
those between bodies. A number of limbs is reached from the limbs that are found: some are merged, or some parted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from skelgen.app.configuration import Settings
from skelgen.model import Limbs, Project
from skelgen.model.arrays import Bools
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
        None where distances are sure, bodies are stated, or joints say nothing: a limb that stands still goes across
        the bodies that distances tell, as the feet of several people who never step.
    """
    from skelgen.stages.joints import JointSearch  # noqa: PLC0415 - loads the stage
    from skelgen.stages.limbs import find_limbs  # noqa: PLC0415 - loads the stage

    n_bodies = settings.limbs.n_bodies
    if n_bodies < 2 or stated.bodies or limbs.body_probability.min() >= UNSURE:
        return None
    trajectories = project.trajectories
    as_one = find_limbs(trajectories, replace(settings.limbs, n_bodies=1), constraints=stated, seed=project.seed)
    search = JointSearch(trajectories, as_one, settings.joints, project.seed)
    parted = search.parted(n_bodies)
    if parted is None or (search.is_still & _across(as_one, limbs) & (parted.body_of_limb >= 0)).any():
        return None
    body_of_marker = parted.of_markers(trajectories.positions, as_one.limb_of_marker)
    names = np.array(trajectories.names)
    bodies = tuple(tuple(names[body_of_marker == body].tolist()) for body in range(n_bodies))
    monitor.notice(
        f"{n_bodies} bodies, as stated, of {listed(str(len(body)) for body in bodies)} markers: they are too near each "
        "other for distances to part them; the joints that would hold them together have "
        f"{parted.gap_ratio:.1f} times the gap of any other joint"
    )
    return replace(stated, bodies=bodies, body_probability=parted.probability)


def near_limbs(
    names: Sequence[str], limbs: Limbs, split: Sequence[Sequence[str]], stated: LimbConstraints, n_limbs: int
) -> LimbConstraints:
    """Return constraints by which another number of limbs only merges, or only parts, those that are found.

    Parameters
    ----------
    names : sequence of str
        Of the markers.
    limbs : Limbs
        Those that are found.
    split : sequence of sequence of str
        Names of parts of one marker, of which the first stands for it.
    stated : LimbConstraints
        What the user states.
    n_limbs : int
        The number that is stated.
    """
    parts = {name for group in split for name in group[1:]}
    kept = [name not in parts for name in names]
    markers = [
        [names[marker] for marker in limbs.markers_of(limb).tolist() if kept[marker]] for limb in range(limbs.n_limbs)
    ]
    if n_limbs < limbs.n_limbs:
        return replace(stated, together=(*stated.together, *(group for group in markers if len(group) > 1)))
    return replace(stated, apart=(*stated.apart, *(pair for two in combinations(markers, 2) for pair in product(*two))))


def _across(as_one: Limbs, limbs: Limbs) -> Bools:
    """Which limbs of `as_one` have markers on several bodies of `limbs`, shape (n_limbs,)."""
    on_both = (limbs.limb_of_marker >= 0) & (as_one.limb_of_marker >= 0)
    bodies = limbs.body_of_limb[limbs.limb_of_marker]
    return np.array(
        [len(np.unique(bodies[on_both & (as_one.limb_of_marker == limb)])) > 1 for limb in range(as_one.n_limbs)]
    )
