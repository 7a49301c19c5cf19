"""What the stages make of real recordings: ``python tests/benchmarks/real_recordings.py [folder]``.

The recordings are looked for in ``../shared/data`` beside the project unless a folder is named; those that are absent
are left out, which is said.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
from shown import show, show_machine, verdict

import skelgen
from skelgen.model import Trajectories

USUAL_PLACE = Path(__file__).parents[3] / "shared" / "data"
PENDULUM = "rods_pendulum/pendulum_01.c3d"
HINGE_TO_HINGE, LENGTH_TOLERANCE = 520.7, 1.8  # mm, of the pendulum
PARALLEL = 1.7  # deg, between any two of its hinges
BONE_PINS, CENTRE = "bone_pin/abdbonepin.trc", "gu"  # the glenohumeral centre is one of the points
CENTRE_TOLERANCE = 5.0  # mm
BONES = dict.fromkeys(("ij", "ijc", "centijc7", "centpxt8"), "thorax") | dict.fromkeys(
    ("ac", "acc", "ai", "ts"), "scapula"
)


@dataclass(frozen=True)
class Known:
    """What is known of a recording: the limb of each marker by its name, and whether the limbs listed form a chain."""

    limb_of: Callable[[str], str]
    limbs: tuple[str, ...]
    is_chain: bool = True


RECORDINGS: dict[str, Known | None] = {
    PENDULUM: Known(lambda name: name.rstrip("OXY0123456789"), ("Static", "Upper", "Middle", "Lower")),
    "arm/arm-4-4-4_clean_30fps.c3d": Known(
        lambda name: ("torso", "upper arm", "forearm")[int(name[1:]) // 4], ("torso", "upper arm", "forearm")
    ),
    "arm/arm-4-2-3_clean_120fps.c3d": Known(
        lambda name: ("torso", "upper arm", "forearm")[(int(name[1:]) > 3) + (int(name[1:]) > 5)],
        ("torso", "upper arm", "forearm"),
    ),
    "wheelchair/walkingOptiTrack.c3d": Known(lambda name: name.split("_")[0], ("Foot", "Leg", "Knee"), is_chain=False),
    BONE_PINS: Known(lambda name: BONES.get(name, "humerus"), ("thorax", "scapula", "humerus")),
    "wheelchair/racing_full.c3d": None,
    "human/nick_freeform_001.c3d": None,
    "human/markers_Squat2.trc": None,
    "hand/recording.tsv": None,
    "mouse/mouse_S15.c3d": None,
}


def main() -> None:
    """Print what was found in every recording, then the limbs of those of which nothing is known."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else USUAL_PLACE
    show_machine()
    projects: dict[str, skelgen.Project] = {}
    rows = []
    for path, known in RECORDINGS.items():
        if not (folder / path).exists():
            rows.append((path, "absent", *[""] * 7))
            continue
        started = time.process_time()
        project = projects[path] = skelgen.reconstruct(skelgen.read(folder / path))
        rows.append((path, *summary(project, known), f"{time.process_time() - started:.1f}"))
    columns = ("recording", "frames", "markers", "limbs", "wanted", "tree", "residual [mm]", "interpolated", "s")
    show("Real recordings: limbs, tree, mean / median residual, part of all poses that is interpolated", columns, rows)
    show_pendulum(projects)
    show_centre(folder)
    for path, project in projects.items():
        if RECORDINGS[path] is None:
            show_limbs(path, project)


def summary(project: skelgen.Project, known: Known | None) -> tuple[str, ...]:
    """One row of the first table."""
    take, motion = project.trajectories, project.motion
    average = f"{np.nanmean(motion.residuals):.2f} / {np.nanmedian(motion.residuals):.2f}"
    figures = (average, f"{100 * (~motion.limb_seen).mean():.1f} %")
    counts = (str(take.n_frames), str(take.n_markers), str(project.limbs.n_limbs))
    if known is None:
        return (*counts, "-", f"{len(project.topology.roots)} root(s)", *figures)
    limbs = verdict(groups(project) == true_groups(take.names, known))
    tree = verdict(is_chain(project, known)) if known.is_chain else "not known"
    return (*counts, f"{len(known.limbs)}: {limbs}", tree, *figures)


def groups(project: skelgen.Project) -> set[frozenset[str]]:
    """Names of the markers on each limb found."""
    names = project.trajectories.names
    limbs = project.limbs
    return {frozenset(names[marker] for marker in limbs.markers_of(limb)) for limb in range(limbs.n_limbs)}


