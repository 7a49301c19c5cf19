"""What the report says: sentences, tables and drawings for each result that the project holds."""

import platform
from collections import Counter
from importlib import metadata
from pathlib import PurePath
from typing import Any

import numpy as np

import skelgen
from skelgen.app.advice import doubtful_share
from skelgen.app.drawing import measures, svg
from skelgen.app.drawing.graph import CostGraph, find_cost_graph
from skelgen.app.drawing.scales import limb_colour
from skelgen.app.drawing.wording import digits, duration, listed, millimetres, percent, plain
from skelgen.app.report.curves import deviation_bars, points_figure, residual_figure
from skelgen.app.report.joints import joints_content
from skelgen.app.report.labels import labels_content
from skelgen.app.report.pictures import cost_figure, deviation_figure, gaps_figure
from skelgen.app.report.play import play_content
from skelgen.app.report.skeleton import graph_figure, pose_figures, sign_figure, tree_figure
from skelgen.app.report.stages import stage_rows
from skelgen.app.tables import column_rows
from skelgen.kinematics.gap_filling.filling import fill_project
from skelgen.model import Limbs, PointCloud, Poses, Project
from skelgen.model.filled import PositionSource
from skelgen.model.skeleton import JOINT_TYPES
from skelgen.progress import SILENT, Monitor, counted

Content = dict[str, Any]
_LIBRARIES = ("numpy", "scipy")

_KIND_WORDS = {
    "PointCloud": "unlabelled points",
    "Trajectories": "labelled markers",
    "Poses": "bodies with position and orientation",
}
_SOURCE_WORDS = {
    PositionSource.LIMB: "Filled from limb",
    PositionSource.JOINT: "Filled with joint",
    PositionSource.INTERPOLATED: "Interpolated",
    PositionSource.PATTERN: "By another marker",
}
_SIGN_SIDE = 18.0


def report_content(project: Project, monitor: Monitor = SILENT) -> Content:
    """Return everything that the template shows; the keys of sections are missing where a stage has not run.

    Parameters
    ----------
    project : Project
        Any project, from a bare take to a fitted skeleton.
    monitor : Monitor
        Receives progress; may cancel.
    """
    libraries = [(name, metadata.version(name)) for name in _LIBRARIES]
    content: Content = {
        "title": project.name or "take without a name",
        "sentences": _sentences(project),
        "tiles": _tiles(project),
        "input": _input(project),
        "notices": _notices(project),
        "stages": stage_rows(project),
        "versions": [("skelgen", skelgen.__version__), *libraries, ("Python", platform.python_version())],
        "seed": project.seed,
        "colours": _colours(project),
    }
    if play := play_content(project):
        content["play"] = play
    if project.has("labels") and project.trajectories.n_frames and project.trajectories.n_markers:
        content["gaps"] = _gaps(project, monitor)
        if project.has_labelling:
            content["labels"] = labels_content(project)
    if project.has("limbs") and project.limbs.n_limbs:
        content["limbs"] = _limbs(project)
    if project.has("joints") and project.topology.n_joints:
        graph, lengths = find_cost_graph(project), measures.joint_lengths(project)
        content |= {"tree": _tree(project, graph, lengths)} | joints_content(project, graph, lengths)
    if project.has("skeleton") and project.skeleton.n_limbs:
        content |= {"pose": pose_figures(project)}
    if project.has("skeleton") and np.isfinite(project.motion.residuals).any():
        content |= {"deviations": _deviations(project)}
    return content


