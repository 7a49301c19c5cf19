"""What the report says: sentences, tables and drawings for each result that the project holds."""

import platform
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import PurePath

import numpy as np
from markupsafe import Markup

import skelgen
from skelgen.app import STAGE_SUMMARIES
from skelgen.app.advice import doubtful_share
from skelgen.app.configuration import parameters_class
from skelgen.app.drawing import measures, svg
from skelgen.app.drawing.graph import CostGraph, find_cost_graph
from skelgen.app.drawing.scales import limb_colour
from skelgen.app.drawing.wording import duration, millimetres, percent, plain
from skelgen.app.report.curves import points_figure
from skelgen.app.report.joints import (
    AnglesContent,
    JointsContent,
    LengthsContent,
    angles_content,
    joints_content,
    lengths_content,
)
from skelgen.app.report.labels import GapsContent, LabelsContent, gaps_content, labels_content
from skelgen.app.report.limbs import DeviationsContent, LimbsContent, deviations_content, limbs_content
from skelgen.app.report.pictures import cost_figure
from skelgen.app.report.play import PlayContent, play_content
from skelgen.app.report.skeleton import graph_figure, pose_figures, sign_figure, tree_figure
from skelgen.app.stage_summary import stage_notices
from skelgen.model import Joint, PointCloud, Poses, Project
from skelgen.model.placed_joints import Place, count_places
from skelgen.model.skeleton import JOINT_TYPES
from skelgen.parameters import Declaration
from skelgen.progress import SILENT, Monitor, counted, listed

_LIBRARIES = ("numpy", "scipy")

_KIND_WORDS = {
    "PointCloud": "unlabelled points",
    "Trajectories": "labelled markers",
    "Poses": "bodies with position and orientation",
}
_SIGN_SIDE = 18.0


@dataclass(frozen=True, eq=False)
class InputContent:
    """The section of what was read.

    Attributes
    ----------
    facts : list of tuple of str
        Names and values.
    figure : Markup or None
        Points in each frame, of a take without labels.
    """

    facts: list[tuple[str, str]]
    figure: Markup | None = None


@dataclass(frozen=True)
class StageRow:
    """A stage that ran.

    Attributes
    ----------
    name, summary : str
        What it is called, and what it does.
    seconds : float, s
        How long it took; 0 where that is not known, as of a batch, which keeps times apart.
    share : float
        Its part of the time of all stages.
    parameters : sequence of tuple
        Name and value of each parameter with which it ran, and what is declared of it, if this version knows it; empty
        where they are not known.
    changed : list of str
        Parameters whose value is not the default.
    """

    name: str
    summary: str
    seconds: float
    share: float
    parameters: Sequence[tuple[str, object, Declaration | None]]
    changed: list[str]


@dataclass(frozen=True, eq=False)
class TreeContent:
    """The section of the tree.

    Attributes
    ----------
    figure, graph, matrix : Markup
        The tree, and the costs of all joints as a graph and as a matrix.
    signs : list of tuple
        Types of joints in the tree, and the sign of each.
    """

    figure: Markup
    graph: Markup
    matrix: Markup
    signs: list[tuple[str, Markup]]


@dataclass(frozen=True, eq=False)
class ViewContent:
    """What the page with the view alone shows.

    Attributes
    ----------
    title, sentence : str
        Name and size of the take.
    colours : list of tuple
        Each limb with its colour on a light and on a dark page.
    play : PlayContent or None
        The view; None if nothing is ever seen.
    """

    title: str
    sentence: str
    colours: list[tuple[int, str, str]]
    play: PlayContent | None


