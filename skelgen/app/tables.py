"""What was found, as rows of plain values: printed as tables, dumped as JSON."""

from typing import NotRequired, TypedDict, cast

import numpy as np
from skelgen_formats.lines import Sample

from skelgen.app.advice import advice_on, doubtful_share, left_out_share, open_questions
from skelgen.app.first_look import TakeFacts, account_of
from skelgen.app.stage_summary import stage_notices
from skelgen.geometry.up_axis import find_up
from skelgen.kinematics.inverse.loop_closure import loop_gaps
from skelgen.kinematics.inverse.motion import angle_ranges
from skelgen.kinematics.joints.observability import observed_joints
from skelgen.model import Joint, PointCloud, Poses, Project, Take
from skelgen.model.arrays import Floats, runs_of
from skelgen.model.limbs import with_names_of_limbs
from skelgen.model.placed_joints import place_of
from skelgen.model.skeleton import joint_between

Cell = str | int | float | bool | list[str] | list[float] | None
"""What a table shows, and JSON holds."""

Row = dict[str, Cell]
"""Cells of a table by column."""


class ColumnRow(TypedDict):
    """A marker or body: frames that show it, number of gaps, longest gap [frames]; None where frames were left out."""

    name: str
    seen: int
    gaps: int | None
    longest_gap: int | None


class LabellingFacts(TypedDict):
    """How sure labels are, and what could be done about it; keys of what a take does not have are missing.

    Attributes
    ----------
    markers, doubtful_spans : int
        How many.
    doubtful_share : float
        Part of the positions that is doubtful.
    advice, questions : list of str
        What could be done, and what the user could say.
    left_out : int
        Points that went to no marker, of unlabelled takes.
    left_out_share : float
        Their part of all points.
    tracklets, classic_markers, classic_agreement : int, int, float
        Pieces of tracks, markers that the classic method finds, and part of the points on which both methods agree.
    """

    markers: int
    doubtful_spans: int
    doubtful_share: float
    advice: list[str]
    questions: list[str]
    left_out: NotRequired[int]
    left_out_share: NotRequired[float]
    tracklets: NotRequired[int]
    classic_markers: NotRequired[int]
    classic_agreement: NotRequired[float]


class Spread(TypedDict):
    """Mean, root mean square, high percentile and maximum of residuals [mm]; None where nothing was measured."""

    mean_mm: float | None
    rms_mm: float | None
    p95_mm: float | None
    max_mm: float | None


class ProjectTables(TypedDict):
    """What a project holds, as ``--json`` prints it; tables of stages that have not run are missing.

    Attributes
    ----------
    take : TakeFacts
        The take.
    seed : int
        Of every random choice.
    stages : list of Row
        Name, seconds and notices of each stage that has run.
    labelling : LabellingFacts
        How sure labels are.
    limbs, membership, bodies, joints, joint_spans, angles, closed_loops, lengths : list of Row
        One row each.
    loops : list of str
        Joints that would close loops.
    residuals : Spread
        Of all markers.
    """

    take: TakeFacts
    seed: int
    stages: list[Row]
    labelling: NotRequired[LabellingFacts]
    limbs: NotRequired[list[Row]]
    membership: NotRequired[list[Row]]
    bodies: NotRequired[list[Row]]
    joints: NotRequired[list[Row]]
    loops: NotRequired[list[str]]
    joint_spans: NotRequired[list[Row]]
    angles: NotRequired[list[Row]]
    closed_loops: NotRequired[list[Row]]
    lengths: NotRequired[list[Row]]
    residuals: NotRequired[Spread]


ALL = Sample()
"""Nothing was left out."""

_HIGH_PERCENTILE = 95.0