def view_content(project: Project) -> Content | None:
    """Return what a page with the view alone shows; None if nothing is ever seen.

    Parameters
    ----------
    project : Project
        Any project, from a bare take to a fitted skeleton.
    """
    play = play_content(project)
    title = project.name or "take without a name"
    if play is None:
        return None
    return {"title": title, "sentence": _take_sentence(project), "colours": _colours(project), "play": play}


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
    n_doubtful, n_open, by_set = len(topology.doubtful), 0, ""
    if project.has("skeleton"):
        n_by_set = sum(joint.is_placed_by_marker_set for joint in project.skeleton.joints)
        by_set = f"; the marker set places {n_by_set} of them" if n_by_set else ""
        n_open = sum(not joint.is_determined for joint in project.skeleton.joints)
    doubts = f" {counted(n_doubtful, 'edge')} of the tree may be another." if n_doubtful else ""
    doubts += f" The motion does not determine where {counted(n_open, 'joint')} lie{by_set}." if n_open else ""
    shape = "a tree" if len(topology.roots) == 1 else f"{len(topology.roots)} separate trees"
    return f"{joints} connect them to {shape} with {roots} as root.{_bodies(project)}{doubts}"


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
    tiles = [(str(project.take.n_frames), "frames"), (f"{plain(project.take.rate)} Hz", "frame rate")]
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


def _input(project: Project) -> Content:
    take = project.take
    facts = [("Name", take.name or "–"), ("Content", _KIND_WORDS[type(take).__name__])]
    suffix = PurePath(take.name).suffix
    if suffix:
        facts.append(("File suffix", suffix))
    facts += [("Frames", str(take.n_frames)), ("Rate", f"{plain(take.rate)} Hz")]
    facts.append(("Duration", _length_in_time(project)))
    if isinstance(take, PointCloud):
        per_frame = take.points_per_frame
        spread = f"{per_frame.min()} to {per_frame.max()}" if take.n_frames else "–"
        facts += [("Points", str(take.n_points)), ("Points per frame", spread)]
        return {"facts": facts, "figure": points_figure(take) if take.n_points else ""}
    if isinstance(take, Poses):
        return {"facts": [*facts, ("Bodies", str(take.n_bodies))], "figure": ""}
    return {"facts": [*facts, ("Markers", str(take.n_markers))], "figure": ""}


def _gaps(project: Project, monitor: Monitor) -> Content:
    """Timeline and facts; with a skeleton, what the gaps can be filled from."""
    facts = _gap_facts(project)
    if not project.has("skeleton") or project.trajectories.seen.all():
        return {"figure": gaps_figure(project), "facts": facts, "can_fill": False}
    filled = fill_project(project, monitor)
    for source, words in _SOURCE_WORDS.items():
        stds = filled.std[filled.source == source]
        if len(stds):
            facts.append((words, f"{len(stds)} (± {millimetres(float(np.median(stds)))})"))
    return {"figure": gaps_figure(project, filled), "facts": facts, "can_fill": True}


def _gap_facts(project: Project) -> list[tuple[str, str]]:
    rows = column_rows(project.trajectories)
    longest = max(rows, key=lambda row: row["longest_gap"] or 0)
    complete = sum(not row["gaps"] for row in rows)
    facts = [
        ("Seen", percent(float(project.trajectories.seen.mean()))),
        ("Gaps", str(sum(row["gaps"] or 0 for row in rows))),
        ("Markers without a gap", f"{complete} of {len(rows)}"),
    ]
    if frames := longest["longest_gap"]:
        time = duration(frames / project.trajectories.rate)
        facts.append(("Longest gap", f"{counted(frames, 'frame')} ({time}) at {longest['name']}"))
    return facts


def _notices(project: Project) -> list[tuple[str, str]]:
    notices = [("reading", sentence) for sentence in project.take.notices]
    if project.has("labels"):
        of_take = set(project.take.notices)
        notices += [("labels", sentence) for sentence in project.trajectories.notices if sentence not in of_take]
    for stage, report in project.reports.items():
        notices += [(stage, sentence) for sentence in report.notices]
    return list(dict.fromkeys(notices))