@dataclass(frozen=True, eq=False)
class ReportContent:
    """Everything that the template of the report shows; sections are None where their stage has not run.

    Attributes
    ----------
    title : str
        Name of the take.
    sentences : list of str
        The most important results.
    tiles, notices, versions : list of tuple of str
        Numbers with their names; stages with their notices; libraries with their versions.
    input : InputContent
        What was read.
    stages : list of StageRow
        What ran.
    seed : int
        Random seed.
    colours : list of tuple
        Each limb with its colour on a light and on a dark page.
    play, gaps, labels, limbs, tree, joints, lengths, angles, deviations
        Sections.
    pose : list of tuple, or None
        Views of the reference pose: title and drawing.
    """

    title: str
    sentences: list[str]
    tiles: list[tuple[str, str]]
    input: InputContent
    notices: list[tuple[str, str]]
    stages: list[StageRow]
    versions: list[tuple[str, str]]
    seed: int
    colours: list[tuple[int, str, str]]
    play: PlayContent | None
    gaps: GapsContent | None = None
    labels: LabelsContent | None = None
    limbs: LimbsContent | None = None
    tree: TreeContent | None = None
    joints: JointsContent | None = None
    lengths: LengthsContent | None = None
    angles: AnglesContent | None = None
    pose: list[tuple[str, Markup]] | None = None
    deviations: DeviationsContent | None = None


def report_content(project: Project, monitor: Monitor = SILENT) -> ReportContent:
    """Return everything that the template of the report shows.

    Parameters
    ----------
    project : Project
        Any project, from a bare take to a fitted skeleton.
    monitor : Monitor
        Receives progress; may cancel.
    """
    libraries = [(name, metadata.version(name)) for name in _LIBRARIES]
    content = ReportContent(
        title=_title(project),
        sentences=_sentences(project),
        tiles=_tiles(project),
        input=_input(project),
        notices=_notices(project),
        stages=_stages(project),
        versions=[("skelgen", skelgen.__version__), *libraries, ("Python", platform.python_version())],
        seed=project.seed,
        colours=_colours(project),
        play=play_content(project),
    )
    if project.has("labels") and project.trajectories.n_frames and project.trajectories.n_markers:
        labels = labels_content(project) if project.has_labelling else None
        content = replace(content, gaps=gaps_content(project, monitor), labels=labels)
    if project.has("limbs") and project.limbs.n_limbs:
        content = replace(content, limbs=limbs_content(project))
    if project.has("joints") and project.topology.n_joints:
        graph, lengths = find_cost_graph(project), measures.joint_lengths(project)
        content = replace(
            content,
            tree=_tree(project, graph, lengths),
            joints=joints_content(project, graph),
            lengths=lengths_content(project, lengths),
            angles=angles_content(project) if project.has("skeleton") else None,
        )
    if project.has("skeleton") and project.skeleton.n_limbs:
        content = replace(content, pose=pose_figures(project))
    if project.has("skeleton") and np.isfinite(project.motion.residuals).any():
        content = replace(content, deviations=deviations_content(project))
    return content


def view_content(project: Project) -> ViewContent:
    """Return everything that the page with the view alone shows.

    Parameters
    ----------
    project : Project
        Any project, from a bare take to a fitted skeleton.
    """
    return ViewContent(_title(project), _take_sentence(project), _colours(project), play_content(project))


def _title(project: Project) -> str:
    return project.name or "take without a name"


def _colours(project: Project) -> list[tuple[int, str, str]]:
    """The colour of each limb on a light and on a dark page."""
    n_limbs = project.limbs.n_limbs if project.has("limbs") else 0
    return [(limb, limb_colour(limb), limb_colour(limb, dark=True)) for limb in range(n_limbs)]


