"""An evaluation as tables of texts, for the command line, the report and the eye."""

from __future__ import annotations

from dataclasses import dataclass

from skelgen.evaluation.evaluation import Evaluation
from skelgen.evaluation.joints import LengthScore

_NOTHING = "-"


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


def evaluation_lines(evaluation: Evaluation) -> tuple[str, ...]:
    """Return the tables of an evaluation as lines of plain text, with an empty line between two tables."""
    blocks = [table.lines() for table in evaluation_tables(evaluation)]
    return tuple(line for index, block in enumerate(blocks) for line in (("", *block) if index else block))


def _overview(evaluation: Evaluation) -> Table:
    rows: list[tuple[str, str]] = []
    if (labels := evaluation.labels) is not None:
        rows.append(("label accuracy (IDF1)", f"{labels.idf1:.4f}"))
        rows.append(("label precision, recall", f"{labels.precision:.4f}, {labels.recall:.4f}"))
        rows.append(("markers", f"{labels.n_markers_found} of {labels.n_markers_true}"))
    if (limbs := evaluation.limbs) is not None:
        exact = ", exact" if limbs.is_exact else f", {limbs.n_left_out} markers left out"
        rows.append(("limb agreement (adjusted Rand)", f"{limbs.adjusted_rand:.4f}{exact}"))
        rows.append(("limbs", f"{limbs.n_limbs_found} of {limbs.n_limbs_true}"))
    if (topology := evaluation.topology) is not None:
        n_true = len(topology.found) + len(topology.missed)
        rows.append(("joints of the true tree", f"{len(topology.found)} of {n_true}"))
        rows += [("missed joint", name) for name in topology.missed]
        rows += [("extra joint", name) for name in topology.extra]
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