def take_facts(take: Take, sample: Sample = ALL) -> TakeFacts:
    """Return kind, counts, rate, duration and extent of a take.

    Parameters
    ----------
    take : PointCloud, Trajectories or Poses
        The take, or evenly spread frames of it.
    sample : Sample
        What was left out when it was read: then all but the count of frames, rate and duration are estimates.
    """
    positions = _positions(take)
    n_frames, rate = take.n_frames + sample.n_left_out, sample.rate or take.rate
    seen = positions[~np.isnan(positions[:, 0])]
    return {
        "name": take.name,
        "kind": {"PointCloud": "points", "Trajectories": "markers", "Poses": "poses"}[type(take).__name__],
        "frames": n_frames,
        "sampled_frames": take.n_frames if sample.n_left_out else None,
        "rate_hz": rate,
        "seconds": max(n_frames - 1, 0) / rate,
        "count": _count(take, n_frames),
        "low_mm": seen.min(axis=0).tolist() if len(seen) else None,
        "high_mm": seen.max(axis=0).tolist() if len(seen) else None,
        **account_of(take),
        "notices": list(take.notices),
    }


def column_rows(take: Take, sample: Sample = ALL) -> list[ColumnRow]:
    """Return one row per marker or body.

    Parameters
    ----------
    take, sample
        As of `take_facts`; of a sample frames seen are estimated, and gaps unknown (None).
    """
    if isinstance(take, PointCloud):
        return []
    seen = ~np.isnan(take.world_from_body[..., 0, 0]) if isinstance(take, Poses) else take.seen
    n_frames, rows = take.n_frames + sample.n_left_out, list[ColumnRow]()
    for name, column in zip(take.names, seen.T, strict=True):
        row: ColumnRow = {"name": name, "seen": int(column.sum()), "gaps": None, "longest_gap": None}
        if sample.n_left_out:
            row["seen"] = round(float(column.mean()) * n_frames)
        else:
            gaps = [stop - start for start, stop in runs_of(~column)]
            row["gaps"], row["longest_gap"] = len(gaps), max(gaps, default=0)
        rows.append(row)
    return rows


def project_tables(project: Project, sample: Sample = ALL) -> ProjectTables:
    """Return the tables of everything that a project holds: stages, limbs, joints, lengths, residuals.

    Parameters
    ----------
    project : Project
        What they are of.
    sample : Sample
        As of `take_facts`.
    """
    stages: list[Row] = [
        {"stage": name, "seconds": one.seconds, "notices": [*stage_notices(project, name)]}
        for name, one in project.reports.items()
    ]
    facts, up = take_facts(project.take, sample), find_up(project)
    facts["up"], facts["up_sure"], facts["height_mm"] = up.axis, up.sure, up.height
    tables: ProjectTables = {"take": facts, "seed": project.seed, "stages": stages}
    if project.has_labelling:
        tables["labelling"] = _labelling_facts(project)
    if project.has("limbs"):
        tables["limbs"] = _limb_rows(project)
        tables["membership"] = _membership_rows(project)
    if project.has("joints"):
        tables["bodies"] = _body_rows(project)
        tables["joints"] = _joint_rows(project)
        names = project.limbs.names
        tables["loops"] = [joint_between(names[first], names[second]) for first, second in project.topology.loops]
        tables["joint_spans"] = _span_rows(project)
    if project.has("skeleton"):
        tables["angles"] = _angle_rows(project)
        tables["closed_loops"] = _loop_rows(project)
        tables["lengths"] = _length_rows(project)
        tables["residuals"] = _spread(project.motion.residuals)
    return tables


def _labelling_facts(project: Project) -> LabellingFacts:
    labelling = project.labelling
    facts: LabellingFacts = {
        "markers": project.trajectories.n_markers,
        "doubtful_spans": len(labelling.doubts),
        "doubtful_share": doubtful_share(labelling),
        "advice": list(advice_on(project)),
        "questions": [one.sentence(project.trajectories.names) for one in open_questions(project)],
    }
    if isinstance(project.take, PointCloud):
        facts["left_out"], facts["left_out_share"] = int(labelling.left_out.sum()), left_out_share(project)
    if labelling.tracklets is not None:
        facts["tracklets"] = labelling.tracklets.n_tracklets
    if labelling.classic is not None:
        facts["classic_markers"] = labelling.classic.n_markers
        facts["classic_agreement"] = labelling.classic.share
    return facts


