"""Scores of a result whose truth is known, and their tables for the command line, the report and the eye."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.evaluation import matching
from skelgen.evaluation.joints import (
    JointScore,
    LengthScore,
    MarkerScore,
    score_joints,
    score_lengths,
    score_markers,
    with_limits,
)
from skelgen.model import Poses, Project
from skelgen.model.arrays import Ints
from skelgen.progress import counted
from skelgen.simulation.truth import Truth

_NOTHING = "-"


@dataclass(frozen=True)
class Evaluation:
    """Scores of a result; what belongs to a stage that has not run is None or empty.

    Attributes
    ----------
    labels : LabelScore or None
        None also for a take that was labelled to begin with.
    limbs : LimbScore or None
        Agreement of the limbs.
    topology : TopologyScore or None
        Agreement of the tree.
    bodies : BodyScore or None
        Agreement of the bodies, of which each is a tree.
    spans : SpanScore or None
        Joints that hold for a part of the take only; None for takes of markers, in which none is sought.
    joints : tuple of JointScore
        One per joint that the result and the truth share.
    lengths : tuple of LengthScore
        One per pair of such joints on one limb.
    markers : tuple of MarkerScore
        One per marker that the skeleton carries.
    """

    labels: matching.LabelScore | None = None
    limbs: matching.LimbScore | None = None
    topology: matching.TopologyScore | None = None
    bodies: matching.BodyScore | None = None
    spans: matching.SpanScore | None = None
    joints: tuple[JointScore, ...] = ()
    lengths: tuple[LengthScore, ...] = ()
    markers: tuple[MarkerScore, ...] = ()

    @property
    def mean_joint_error(self) -> float | None:
        """Mean over the joints of their mean distance [mm] from the truth; None before the skeleton is fitted."""
        return _mean([joint.mean for joint in self.joints])

    @property
    def worst_joint_error(self) -> float | None:
        """Largest mean distance [mm] of a joint from the truth."""
        return max((joint.mean for joint in self.joints if joint.mean is not None), default=None)

    @property
    def mean_joint_bound(self) -> float | None:
        """Mean over the joints of the smallest possible mean distance [mm] (Cramer-Rao)."""
        return _mean([joint.bound for joint in self.joints])

    @property
    def times_bound(self) -> float | None:
        """Mean joint error in units of the mean bound, over the joints and frames that have one."""
        both = [(one.bound, one.times_bound) for one in self.joints if one.bound and one.times_bound is not None]
        total = sum(bound for bound, _ in both)
        return sum(bound * (times or 0.0) for bound, times in both) / total if total else None

    @property
    def coverage(self) -> float | None:
        """Mean over the joints of the part of predicted 95 % intervals that hold the truth."""
        return _mean([joint.coverage for joint in self.joints])

    @property
    def mean_length_error(self) -> float | None:
        """Mean over the lengths of their absolute error [mm]."""
        return _mean([abs(length.error) for length in self.lengths])

    @property
    def mean_marker_deviation(self) -> float | None:
        """Mean over the markers of their distance [mm] from the tracked positions."""
        return _mean([marker.from_tracked for marker in self.markers])

    @property
    def limb_deviations(self) -> dict[str, float | None]:
        """Mean distance [mm] of reconstructed from tracked markers of each limb, by name."""
        limbs = dict.fromkeys(marker.limb for marker in self.markers)
        return {limb: _mean([m.from_tracked for m in self.markers if m.limb == limb]) for limb in limbs}

    def as_mapping(self) -> dict[str, object]:
        """Return everything as plain values for JSON: numbers, texts, lists, None."""
        of_joints = ("mean_joint_error", "worst_joint_error", "mean_joint_bound", "times_bound", "coverage")
        figures = (*of_joints, "mean_length_error", "mean_marker_deviation", "limb_deviations")
        return {**dataclasses.asdict(self), "summary": {name: getattr(self, name) for name in figures}}


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def evaluate(project: Project, truth: Truth) -> Evaluation:
    """Compare a result with the truth, as far as its stages have run.

    Parameters
    ----------
    project : Project
        The result.
    truth : Truth
        What is true of its take, e.g. from `read_truth`.

    Raises
    ------
    InputError
        If the truth is that of another take.
    """
    take = project.take
    if take.n_frames != truth.n_frames:
        raise InputError(
            f"the truth has {counted(truth.n_frames, 'frame')}, the take {take.n_frames}: it belongs to another take"
        )
    if not project.has("labels"):
        return Evaluation()
    if project.trajectories.n_frames != truth.n_frames:
        raise InputError(
            f"the result has {counted(project.trajectories.n_frames, 'frame')} where the truth has {truth.n_frames}"
        )
    if isinstance(take, Poses):
        return _of_bodies(project, take.names, truth)
    true_of_marker, labels = matching.find_identity(project, truth)
    if not project.has("limbs"):
        return Evaluation(labels)
    limb_of_marker = project.limbs.limb_of_marker
    limbs = matching.score_limbs(limb_of_marker, true_of_marker, truth)
    if not project.has("joints"):
        return Evaluation(labels, limbs)
    true_of_limb = matching.match_limbs(limb_of_marker, true_of_marker, truth)
    topology = matching.score_topology(project.topology.edges, true_of_limb, truth)
    bodies = matching.score_bodies(limb_of_marker, project.topology.parents, true_of_marker, truth)
    found = Evaluation(labels, limbs, topology, bodies)
    return _with_motion_scores(found, project, truth, true_of_limb, true_of_marker)


def _of_bodies(project: Project, names: tuple[str, ...], truth: Truth) -> Evaluation:
    """Scores of tree and joints of bodies with orientation, which are known by their names."""
    unknown = [name for name in names if name not in truth.limb_names]
    if unknown:
        raise InputError(f"the truth has no limb {unknown[0]!r}: it belongs to another take")
    if not project.has("joints"):
        return Evaluation()
    true_of_limb = np.array([truth.limb_names.index(name) for name in names], dtype=np.intp)
    topology = matching.score_topology(project.topology.edges, true_of_limb, truth)
    spans = matching.score_spans(project.topology.spans, true_of_limb, truth)
    return _with_motion_scores(Evaluation(topology=topology, spans=spans), project, truth, true_of_limb, None)


def _with_motion_scores(
    found: Evaluation, project: Project, truth: Truth, true_of_limb: Ints, true_of_marker: Ints | None
) -> Evaluation:
    """Add the scores of joints, lengths and reconstructed markers, where these are known."""
    raw_of_joint = matching.match_joints(project.topology.edges, true_of_limb, truth)
    raw = project.topology.raw_joint_positions
    if not project.has("skeleton"):
        joints = score_joints(raw_of_joint, truth, raw=raw, fitted=None, types=())
        return dataclasses.replace(found, joints=joints)
    skeleton, motion = project.skeleton, project.motion
    edges = np.array([(joint.parent, joint.child) for joint in skeleton.joints], dtype=np.intp).reshape(-1, 2)
    true_of_joint = matching.match_joints(edges, true_of_limb, truth)
    same_joints = np.array_equal(true_of_joint, raw_of_joint)
    types = tuple(joint.kind for joint in skeleton.joints)
    fitted = motion.joint_positions
    joints = score_joints(true_of_joint, truth, raw=raw if same_joints else None, fitted=fitted, types=types)
    lengths = score_lengths(skeleton, fitted, true_of_joint, truth)
    if true_of_marker is None:
        return dataclasses.replace(found, joints=joints, lengths=lengths)
    joints = with_limits(joints, project, true_of_joint, true_of_marker, truth)
    markers = score_markers(project.trajectories, motion, true_of_marker, truth)
    return dataclasses.replace(found, joints=joints, lengths=lengths, markers=markers)


@dataclass(frozen=True)
class Table:
    """A table of texts.

    Attributes
    ----------
    title : str
        What it shows.
    columns : tuple of str
        Headings, with units.
    rows : tuple of tuple of str
        As many texts in each as there are columns.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def lines(self) -> tuple[str, ...]:
        """Return the table as lines of plain text, in aligned columns."""
        table = (self.columns, *self.rows)
        widths = [max(len(row[column]) for row in table) for column in range(len(self.columns))]
        padded = ("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)) for row in table)
        return (self.title, *(f"  {line}".rstrip() for line in padded))


def evaluation_tables(evaluation: Evaluation) -> tuple[Table, ...]:
    """Return the tables of an evaluation; what belongs to a stage that has not run is left out.

    Parameters
    ----------
    evaluation : Evaluation
        From `evaluate`.
    """
    tables = (_overview(evaluation), _joints(evaluation), _lengths(evaluation), _markers(evaluation))
    return tuple(table for table in tables if table.rows)


def _overview(evaluation: Evaluation) -> Table:
    rows: list[tuple[str, str]] = []
    if (labels := evaluation.labels) is not None:
        rows.append(("label accuracy (IDF1)", f"{labels.idf1:.4f}"))
        rows.append(("label precision, recall", f"{labels.precision:.4f}, {labels.recall:.4f}"))
        rows.append(("markers", f"{labels.n_markers_found} of {labels.n_markers_true}"))
    if (limbs := evaluation.limbs) is not None:
        exact = ", exact" if limbs.is_exact else f", {counted(limbs.n_left_out, 'marker')} left out"
        rows.append(("limb agreement (adjusted Rand)", f"{limbs.adjusted_rand:.4f}{exact}"))
        rows.append(("limbs", f"{limbs.n_limbs_found} of {limbs.n_limbs_true}"))
    if (topology := evaluation.topology) is not None:
        n_true = len(topology.found) + len(topology.missed)
        rows.append(("joints of the true tree", f"{len(topology.found)} of {n_true}"))
        rows += [("missed joint", name) for name in topology.missed]
        rows += [("extra joint", name) for name in topology.extra]
    if (bodies := evaluation.bodies) is not None and max(bodies.n_bodies_found, bodies.n_bodies_true) > 1:
        rows.append(("bodies", f"{bodies.n_bodies_found} of {bodies.n_bodies_true}"))
        rows.append(("part of the markers in the tree of their body", f"{bodies.share:.4f}"))
    if (spans := evaluation.spans) is not None and (spans.n_true or spans.n_extra):
        off = "" if spans.frames_off is None else f", frames off by {spans.frames_off} at most"
        rows.append(("joints that hold for a span", f"{spans.n_found} of {spans.n_true}{off}; {spans.n_extra} false"))
    figures = {
        "mean joint error [mm]": evaluation.mean_joint_error,
        "worst joint error [mm]": evaluation.worst_joint_error,
        "smallest possible mean joint error (Cramer-Rao) [mm]": evaluation.mean_joint_bound,
        "joint error in units of that bound": evaluation.times_bound,
        "part of predicted 95 % intervals that hold the truth": evaluation.coverage,
        "mean length error [mm]": evaluation.mean_length_error,
        "mean marker deviation [mm]": evaluation.mean_marker_deviation,
    }
    rows += [(name, _number(value)) for name, value in figures.items() if value is not None]
    return Table("Agreement with the truth", ("score", "value"), tuple(rows))


def _joints(evaluation: Evaluation) -> Table:
    figures = ("raw mean", "mean", "median", "maximum", "bound", "times bound", "predicted", "coverage")
    rows = []
    for joint in evaluation.joints:
        numbers = (_number(getattr(joint, name.replace(" ", "_"))) for name in figures)
        rows.append((joint.name, joint.kind_true, joint.kind_found or _NOTHING, *numbers))
    columns = ("joint", "true kind", "found kind", *figures)
    return Table("Joint errors [mm], hinges across their axis", columns, tuple(rows))


def _lengths(evaluation: Evaluation) -> Table:
    columns = ("limb", "from", "to", "true", "found", "error", "measured")
    rows = tuple((length.limb, length.first, length.second, *_length_texts(length)) for length in evaluation.lengths)
    return Table("Lengths [mm]", columns, rows)


def _length_texts(length: LengthScore) -> tuple[str, ...]:
    measured = "across hinges" if length.is_across_hinges else "between joints"
    return (*map(_number, (length.true, length.found, length.error)), measured)


def _markers(evaluation: Evaluation) -> Table:
    rows = tuple(
        (marker.limb or _NOTHING, marker.marker, _number(marker.from_tracked), _number(marker.from_true))
        for marker in evaluation.markers
    )
    columns = ("limb", "marker", "from tracked", "from true")
    return Table("Average deviation of the reconstructed markers [mm]", columns, rows)


def _number(value: float | None) -> str:
    return _NOTHING if value is None else f"{value:.6g}"