def _sentences(project: Project) -> list[str]:
    sentences = [_take_sentence(project)]
    if project.has_labelling and project.labelling.doubts:
        spans = counted(len(project.labelling.doubts), "span")
        share = percent(doubtful_share(project.labelling))
        sentences.append(
            f"It is not sure in {spans}, {share} of all positions, that a marker is the one that it is called."
        )
    if project.has("limbs"):
        limbs = project.limbs
        left_out = f", {counted(len(limbs.left_out), 'marker')} left out" if len(limbs.left_out) else ""
        on_limbs = counted(limbs.n_markers - len(limbs.left_out), "marker")
        doubtful = f"; {len(limbs.doubtful)} of them may be on another" if len(limbs.doubtful) else ""
        sentences.append(f"{on_limbs} sit on {counted(limbs.n_limbs, 'rigid limb')}{left_out}{doubtful}.")
    if project.has("joints"):
        sentences.append(_tree_sentence(project))
    if project.has("skeleton") and np.isfinite(project.motion.residuals).any():
        sentences.append(_fit_sentence(project))
    return sentences


def _take_sentence(project: Project) -> str:
    take = project.take
    frames = f"{counted(take.n_frames, 'frame')} ({_length_in_time(project)})"
    if isinstance(take, PointCloud):
        points = f"The take holds {counted(take.n_points, 'unlabelled point')} in {frames}"
        if not project.has("labels"):
            return f"{points}."
        return f"{points}, in which {counted(project.trajectories.n_markers, 'marker')} were followed."
    if isinstance(take, Poses):
        return f"The take holds {counted(take.n_bodies, 'body', 'bodies')} with orientation over {frames}."
    seen = percent(float(take.seen.mean())) if take.seen.size else "–"
    markers = counted(take.n_markers, "labelled marker")
    return f"The take holds {markers} over {frames}; {seen} of the positions are seen."


def _length_in_time(project: Project) -> str:
    return duration(max(project.take.n_frames - 1, 0) / project.take.rate)


def _tree_sentence(project: Project) -> str:
    topology = project.topology
    roots = listed(project.limbs.called(root) for root in topology.roots.tolist())
    types = Counter(joint.kind for joint in project.skeleton.joints) if project.has("skeleton") else Counter[str]()
    named = listed(f"{types[kind]} {kind}" for kind in JOINT_TYPES if types[kind])
    joints = counted(topology.n_joints, "joint") + (f" ({named})" if named else "")
    n_doubtful = len(topology.doubtful)
    doubts = f" {counted(n_doubtful, 'edge')} of the tree may be another." if n_doubtful else ""
    doubts += _open_joints(project.skeleton.joints) if project.has("skeleton") else ""
    shape = "a tree" if len(topology.roots) == 1 else f"{len(topology.roots)} separate trees"
    return f"{joints} connect them to {shape} with {roots} as root.{_bodies(project)}{doubts}"


def _open_joints(joints: Sequence[Joint]) -> str:
    """How many joints the motion does not determine, and what places how many of them instead."""
    n_open, numbers = sum(not joint.is_determined for joint in joints), count_places(joints)
    if not n_open:
        return ""
    by = {Place.MARKER_SET: "the marker set", Place.USUAL: "what is usual of bodies"}
    placed = [f"; {what} places {numbers[place]} of them" for place, what in by.items() if numbers[place]]
    return f" The motion does not determine where {counted(n_open, 'joint')} lie{''.join(placed)}."


def _bodies(project: Project) -> str:
    """Which bodies there are, if there are several."""
    if len(project.bodies) == 1:
        return ""
    parts = []
    for body in project.bodies:
        sure = "" if body.probability is None else f", {100 * body.probability:.0f} % sure"
        limbs, markers = counted(len(body.limbs), "limb"), counted(len(body.markers), "marker")
        parts.append(f"{body.name} ({limbs}, {markers}{sure})")
    return f" They are {len(parts)} bodies: {listed(parts)}."


def _fit_sentence(project: Project) -> str:
    motion = project.motion
    mean, rms, largest = measures.spread_of(motion.residuals[~np.isnan(motion.residuals)])
    frame, marker = measures.worst_residual(motion)
    return (
        f"The rigid skeleton meets the measured markers within {millimetres(mean)} on average "
        f"({millimetres(rms)} rms); it misses them most, by {millimetres(largest)}, "
        f"at marker {project.trajectories.names[marker]} in frame {frame} ({duration(frame / motion.rate)})."
    )