def _limb_rows(project: Project) -> list[Row]:
    rows = []
    for limb in range(project.limbs.n_limbs):
        markers = project.limbs.markers_of(limb)
        on_limb = [project.trajectories.names[marker] for marker in markers]
        row: Row = {"limb": limb, "name": project.limbs.names[limb], "parent": None, "markers": on_limb}
        doubtful = [int(marker) for marker in project.limbs.doubtful if marker in markers]
        row["doubtful"] = [project.trajectories.names[marker] for marker in doubtful]
        if project.has("joints"):
            row["parent"] = int(project.topology.parents[limb])
        if project.has("skeleton"):
            row |= cast("Row", _spread(project.motion.residuals[:, markers]))
        rows.append(row)
    return rows


def _membership_rows(project: Project) -> list[Row]:
    """One row per marker on a limb: how likely it is there, and where it is most likely otherwise, None for alone."""
    limbs, (rivals, shares) = project.limbs, project.limbs.rivals
    if limbs.membership is None:
        return []
    return [
        {
            "marker": project.trajectories.names[marker],
            "limb": int(limbs.limb_of_marker[marker]),
            "probability": float(limbs.probability[marker]),
            "rival": int(rivals[marker]) if rivals[marker] >= 0 else None,
            "rival_probability": float(shares[marker]),
        }
        for marker in np.flatnonzero(~np.isnan(limbs.probability)).tolist()
    ]


def _body_rows(project: Project) -> list[Row]:
    return [
        {
            "body": body.name,
            "root": project.limbs.names[body.root],
            "limbs": len(body.limbs),
            "markers": len(body.markers),
            "seen_share": float(project.trajectories.seen[:, body.markers].any(axis=1).mean()),
            "probability": body.probability,
        }
        for body in project.bodies
    ]


def _joint_rows(project: Project) -> list[Row]:
    topology, names = project.topology, project.limbs.names
    margins, rivals = topology.margins, topology.rivals
    observed = observed_joints(project.skeleton, project.motion) if project.has("skeleton") else ()
    rows = []
    for index, (parent, child) in enumerate(topology.edges.tolist()):
        row: Row = {
            "joint": joint_between(names[parent], names[child]),
            "parent": parent,
            "child": child,
            "cost_mm2": float(topology.values[index]),
            "margin_mm2": None if np.isnan(margins[index]) else float(margins[index]),
            "rival": None if rivals[index, 0] < 0 else joint_between(*(names[limb] for limb in rivals[index])),
            "probability": None if topology.edge_probability is None else float(topology.edge_probability[index]),
            "rival_probability": None
            if topology.rival_probability is None
            else float(topology.rival_probability[index]),
        }
        if project.has("skeleton"):
            joint = project.skeleton.joints[index]
            row["kind"] = joint.kind
            row["std_mm"] = _across(joint, joint.place_covariance)
            row["child_std_mm"] = _across(joint, joint.covariance_in_child)
            row["axis"] = joint.axis.tolist() if joint.axis is not None else None
            row["axis_std_deg"] = None if joint.axis_std is None else float(np.rad2deg(np.linalg.norm(joint.axis_std)))
            row["turns_deg"] = [round(float(turn), 1) for turn in np.rad2deg(observed[index].motion.ranges)]
            row["is_determined"] = joint.is_determined
            row["is_fully_determined"] = joint.is_fully_determined
            row["is_placed_by_marker_set"] = joint.is_placed_by_marker_set
            row["place"] = place_of(joint).value
            row["not_determined"] = with_names_of_limbs(observed[index].sentence, project.limbs) or None
            row["to_do"] = with_names_of_limbs(observed[index].advice, project.limbs) or None
        rows.append(row)
    return rows


