"""What writers of animations share: names and tips of bones, and sentences on what their players cannot tell."""

from __future__ import annotations

import numpy as np

from skelgen.errors import WriteError
from skelgen.model import Project, Skeleton, Take
from skelgen.model.arrays import Floats
from skelgen.model.filled import Filled
from skelgen_formats.finished import finished_project

_LARGEST = float(np.finfo(np.float32).max)
_SHORTEST_TIP = 1.0  # mm: importers turn a bone of no length into none, or into one of a metre


def animated_project(value: Project | Take | Filled, title: str) -> Project:
    """Return a project whose skeleton moves.

    Raises
    ------
    WriteError
        If it is no project, or there is no limb or no frame.
    MissingResultError
        If a stage has not run.
    """
    project = finished_project(value, title)
    if project.motion.n_frames == 0 or project.skeleton.n_limbs == 0:
        raise WriteError(f"{title} needs at least one bone and one frame")
    return project


def check_single_precision(project: Project, title: str) -> None:
    """Raise `WriteError` if a coordinate of a project is beyond the numbers of a format with single precision."""
    poses = (project.motion.world_from_limb, project.skeleton.reference_pose)
    if not all(float(np.abs(pose).max()) < _LARGEST for pose in poses):
        raise WriteError(f"a coordinate is beyond what {title}'s single precision can hold")


def bone_name(limb: int) -> str:
    """Return the name of a limb's bone, as all formats of animations have it."""
    return f"limb{limb}"


def bone_tip(skeleton: Skeleton, limb: int) -> Floats:
    """Return where a limb that carries no other ends, in its frame [mm], shape (3,): as far as its markers reach.

    The direction is that of the markers' centroid; a limb without markers ends a millimetre from its joint.
    """
    markers = skeleton.marker_offsets[skeleton.markers_of(limb)]
    centre = markers.mean(axis=0) if len(markers) else np.zeros(3)
    distance = float(np.linalg.norm(centre))
    if distance < _SHORTEST_TIP:
        return np.array([0.0, 0.0, _SHORTEST_TIP])
    return np.asarray(centre / distance * float((markers @ centre).max()) / distance)


def lost_in_animations(project: Project, title: str) -> tuple[str, ...]:
    """Say what of this project's skeleton no tree of bones holds: rings, and which frames are interpolated."""
    said = []
    if project.skeleton.loops:
        rings = len(project.skeleton.loops)
        said.append(f"{title} knows trees only: {rings} joint{'s' if rings > 1 else ''} closing rings are left out.")
    interpolated = int((~project.motion.limb_seen).any(axis=1).sum())
    if interpolated:
        frames = f"{interpolated} of {project.motion.n_frames} frames"
        said.append(f"{title} cannot tell that in {frames} some limb is not seen but interpolated.")
    return tuple(said)