def _tiles(project: Project) -> list[tuple[str, str]]:
    rate = plain(float(f"{project.take.rate:.4g}"))  # a tile has no room for 69.9926
    tiles = [(str(project.take.n_frames), "frames"), (f"{rate} Hz", "frame rate")]
    if project.has("labels"):
        tiles.append((str(project.trajectories.n_markers), "markers"))
    if project.has("limbs"):
        tiles.append((str(project.limbs.n_limbs), "limbs"))
    if project.has("joints"):
        tiles.append((str(project.topology.n_joints), "joints"))
    if project.has("skeleton") and np.isfinite(project.motion.residuals).any():
        mean, _, _ = measures.spread_of(project.motion.residuals[~np.isnan(project.motion.residuals)])
        tiles.append((millimetres(mean), "mean residual"))
    if seconds := sum(report.seconds for report in project.reports.values()):
        tiles.append((duration(seconds), "computing time"))
    return tiles


def _input(project: Project) -> InputContent:
    take = project.take
    facts = [("Name", take.name or "–"), ("Content", _KIND_WORDS[type(take).__name__])]
    suffix = PurePath(take.name).suffix
    if suffix:
        facts.append(("File suffix", suffix))
    facts += [("Frames", str(take.n_frames)), ("Rate", f"{plain(take.rate)} Hz")]
    facts.append(("Duration", _length_in_time(project)))
    if isinstance(take, PointCloud):
        per_frame = take.points_per_frame
        ends = dict.fromkeys([str(per_frame.min()), str(per_frame.max())] if take.n_frames else ["–"])
        facts += [("Points", str(take.n_points)), ("Points per frame", " to ".join(ends))]
        return InputContent(facts, points_figure(take)) if take.n_points else InputContent(facts)
    if isinstance(take, Poses):
        return InputContent([*facts, ("Bodies", str(take.n_bodies))])
    return InputContent([*facts, ("Markers", str(take.n_markers))])


def _stages(project: Project) -> list[StageRow]:
    """The stages that have run, in the order of the pipeline."""
    rows = []
    for stage in (stage for stage in STAGE_SUMMARIES if stage in project.reports):
        report = project.reports[stage]
        declared = {each.name: each for each in parameters_class(stage).declarations()} if report.parameters else {}
        parameters = [(name, value, declared.get(name)) for name, value in report.parameters.items()]
        changed = [name for name, value, entry in parameters if entry is not None and value != entry.default]
        share = report.seconds / max(sum(one.seconds for one in project.reports.values()), 1e-9)
        rows.append(StageRow(stage, STAGE_SUMMARIES[stage], report.seconds, share, parameters, changed))
    return rows


def _notices(project: Project) -> list[tuple[str, str]]:
    notices = [("reading", sentence) for sentence in project.take.notices]
    if project.has("labels"):
        of_take = set(project.take.notices)
        notices += [("labels", sentence) for sentence in project.trajectories.notices if sentence not in of_take]
    for stage in project.reports:
        notices += [(stage, sentence) for sentence in stage_notices(project, stage)]
    return list(dict.fromkeys(notices))


def _tree(project: Project, graph: CostGraph, lengths: list[measures.Length]) -> TreeContent:
    used = {joint.kind for joint in project.skeleton.joints} if project.has("skeleton") else set()
    signs = []
    for kind in (kind for kind in JOINT_TYPES if kind in used):
        sign, label = sign_figure(kind, _SIGN_SIDE / 2, _SIGN_SIDE / 2), f"sign of a {kind} joint"
        signs.append((kind, svg.drawing(_SIGN_SIDE, _SIGN_SIDE, label, sign, least=_SIGN_SIDE)))
    return TreeContent(tree_figure(project, lengths), graph_figure(project, graph), cost_figure(project), signs)
