"""Stage summaries: what a stage has found in two or three sentences, and its warnings with the place to look at."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from skelgen.app.advice import REMEDIES, doubtful_share, left_out_share
from skelgen.model import Joint, Limbs, PointCloud, Poses, Project, Take
from skelgen.model.limbs import with_names_of_limbs
from skelgen.model.placed_joints import Place, count_places
from skelgen.progress import counted, frames_between

_MOST_POINTERS = 200
"""Warnings that are listed; nobody reads more."""

_OPEN_AXIS = 0.1
"""rad; an axis that errs by more moves the end of its limb by more than a tenth of the limb's size, beyond which places
are called not determined."""

_LIMBS = re.compile(r"\blimbs? (\d+)(?: and (?:limb )?(\d+))?")
_FRAME = re.compile(r"\bframes? (\d+)")
_UNKNOWN = "interpolated"
"""What notices say of limbs that too few markers show."""


@dataclass(frozen=True)
class Pointer:
    """A warning, and where to look.

    Attributes
    ----------
    sentence : str
        What is the matter.
    frame : int or None
        Where in time.
    markers : tuple of int
        Markers that it is about.
    """

    sentence: str
    frame: int | None = None
    markers: tuple[int, ...] = ()


def take_sentences(take: Take) -> tuple[str, ...]:
    """Return what was read, in sentences."""
    what = (
        f"{counted(take.n_points, 'point')} without labels, {take.n_points / max(take.n_frames, 1):.1f} in a frame"
        if isinstance(take, PointCloud)
        else f"{counted(take.n_bodies, 'body', 'bodies')} with orientation"
        if isinstance(take, Poses)
        else f"{counted(take.n_markers, 'marker')} with labels"
    )
    seconds = max(take.n_frames - 1, 0) / take.rate
    return (f"{counted(take.n_frames, 'frame')} at {take.rate:g} Hz, {seconds:.1f} s: {what}.",)


def stage_sentences(project: Project, stage: str) -> tuple[str, ...]:
    """Return what a stage has found, in two or three sentences; nothing before it has run.

    Parameters
    ----------
    project : Project
        With or without results.
    stage : str
        ``labels``, ``limbs``, ``joints`` or ``skeleton``.
    """
    return tuple(_SENTENCES[stage](project)) if project.has(stage) else ()


def stage_pointers(project: Project, stage: str) -> tuple[Pointer, ...]:
    """Return the warnings of a stage: those that point to frames first, in their order.

    Parameters
    ----------
    project : Project
        With or without results.
    stage : str
        ``labels``, ``limbs``, ``joints`` or ``skeleton``.
    """
    if not project.has(stage):
        return ()
    found = [] if stage != "labels" else list(_label_pointers(project))
    names = {name: marker for marker, name in enumerate(project.trajectories.names)}
    for sentence in stage_notices(project, stage):
        limbs = _limbs_in(project, sentence)
        first, _, rest = sentence.partition(" is on ")
        if rest and first in names:
            found.append(Pointer(sentence, None, (names[first],)))
            continue
        if limbs:
            found.append(_limb_pointer(project, sentence, limbs))
            continue
        words = {word.strip(",.:;()'\"") for word in sentence.split()}
        found.append(Pointer(sentence, None, tuple(sorted(names[word] for word in words & names.keys()))))
    return tuple(found[:_MOST_POINTERS])


def stage_notices(project: Project, stage: str) -> tuple[str, ...]:
    """Return what a stage noticed, with the names that limbs got after it.

    Parameters
    ----------
    project : Project
        With or without results.
    stage : str
        ``labels``, ``limbs``, ``joints`` or ``skeleton``.
    """
    notices = project.reports[stage].notices if stage in project.reports else ()
    return tuple(with_names_of_limbs(one, project.limbs) for one in notices) if project.has("limbs") else notices


def has_doubts(project: Project, stage: str) -> bool:
    """Whether something that a stage has found is doubtful.

    Parameters
    ----------
    project : Project
        With or without results.
    stage : str
        ``labels``, ``limbs``, ``joints`` or ``skeleton``.
    """
    if not project.has(stage):
        return False
    if stage == "labels":
        return project.has_labelling and bool(project.labelling.doubts)
    if stage == "skeleton":
        return any(map(_is_doubtful, project.skeleton.joints))
    return len(project.limbs.doubtful if stage == "limbs" else project.topology.doubtful) > 0


def _is_doubtful(joint: Joint) -> bool:
    """Whether motion leaves a joint's place, type or axis open; along a hinge's axis no motion shows the place."""
    return not joint.is_determined or joint.kind == "undetermined" or _has_open_axis(joint)


def _has_open_axis(joint: Joint) -> bool:
    stds = [std for std in (joint.axis_std, joint.second_axis_std) if std is not None and joint.axis is not None]
    return any(np.linalg.norm(std) > _OPEN_AXIS for std in stds)


def _least_sure(limbs: Limbs, names: Sequence[str]) -> str:
    """The marker that is least sure to be on its limb, with the alternative."""
    marker = int(limbs.doubtful[0])
    rivals, shares = limbs.rivals
    other = limbs.called(int(rivals[marker])) if rivals[marker] >= 0 else "alone"
    own = f"{limbs.called(int(limbs.limb_of_marker[marker]))} {100 * limbs.probability[marker]:.0f} %"
    return f"{names[marker]}, {own}, {other} {100 * shares[marker]:.0f} %"


def _limbs_in(project: Project, sentence: str) -> list[int]:
    """The limbs that a sentence names, by their numbers or by what they are called."""
    if not project.has("limbs"):
        return []
    named = {int(number) for pair in _LIMBS.findall(sentence) for number in pair if number}
    called = enumerate(project.limbs.names)
    named |= {limb for limb, name in called if re.search(rf"(?<!\w){re.escape(name)}(?!\w)", sentence)}
    return sorted(limb for limb in named if limb < project.limbs.n_limbs)


def _limb_pointer(project: Project, sentence: str, limbs: list[int]) -> Pointer:
    """Point to the markers of limbs, in the first frame in which one of them is not known from its markers."""
    markers = np.flatnonzero(np.isin(project.limbs.limb_of_marker, limbs)).tolist()
    unknown = ~project.motion.limb_seen[:, limbs].all(axis=1) if project.has("skeleton") else np.zeros(1, dtype=bool)
    frame = int(unknown.argmax()) if _UNKNOWN in sentence and unknown.any() else None
    if found := _FRAME.search(sentence):
        frame = int(found[1])
    return Pointer(sentence, frame, tuple(markers))


def _label_pointers(project: Project) -> Iterator[Pointer]:
    if not project.has_labelling:
        return
    names = project.trajectories.names
    for finding in project.labelling.findings:
        markers = tuple(names.index(name) for name in finding.names if name in names)
        yield Pointer(
            f"{', '.join(finding.names)}: {finding.evidence}; {finding.outcome}", finding.first_frame, markers
        )
    for doubt in project.labelling.doubts:
        frames = frames_between(doubt.first_frame, doubt.last_frame)
        sentence = f"{names[doubt.marker]}, {frames}: {doubt.reason}; {REMEDIES[doubt.kind]}"
        yield Pointer(sentence, doubt.first_frame, (doubt.marker,) + ((doubt.rival,) if doubt.rival >= 0 else ()))


def _about_labels(project: Project) -> Iterator[str]:
    markers = project.trajectories
    share = float(markers.seen.mean()) if markers.seen.size else 0.0
    yield f"{counted(markers.n_markers, 'marker')}, seen in {100 * share:.1f} % of the frames on average."
    if project.has_labelling:
        doubts = len(project.labelling.doubts)
        spans = f"{doubts} spans are doubtful" if doubts != 1 else "1 span is doubtful"
        yield f"{spans}, {100 * doubtful_share(project.labelling):.2f} % of all positions."
        if isinstance(project.take, PointCloud):
            yield f"{100 * left_out_share(project):.2f} % of the points belong to no marker."


def _about_limbs(project: Project) -> Iterator[str]:
    limbs = project.limbs
    sizes = np.bincount(limbs.limb_of_marker[limbs.limb_of_marker >= 0], minlength=limbs.n_limbs)
    if limbs.n_limbs:
        least, most = int(sizes.min()), int(sizes.max())
        markers = f"{least} to {most} markers" if least < most else f"{counted(most, 'marker')} each"
        yield f"{counted(limbs.n_limbs, 'limb')} with {markers}."
    else:
        yield "No limbs."
    if len(limbs.doubtful):
        least_sure = _least_sure(limbs, project.trajectories.names)
        yield f"{counted(len(limbs.doubtful), 'marker')} may be on another limb, least sure {least_sure}."
    if len(limbs.left_out):
        names = ", ".join(project.trajectories.names[marker] for marker in limbs.left_out)
        yield f"Left out: {names}."


def _about_joints(project: Project) -> Iterator[str]:
    topology = project.topology
    bodies = [one for one in project.bodies if len(one.markers) > 1]  # a marker alone is a point, not a body
    sizes = f", each a body: {', '.join(counted(len(one.limbs), 'limb') for one in bodies)}" * (len(bodies) > 1)
    n_alone = len(project.bodies) - len(bodies)
    alone = f"; {counted(n_alone, 'marker')} alone" * (n_alone > 0)
    yield f"{counted(len(topology.edges), 'joint')} in {counted(len(bodies), 'tree')}{sizes}{alone}."
    if topology.edge_probability is not None and len(topology.edge_probability):
        worst = int(topology.edge_probability.argmin())
        parent, child = map(project.limbs.called, topology.edges[worst].tolist())
        sure, n_doubtful = f"{100 * topology.edge_probability[worst]:.0f} %", len(topology.doubtful)
        verb = "is" if n_doubtful == 1 else "are"
        yield f"{n_doubtful} of them {verb} doubtful; least sure is that of {parent} and {child}, {sure}."
    if len(topology.loops):
        pairs = ", ".join(" and ".join(map(project.limbs.called, pair)) for pair in topology.loops)
        yield f"Loops would be closed by joints between {pairs}."
    if topology.spans:
        yield f"{counted(len(topology.spans), 'joint')} more for a part of the take only."


def _about_skeleton(project: Project) -> Iterator[str]:
    types = [joint.kind for joint in project.skeleton.joints]
    listed_types = ", ".join(f"{types.count(kind)} {kind}" for kind in dict.fromkeys(types))
    yield f"{counted(len(types), 'joint')}: {listed_types}." if types else "One limb without joints."
    n_untyped = types.count("undetermined")
    if n_untyped:
        yield f"Turns do not tell the type of {counted(n_untyped, 'joint')}: too small, or hidden by errors of markers."
    n_axes = sum(map(_has_open_axis, project.skeleton.joints))
    if n_axes:
        yield f"The motion does not determine the axis of {counted(n_axes, 'joint')}."
    yield from _about_places(project.skeleton.joints)
    residuals = project.motion.residuals
    seen = residuals[~np.isnan(residuals)]
    if len(seen):
        middle = f"half of them within {np.median(seen):.2f} mm"
        yield f"Markers lie {seen.mean():.2f} mm from the skeleton on average, {middle}."
    unseen = float(project.motion.interpolated.mean()) if project.motion.limb_seen.size else 0.0
    yield f"{100 * unseen:.1f} % of the limbs' poses are interpolated."


def _about_places(joints: Sequence[Joint]) -> Iterator[str]:
    """How many joints the motion does not determine, by what places them instead."""
    numbers = {place: number for place, number in count_places(joints).items() if number}
    for place, what in ((Place.MARKER_SET, "The marker set"), (Place.USUAL, "What is usual of bodies")):
        if place in numbers:
            yield f"{what} places {counted(numbers[place], 'joint')}, as the motion does not."
    for place, how in ((Place.IN_PART, "in part a choice"), (Place.CHOICE, "a choice")):
        if place in numbers:
            verb = "lies" if numbers[place] == 1 else "lie"
            yield f"Where {counted(numbers[place], 'joint')} {verb} is {how}: the motion does not determine it."
    if n_along := numbers.get(Place.USUAL_ALONG_AXIS):
        axes = "its axis" if n_along == 1 else "their axes"
        hinges = counted(n_along, "hinge")
        yield f"What is usual of bodies places {hinges} along {axes}: turns about an axis do not show it."
    if n_along := numbers.get(Place.CHOICE_ALONG_AXIS):
        one, more = "its axis the place of 1 hinge is", f"their axes the places of {n_along} hinges are"
        yield f"Along {one if n_along == 1 else more} a choice: turns about an axis do not show it."


_SENTENCES = {"labels": _about_labels, "limbs": _about_limbs, "joints": _about_joints, "skeleton": _about_skeleton}
