"""Summary of a project as strict JSON: what was read, what was found, how well it fits, how long it took.

What has not been computed yet is null; so is every number that is not determined (NaN). Keys come in a fixed order.
"""

import dataclasses
import importlib.metadata
import json
import math
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.model import Limbs, PointCloud, Project, Skeleton, StageReport
from skelgen.model.arrays import Floats, Ints
from skelgen.model.limbs import with_names_of_limbs
from skelgen.model.placed_joints import place_of
from skelgen.model.questions import questions_on
from skelgen.progress import Monitor
from skelgen_formats.options import Format, Options, Writable

SCHEMA = "skelgen-summary-1"
_PACKAGES = {"skelgen": "skelgen-mocap"} | {name: name for name in ("numpy", "scipy", "scikit-learn", "numba")}


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write `summary` of a project, finished or not."""
    text = json.dumps(summary(_project(value)), indent=2, allow_nan=False)
    monitor.advance(1, 1)  # the last chance to cancel
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="ascii", newline="\n")


def _project(value: Writable) -> Project:
    if isinstance(value, Project):
        return value
    raise WriteError("summary-json holds the results of a project, not a take; run the stages first")


def summary(project: Project) -> dict[str, object]:
    """Return what the summary file holds: dicts, lists, texts and finite numbers; lengths in mm, times in s."""
    take = project.take
    counts = {"n_points": take.n_points} if isinstance(take, PointCloud) else {}
    result = {
        "schema": SCHEMA,
        "units": {"length": "mm", "angle": "rad", "time": "s", "rate": "Hz"},
        "versions": _versions(),
        "seed": project.seed,
        "take": {"name": take.name, "kind": type(take).__name__, **counts, "notices": take.notices},
        "n_frames": project.trajectories.n_frames if project.has("labels") else project.take.n_frames,
        "rate": project.trajectories.rate if project.has("labels") else project.take.rate,
        "labels": _labels(project) if project.has_labelling else None,
        "limbs": _limbs(project) if project.has("limbs") else None,
        "left_out_markers": _names(project, project.limbs.left_out) if project.has("limbs") else None,
        "bodies": _bodies(project) if project.has("joints") else None,
        "tree": _tree(project) if project.has("joints") else None,
        "joints": _joints(project) if project.has("skeleton") else None,
        "closed_loops": _loops(project.skeleton) if project.has("skeleton") else None,
        "lengths": _lengths(project.skeleton) if project.has("skeleton") else None,
        "residual_mean": _mean(project.motion.residuals) if project.has("skeleton") else None,
        "stages": {
            name: {"seconds": report.seconds, "parameters": report.parameters, "notices": _notices(project, report)}
            for name, report in project.reports.items()
        },
    }
    plain: dict[str, object] = _plain(result)
    return plain


def _notices(project: Project, report: StageReport) -> list[str]:
    """What a stage noticed, with the names that limbs got after it."""
    return [with_names_of_limbs(one, project.limbs) if project.has("limbs") else one for one in report.notices]


def _versions() -> dict[str, str | None]:
    versions: dict[str, str | None] = {"python": platform.python_version()}
    for package, distribution in _PACKAGES.items():
        try:
            versions[package] = importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:  # run from a checkout that is not installed
            versions[package] = None
    return versions


def _labels(project: Project) -> dict[str, object]:
    labelling, names = project.labelling, project.trajectories.names
    tracklets = labelling.tracklets
    return {
        "confidence": dict(zip(names, labelling.marker_confidence.tolist(), strict=True)),
        "doubtful_spans": [
            {
                "marker": names[doubt.marker],
                **_fields(doubt, "first_frame", "last_frame", "kind"),
                "rival": names[doubt.rival] if doubt.rival >= 0 else None,
                **_fields(doubt, "confidence", "reason"),
            }
            for doubt in labelling.doubts
        ],
        "questions": [
            {
                **_fields(question, "kind", "first_frame", "last_frame", "settles", "spans", "point", "position"),
                "markers": [names[marker] for marker in question.markers],
                "question": question.sentence(names),
            }
            for question in questions_on(labelling)
        ],
        "twins": [[names[marker] for marker in pair] for pair in labelling.twins],
        "n_points_left_out": labelling.left_out.sum(),
        "n_tracklets": tracklets.n_tracklets if tracklets is not None else None,
        "n_tracklets_left_out": tracklets.n_left_out if tracklets is not None else None,
        "label_errors": [dataclasses.asdict(finding) for finding in labelling.findings],
        "classic": dataclasses.asdict(labelling.classic) if labelling.classic is not None else None,
    }


def _limbs(project: Project) -> list[dict[str, object]]:
    limbs = project.limbs
    return [
        {
            "index": limb,
            "name": limbs.names[limb],
            "residual_mean": _residual(project, limbs.markers_of(limb)),
            "markers": [_marker(project, int(marker)) for marker in limbs.markers_of(limb)],
        }
        for limb in range(limbs.n_limbs)
    ]


def _marker(project: Project, marker: int) -> dict[str, object]:
    skeleton = project.skeleton if project.has("skeleton") else None
    estimated = {"offset": "marker_offsets", "offset_std": "offset_std", "noise": "marker_noise"}
    values = {key: getattr(skeleton, name, None) for key, name in estimated.items()}
    return {
        "index": marker,
        "name": project.trajectories.names[marker],
        "seen": float(project.trajectories.seen[:, marker].mean()) if project.trajectories.n_frames else None,
        "residual_mean": _residual(project, [marker]),
        **_membership(project.limbs, marker),
        **{key: None if of_markers is None else of_markers[marker] for key, of_markers in values.items()},
    }


def _membership(limbs: Limbs, marker: int) -> dict[str, object]:
    """How likely the marker is on its limb, and on which other it is most likely otherwise, -1 for one of its own."""
    rivals, shares = limbs.rivals
    return {"probability": limbs.probability[marker], "rival_limb": rivals[marker], "rival_probability": shares[marker]}


def _names(project: Project, markers: Any) -> list[str]:
    return [project.trajectories.names[int(marker)] for marker in markers]


def _bodies(project: Project) -> list[dict[str, object]]:
    return [_fields(body, "name", "root", "limbs", "markers", "probability") for body in project.bodies]


def _tree(project: Project) -> dict[str, object]:
    topology = project.topology
    facts = _fields(topology, "parents", "roots", "edges", "edge_probability", "rivals", "rival_probability")
    return {**facts, "joint_costs": topology.values, "n_iterations": topology.n_iterations}


def _joints(project: Project) -> list[dict[str, object]]:
    from skelgen.kinematics.inverse.motion import angle_ranges  # noqa: PLC0415 - scipy is slow to load
    from skelgen.kinematics.joints.observability import observed_joints  # noqa: PLC0415

    skeleton, motion = project.skeleton, project.motion
    ranges = angle_ranges(skeleton, motion, project.trajectories.positions)
    observed = observed_joints(skeleton, motion)
    return [
        {
            "name": name,
            **_fields(joint, "parent", "child", "kind", "axis", "second_axis", "std", "std_in_child"),
            **_fields(joint, "axis_std", "second_axis_std", "position_in_parent", "position_in_child"),
            "position_mean": motion.joint_positions[:, index].mean(axis=0) if motion.n_frames else None,
            "angles": [dataclasses.asdict(angle) for angle in ranges[index]],
            "range_of_motion": _turns(observed[index].motion),
            "not_determined": with_names_of_limbs(observed[index].sentence, project.limbs) or None,
            "to_do": with_names_of_limbs(observed[index].advice, project.limbs) or None,
            **_fields(joint, "is_determined", "is_fully_determined", "open_directions"),
            "is_placed_by_marker_set": joint.is_placed_by_marker_set,
            "place": place_of(joint).value,
        }
        for index, (name, joint) in enumerate(zip(skeleton.joint_names, skeleton.joints, strict=True))
    ]


def _loops(skeleton: Skeleton) -> list[dict[str, object]]:
    return [
        {
            "name": skeleton.joint_name(joint),
            **_fields(joint, "position_in_parent", "position_in_child", "std", "std_in_child"),
        }
        for joint in skeleton.loops
    ]


def _turns(motion: Any) -> list[dict[str, object]]:
    """How far a joint turns about its three directions, unit vectors in the parent."""
    return [{"direction": axis, "range": turn} for axis, turn in zip(motion.directions, motion.ranges, strict=True)]


def _lengths(skeleton: Skeleton) -> list[dict[str, object]]:
    names = skeleton.joint_names
    return [
        {
            "limb": skeleton.limb_of_length((first, second)),
            "from": names[first],
            "to": names[second],
            "length": length,
            "std": None if skeleton.length_std is None else skeleton.length_std[index],
        }
        for index, ((first, second), length) in enumerate(skeleton.lengths.items())
    ]


def _mean(values: Floats) -> float | None:
    measured = values[~np.isnan(values)]
    return float(measured.mean()) if len(measured) else None


def _residual(project: Project, markers: Ints | list[int]) -> float | None:
    return _mean(project.motion.residuals[:, markers]) if project.has("skeleton") else None


def _fields(value: object, *names: str) -> dict[str, object]:
    return {name: getattr(value, name) for name in names}


def _plain(value: Any) -> Any:
    """Return the value made of what JSON knows; NaN and infinity become None."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, str | int) else str(value)


FORMAT = Format(
    name="summary-json",
    title="Summary, JSON",
    suffixes=(".summary.json", ".json"),
    holds="summary",
    write=_write,
    check=lambda value, options: _project(value),
    keeps=("names", "confidence", "limbs", "kinds", "uncertainty"),
    marks_open="`is_determined`, `place`, `not_determined` of each joint",
    note="Limbs, tree, joints, lengths, residuals, parameters, times and versions.",
)
