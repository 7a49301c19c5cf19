"""What a project holds, part by part: formats declare which parts they keep, and what is lost is told."""

from collections.abc import Callable
from dataclasses import dataclass

from skelgen.model import PointCloud, Poses, Project, Trajectories


@dataclass(frozen=True)
class Part:
    """One kind of thing that a project holds.

    Attributes
    ----------
    name : str
        What formats declare in `Format.keeps`.
    title : str
        How a sentence names it.
    is_in : callable (project) -> bool
        Whether a project has it.
    in_every_frame : bool
        Whether it has a value in every frame.
    """

    name: str
    title: str
    is_in: Callable[[Project], bool]
    in_every_frame: bool = False


def _has_markers(project: Project) -> bool:
    return project.has("labels") or isinstance(project.take, Trajectories)


PARTS: tuple[Part, ...] = (
    Part("points", "the points of the recording", lambda project: isinstance(project.take, PointCloud), True),
    Part("bodies", "the bodies with their orientations", lambda project: isinstance(project.take, Poses), True),
    Part("markers", "the positions of the markers", _has_markers, True),
    Part("names", "the names of the markers", _has_markers),
    Part("confidence", "how sure the labels are", lambda project: project.has_labelling),
    Part("limbs", "which marker is on which limb", lambda project: project.has("limbs")),
    Part("joints", "the positions of the joints", lambda project: project.has("skeleton"), True),
    Part("angles", "the angles of the joints with their deviations", lambda project: project.has("skeleton"), True),
    Part("kinds", "types and axes of the joints", lambda project: project.has("skeleton")),
    Part("uncertainty", "how sure the joints are", lambda project: project.has("skeleton")),
    Part("motion", "how the limbs turn", lambda project: project.has("skeleton"), True),
)
"""All parts, in the order in which the stages find them."""


def parts_in(project: Project) -> tuple[Part, ...]:
    """Return the parts that a project has."""
    return tuple(part for part in PARTS if part.is_in(project))


def choices_in(project: Project) -> tuple[str, ...]:
    """Say which joints are drawn where the motion does not determine them, and which hinges along their axes."""
    if not project.has("skeleton"):
        return ()
    named = [*zip(project.skeleton.joint_names, project.skeleton.joints, strict=True)]
    anywhere = ", ".join(name for name, joint in named if not joint.is_determined)
    along = ", ".join(name for name, joint in named if joint.is_determined and not joint.is_fully_determined)
    sentences = (
        (anywhere, "The motion does not determine where these joints are; their places are a choice"),
        (along, "The motion does not determine where these hinges are along their axes; that is a choice"),
    )
    return tuple(f"{sentence}: {names}." for names, sentence in sentences if names)