def _limbs(project: Project) -> Content:
    names, parents = project.trajectories.names, project.topology.parents if project.has("joints") else None
    rows, doubts = [], _doubts(project.limbs)
    for limb in measures.limb_order(project):
        markers = project.limbs.markers_of(limb)
        parent = "" if parents is None else "root" if parents[limb] < 0 else str(parents[limb])
        inside = project.limbs.distance_deviation[np.ix_(markers, markers)][np.triu_indices(len(markers), 1)]
        inside = inside[~np.isnan(inside)]
        mean = digits(float(inside.mean())) if len(inside) else "–"
        on_limb = [(names[marker], doubts.get(int(marker), "")) for marker in markers]
        called = project.limbs.names[limb].removeprefix(f"limb{limb}")
        rows.append({"limb": limb, "called": called, "parent": parent, "names": on_limb, "inside": mean})
    return {
        "rows": rows,
        "has_parents": parents is not None,
        "left_out": [names[marker] for marker in project.limbs.left_out],
        "figure": deviation_figure(project),
    }


def _doubts(limbs: Limbs) -> dict[int, str]:
    """For each marker that may be on another limb: how likely it is on its own, and on the next."""
    rivals, shares = limbs.rivals
    others = [limbs.called(limb) if limb >= 0 else "alone" for limb in rivals.tolist()]
    return {
        marker: f"{100 * limbs.probability[marker]:.0f} %, {others[marker]} {100 * shares[marker]:.0f} %"
        for marker in limbs.doubtful.tolist()
    }


def _tree(project: Project, graph: CostGraph, lengths: list[measures.Length]) -> Content:
    used = {joint.kind for joint in project.skeleton.joints} if project.has("skeleton") else set()
    signs = []
    for kind in (kind for kind in JOINT_TYPES if kind in used):
        sign, label = sign_figure(kind, _SIGN_SIDE / 2, _SIGN_SIDE / 2), f"sign of a {kind} joint"
        signs.append((kind, svg.drawing(_SIGN_SIDE, _SIGN_SIDE, label, sign, least=_SIGN_SIDE)))
    return {
        "figure": tree_figure(project, lengths),
        "signs": signs,
        "graph": graph_figure(project, graph),
        "matrix": cost_figure(project),
    }


def _deviations(project: Project) -> Content:
    order = measures.subtree_markers(project)
    rows = measures.marker_deviations(project.trajectories, project.limbs, project.motion, order)
    groups: list[Content] = []
    for limb in measures.limb_order(project):
        own = [row for row in rows if row.limb == limb]
        values = project.motion.residuals[:, [row.marker for row in own]]
        mean, rms, largest = measures.spread_of(values[~np.isnan(values)])
        whole = {"mean": digits(mean), "rms": digits(rms), "largest": digits(largest)}
        shown = [_deviation_row(project, row) for row in own]
        groups.append({"limb": limb, "called": project.limbs.called(limb), "rows": shown, "whole": whole})
    return {
        "groups": groups,
        "bars": deviation_bars([row for row in rows if row.limb >= 0]),
        "residual": residual_figure(project.motion),
        "interpolated": _interpolated(project),
    }


def _deviation_row(project: Project, row: measures.MarkerDeviation) -> Content:
    stds = project.skeleton.offset_std
    place = "–" if stds is None else digits(float(stds[row.marker].max()), 2)
    numbers = {"mean": digits(row.mean), "rms": digits(row.rms), "largest": digits(row.largest)}
    return {"name": row.name, "seen": percent(row.seen), "place": place} | numbers


def _interpolated(project: Project) -> str:
    unseen = ~project.motion.limb_seen
    if not unseen.any():
        return "Every limb's rotation rests on markers seen in the frame, in every frame."
    worst = int(unseen.sum(axis=0).argmax())
    return (
        f"{percent(float(unseen.mean()))} of the limb rotations are interpolated in time because too few markers were "
        f"seen; most often {project.limbs.called(worst)}, in {counted(int(unseen[:, worst].sum()), 'frame')}."
    )
