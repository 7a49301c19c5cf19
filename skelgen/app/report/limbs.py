"""What the report says of limbs: their markers, which of them are doubtful, and how far each is from the skeleton."""

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import measures
from skelgen.app.drawing.wording import digits, percent
from skelgen.app.report.curves import deviation_bars, residual_figure
from skelgen.app.report.pictures import deviation_figure
from skelgen.model import Limbs, Project
from skelgen.model.arrays import Floats
from skelgen.progress import counted, listed


@dataclass(frozen=True)
class LimbRow:
    """A limb, as the report words it.

    Attributes
    ----------
    limb : int
        Index of the limb.
    called, parent : str
        Its name, empty where it has none; index of its parent, or ``root``, empty before the tree.
    names : list of tuple of str
        Each marker's name, and how likely it is on this limb and on the next, empty where that is not in doubt.
    inside : str
        Mean deviation of the distances between its markers [mm].
    """

    limb: int
    called: str
    parent: str
    names: list[tuple[str, str]]
    inside: str


@dataclass(frozen=True, eq=False)
class LimbsContent:
    """The section of limbs.

    Attributes
    ----------
    rows : list of LimbRow
        Every limb.
    has_parents : bool
        Whether there is a tree.
    left_out : list of str
        Markers on no limb.
    figure : Markup
        Deviations of all distances between markers.
    """

    rows: list[LimbRow]
    has_parents: bool
    left_out: list[str]
    figure: Markup


def limbs_content(project: Project) -> LimbsContent:
    """Return the section of limbs of a project that has limbs."""
    names, parents = project.trajectories.names, project.topology.parents if project.has("joints") else None
    rows, doubts = [], _doubts(project.limbs)
    for limb in measures.limb_order(project):
        markers = project.limbs.markers_of(limb)
        inside = project.limbs.distance_deviation[np.ix_(markers, markers)][np.triu_indices(len(markers), 1)]
        inside = inside[~np.isnan(inside)]
        rows.append(
            LimbRow(
                limb=limb,
                called=project.limbs.names[limb].removeprefix(f"limb{limb}"),
                parent="" if parents is None else "root" if parents[limb] < 0 else str(parents[limb]),
                names=[(names[marker], doubts.get(int(marker), "")) for marker in markers],
                inside=digits(float(inside.mean())) if len(inside) else "–",
            )
        )
    left_out = [names[marker] for marker in project.limbs.left_out]
    return LimbsContent(rows, parents is not None, left_out, deviation_figure(project))


def _doubts(limbs: Limbs) -> dict[int, str]:
    """For each marker that may be on another limb: how likely it is on its own, and on the next."""
    rivals, shares = limbs.rivals
    others = [limbs.called(limb) if limb >= 0 else "alone" for limb in rivals.tolist()]
    return {
        marker: f"{100 * limbs.probability[marker]:.0f} %, {others[marker]} {100 * shares[marker]:.0f} %"
        for marker in limbs.doubtful.tolist()
    }


@dataclass(frozen=True)
class DeviationGroup:
    """The markers of a limb against the skeleton.

    Attributes
    ----------
    limb : int
        Index of the limb.
    called : str
        What it is called.
    rows : list of MarkerDeviation
        Its markers.
    whole : tuple of float, mm
        Mean, root mean square and largest residual of all of them.
    """

    limb: int
    called: str
    rows: list[measures.MarkerDeviation]
    whole: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class DeviationsContent:
    """The sections of residuals over time, and of every marker.

    Attributes
    ----------
    groups : list of DeviationGroup
        Every limb.
    place_std : ndarray, shape (n_markers,), mm
        Largest standard deviation of each marker's place on its limb; NaN where it is not known.
    bars, residual : Markup
        Figures of the markers' mean residuals, and of all residuals over time.
    interpolated : str
        How many rotations of limbs rest on no marker of their frame.
    """

    groups: list[DeviationGroup]
    place_std: Floats
    bars: Markup
    residual: Markup
    interpolated: str


def deviations_content(project: Project) -> DeviationsContent:
    """Return the sections of residuals of a project that has a skeleton."""
    order, stds = measures.subtree_markers(project), project.skeleton.offset_std
    rows = measures.marker_deviations(project.trajectories, project.limbs, project.motion, order)
    groups = []
    for limb in measures.limb_order(project):
        own = [row for row in rows if row.limb == limb]
        values = project.motion.residuals[:, [row.marker for row in own]]
        whole = measures.spread_of(values[~np.isnan(values)])
        groups.append(DeviationGroup(limb, project.limbs.called(limb), own, whole))
    return DeviationsContent(
        groups=groups,
        place_std=np.full(project.trajectories.n_markers, np.nan) if stds is None else stds.max(axis=1),
        bars=deviation_bars([row for row in rows if row.limb >= 0]),
        residual=residual_figure(project.motion),
        interpolated=_interpolated(project),
    )


def _interpolated(project: Project) -> str:
    unseen, never = project.motion.interpolated, [project.limbs.called(limb) for limb in project.motion.never_seen]
    untold = f" No frame tells all turns of {listed(never)}: too few markers." if never else ""
    if not unseen.any():
        others = "other " if never else ""
        return f"Every {others}limb's rotation rests on markers seen in the frame, in every frame.{untold}"
    worst = int(unseen.sum(axis=0).argmax())
    return (
        f"{percent(float(unseen.mean()))} of the limb rotations are interpolated in time because too few markers were "
        f"seen; most often {project.limbs.called(worst)}, in {counted(int(unseen[:, worst].sum()), 'frame')}.{untold}"
    )