def _span_rows(project: Project) -> list[Row]:
    """One row per joint that holds for a part of the take only."""
    names = project.limbs.names
    return [
        {
            "joint": joint_between(*(names[limb] for limb in span.limbs)),
            "first_frame": span.first_frame,
            "last_frame": span.last_frame,
            "is_fixed": span.is_fixed,
            "gap_mm": span.gap,
            "gap_beyond_mm": span.gap_beyond,
        }
        for span in project.topology.spans
    ]


def _across(joint: Joint, covariance: Floats | None) -> float | None:
    """Standard deviation of a place [mm], of hinges across their axis: along it, it is a choice."""
    if covariance is None:
        return None
    axis = joint.free_axis()
    return float(np.sqrt(max(np.trace(covariance) - axis @ covariance @ axis, 0.0)))


def _angle_rows(project: Project) -> list[Row]:
    """One row per angle of a joint: its range, mean and the median of its standard deviations [deg]."""
    ranges = angle_ranges(project.skeleton, project.motion, project.trajectories.positions)
    rows = []
    for joint, angles in zip(project.skeleton.joints, ranges, strict=True):
        for angle in angles:
            row: Row = {"joint": project.skeleton.joint_name(joint), "kind": joint.kind, "angle": angle.name}
            for name in ("low", "mean", "high", "std"):
                value = float(np.rad2deg(getattr(angle, name)))
                row[f"{name}_deg"] = None if np.isnan(value) else value
            rows.append(row)
    return rows


def _loop_rows(project: Project) -> list[Row]:
    """One row per loop that was closed."""
    gaps = loop_gaps(project.skeleton, project.motion)
    return [
        {
            "joint": project.skeleton.joint_name(joint),
            "std_mm": _across(joint, joint.covariance),
            "child_std_mm": _across(joint, joint.covariance_in_child),
            "gap_mm": float(np.sqrt((gap**2).mean())),
        }
        for joint, gap in zip(project.skeleton.loops, gaps.T, strict=True)
    ]


def _length_rows(project: Project) -> list[Row]:
    raw, skeleton, rows = project.topology.raw_joint_positions, project.skeleton, list[Row]()
    for index, ((first, second), length) in enumerate(skeleton.lengths.items()):
        measured = np.linalg.norm(raw[:, first] - raw[:, second], axis=1)
        limb = skeleton.limb_of_length((first, second))
        rows.append(
            {
                "limb": limb,
                "name": skeleton.limb_names[limb],
                "from_joint": skeleton.joint_names[first],
                "to_joint": skeleton.joint_names[second],
                "length_mm": length,
                "std_mm": None if skeleton.length_std is None else float(skeleton.length_std[index]),
                "spread_mm": None if np.isnan(measured).all() else float(np.nanstd(measured)),
            }
        )
    return rows


def _spread(residuals: Floats) -> Spread:
    seen = residuals[~np.isnan(residuals)]
    return {
        "mean_mm": float(seen.mean()) if len(seen) else None,
        "rms_mm": float(np.sqrt((seen**2).mean())) if len(seen) else None,
        "p95_mm": float(np.percentile(seen, _HIGH_PERCENTILE)) if len(seen) else None,
        "max_mm": float(seen.max()) if len(seen) else None,
    }


def _positions(take: Take) -> Floats:
    if isinstance(take, PointCloud):
        return take.points
    positions = take.world_from_body[..., :3, 3] if isinstance(take, Poses) else take.positions
    return positions.reshape(-1, 3)


def _count(take: Take, n_frames: int) -> int:
    if isinstance(take, PointCloud):
        return round(take.n_points * n_frames / max(take.n_frames, 1))
    return take.n_bodies if isinstance(take, Poses) else take.n_markers