def true_groups(names: tuple[str, ...], known: Known) -> set[frozenset[str]]:
    """Names of the markers on each limb known."""
    return {frozenset(name for name in names if known.limb_of(name) == limb) for limb in known.limbs}


def is_chain(project: skelgen.Project, known: Known) -> bool:
    """Whether the limbs found are joined in the known order."""
    limbs, names = project.limbs, project.trajectories.names
    called = [known.limb_of(names[limbs.markers_of(limb)[0]]) for limb in range(limbs.n_limbs)]
    found = {frozenset((called[parent], called[child])) for parent, child in project.topology.edges}
    return found == {frozenset(pair) for pair in pairwise(known.limbs)}


def show_pendulum(projects: dict[str, skelgen.Project]) -> None:
    """The pendulum's lengths and hinges against those that were built."""
    project = projects.get(PENDULUM)
    if project is None:
        return
    joints, turns = project.skeleton.joints, project.motion.rotations[0]
    kinds = ", ".join(joint.kind for joint in joints)
    rows = [
        ("hinge to hinge [mm]", f"{HINGE_TO_HINGE} ± {LENGTH_TOLERANCE:g}", f"{length:.2f}", verdict(is_right(length)))
        for length in project.skeleton.lengths.values()
    ]
    rows.append(("types of the joints", "hinge, hinge, hinge", kinds, verdict(kinds == "hinge, hinge, hinge")))
    axes = [turns[joint.parent] @ joint.axis for joint in joints if joint.axis is not None]
    widest = max((float(np.rad2deg(np.arccos(min(abs(a @ b), 1.0)))) for a, b in combinations(axes, 2)), default=np.nan)
    rows.append(("largest angle between hinges [deg]", f"<= {PARALLEL}", f"{widest:.2f}", verdict(widest <= PARALLEL)))
    show("Pendulum", ("figure", "wanted", "reached", ""), rows)


def show_centre(folder: Path) -> None:
    """The glenohumeral centre, found without its own point, against where it was recorded."""
    if not (folder / BONE_PINS).exists():
        return
    take = skelgen.read(folder / BONE_PINS)
    assert isinstance(take, Trajectories)
    others = [index for index, name in enumerate(take.names) if name != CENTRE]
    names = tuple(take.names[index] for index in others)
    project = skelgen.reconstruct(Trajectories(take.positions[:, others], names, take.rate))
    limbs, true = groups(project), true_groups(names, RECORDINGS[BONE_PINS] or Known(str, ()))
    joint = next(
        (
            column
            for column, joint in enumerate(project.skeleton.joints)
            if {BONES.get(names[project.limbs.markers_of(limb)[0]]) for limb in (joint.parent, joint.child)}
            == {"scapula", None}
        ),
        None,
    )
    rows = [("bones", "3", str(len(limbs)), verdict(limbs == true))]
    if joint is not None:
        gaps = project.motion.joint_positions[:, joint] - take.positions[:, take.names.index(CENTRE)]
        distance = np.linalg.norm(gaps, axis=1)
        figures = f"{np.nanmedian(distance):.2f} / {np.nanmean(distance):.2f}"
        rows.append(
            (
                f"joint to {CENTRE}, median / mean over frames [mm]",
                f"<= {CENTRE_TOLERANCE:g}",
                figures,
                verdict(bool(np.nanmean(distance) <= CENTRE_TOLERANCE)),
            )
        )
    show(f"{BONE_PINS} without {CENTRE}", ("figure", "wanted", "reached", ""), rows)


def is_right(length: float) -> bool:
    """Whether a length is as near to the built one as is asked."""
    return abs(length - HINGE_TO_HINGE) <= LENGTH_TOLERANCE


def show_limbs(path: str, project: skelgen.Project) -> None:
    """The limbs that were found, for the eye."""
    names, limbs, motion = project.trajectories.names, project.limbs, project.motion
    kinds = {joint.child: joint.kind for joint in project.skeleton.joints}
    rows = []
    for limb, parent in enumerate(project.topology.parents.tolist()):
        markers = limbs.markers_of(limb)
        residuals = motion.residuals[:, markers]
        mean = f"{np.nanmean(residuals):.2f}" if not np.isnan(residuals).all() else "-"
        hangs = f"{kinds[limb]} on {parent}" if parent >= 0 else "root"
        rows.append((str(limb), hangs, mean, " ".join(names[marker] for marker in markers)))
    show(path, ("limb", "joint", "mean [mm]", "markers"), rows)


if __name__ == "__main__":
    main()
