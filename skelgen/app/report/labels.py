"""What the report says of the labels: how sure they are, where they are not, and what the user could do."""

from __future__ import annotations

from skelgen.app.advice import REMEDIES, advice_on, doubtful_share, left_out_share
from skelgen.app.drawing.wording import counted, duration, percent
from skelgen.app.report.timelines import confidence_figure
from skelgen.app.report.tracklets import marker_tracks_figure, tracks_figure
from skelgen.model import Labelling, PointCloud, Project
from skelgen.model.labelling import Doubt, Finding, seen_runs

_MOST_ROWS = 40
"""Doubtful spans in the table, the longest; the others are counted."""

_FINDING_WORDS = {"exchanged": "Labels exchanged", "moved": "Label on another marker", "slipped": "Marker slipped"}


def labels_content(project: Project) -> dict[str, object]:
    """Return what the template shows of the labels of a project that knows how sure they are."""
    labelling = project.labelling
    drawn = labelling.tracklets if labelling.tracklets is not None and labelling.tracklets.n_parts else None
    shown = sorted(labelling.doubts, key=lambda doubt: doubt.first_frame - doubt.last_frame)[:_MOST_ROWS]
    return {
        "facts": _facts(project),
        "advice": advice_on(project),
        "rows": [_row(project, doubt) for doubt in sorted(shown, key=lambda doubt: doubt.first_frame)],
        "findings": [_finding_row(project, finding) for finding in labelling.findings[:_MOST_ROWS]],
        "more_findings": max(len(labelling.findings) - _MOST_ROWS, 0),
        "more": len(labelling.doubts) - len(shown),
        "confidence": confidence_figure(project),
        "tracks": tracks_figure(project, drawn) if drawn else "",
        "marker_tracks": marker_tracks_figure(project, drawn) if drawn else "",
        "classic": _comparison(project, labelling),
    }


def _facts(project: Project) -> list[tuple[str, str]]:
    labelling = project.labelling
    facts = []
    if labelling.tracklets is not None:
        facts += [
            ("Tracklets", str(labelling.tracklets.n_tracklets)),
            ("of which left out", str(labelling.tracklets.n_left_out)),
            ("of which divided", str(labelling.tracklets.n_divided)),
            ("Stretches of markers", str(len(seen_runs(project.trajectories.seen)[0]))),
        ]
    if isinstance(project.take, PointCloud):
        left_out = f"{int(labelling.left_out.sum())} ({percent(left_out_share(project))})"
        facts.append(("Points left out", left_out))
    facts.append(("Doubtful spans", str(len(labelling.doubts))))
    facts.append(("Doubtful positions", percent(doubtful_share(labelling))))
    facts.append(("Pairs that no distance distinguishes", str(len(labelling.twins))))
    return facts


def _finding_row(project: Project, finding: Finding) -> dict[str, str]:
    rate = project.trajectories.rate
    return {
        "kind": _FINDING_WORDS[finding.kind],
        "names": " → ".join(finding.names),
        "frames": _span(str(finding.first_frame), str(finding.last_frame)),
        "time": _span(duration(finding.first_frame / rate), duration(finding.last_frame / rate)),
        "evidence": finding.evidence,
        "outcome": finding.outcome,
    }


def _row(project: Project, doubt: Doubt) -> dict[str, str]:
    rate = project.trajectories.rate
    return {
        "name": project.trajectories.names[doubt.marker],
        "frames": _span(str(doubt.first_frame), str(doubt.last_frame)),
        "time": _span(duration(doubt.first_frame / rate), duration(doubt.last_frame / rate)),
        "confidence": percent(doubt.confidence),
        "reason": doubt.reason,
        "remedy": REMEDIES[doubt.kind],
    }


def _span(first: str, last: str) -> str:
    return first if first == last else f"{first} – {last}"


def _comparison(project: Project, labelling: Labelling) -> list[tuple[str, str, str, str]]:
    """Rows of method, markers, points with a marker, agreement; empty if there is nothing to compare."""
    classic = labelling.classic
    if classic is None:
        return []
    own = project.trajectories
    method = str(project.reports["labels"].parameters.get("method", "this run")) if "labels" in project.reports else ""
    counts = [counted(each.n_markers, "marker") for each in (own, classic)]
    return [
        (method, counts[0], str(int(own.seen.sum())), ""),
        (f"{classic.method} (classic)", counts[1], str(classic.n_points), percent(classic.share)),
    ]
