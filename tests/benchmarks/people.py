"""Real people against an expert: ``python tests/benchmarks/people.py [folder]``, with limbs and tree given or not.

With ``--unknown [30]``, instead, so many simulated people in marker sets that are left out of the tables: in natural
motion, with arms that hardly move, or in any posture; every other one lacks up to four markers. Their trees are harder
than those of most recordings: hands, heads and toes that do not move against their neighbours count as missed. With
``--lower`` they wear the markers of pelvis and legs only, as in many laboratories of gait; with ``--hidden 0.25`` a
quarter of all positions is hidden in pieces of 0.3 s.

The recordings are looked for in ``../shared/data/bodies`` beside the project unless a folder is named. Markers lose
their names. Joints are those of the template that were found, wrists and toes left out; the template is good to some
10 mm. SCoRE (Ehrig 2006) is given limbs and tree in every row.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from learn_sets import seen_markers
from postures import RATE, about_posture
from shown import show, show_machine

import skelgen
from skelgen.kinematics.joints.closed_form import fit_fixed_point
from skelgen.kinematics.rigid_bodies import fit_shape
from skelgen.marker_sets import LABORATORY_SETS, MARKER_SETS
from skelgen.model import Project, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.simulation.motion import world_from_limbs
from skelgen.simulation.people import MOTIONS, natural_motion, person
from skelgen.simulation.people import Person as WornPerson
from skelgen.stages.limbs import worn_sets

USUAL_PLACE = Path(__file__).parents[3] / "shared" / "data" / "bodies"
SMALL = ("radius", "ulna", "toes")
POSED = 3  # markers that SCoRE needs on a body
PLACED = 10.0  # mm: how far examiners miss a place on simulated people
LENGTHS, WAYS = (150, 300, 450), ("natural", "arms still", "posture")
STILL, IN_POSTURE = 0.2, (0.25, 0.6)  # of their usual motion: arms that hardly move, and bodies in a posture
LOST, ENOUGH = 4, 3  # markers that every other one may lack, from segments with so many
LEAST_TREE = 0.85  # wanted of everybody
PIECE = 0.3  # s: mean length of what is hidden


@dataclass(frozen=True, eq=False)
class Person:
    """A take, and what an expert says of it: bodies, their parents, allowed bodies of each marker, and joints [mm]."""

    take: Trajectories
    bodies: list[str]
    parents: Ints
    allowed: Bools
    joints: Floats | None

    @property
    def body(self) -> Ints:
        """Body of each marker, shape (n_markers,)."""
        return np.asarray(self.allowed.argmax(axis=1))

    def of(self, bodies: tuple[str, ...]) -> Person:
        """Return the person without the markers of other bodies."""
        kept = np.isin(np.array(self.bodies)[self.body], bodies)
        names = [f"M{marker:03}" for marker in range(kept.sum())]
        take = Trajectories(self.take.positions[:, kept], names, self.take.rate)
        return replace(self, take=take, allowed=self.allowed[kept])

    @property
    def edges(self) -> list[tuple[int, int]]:
        """Body and parent, where both carry markers."""
        carried = self.allowed.any(axis=0)
        return [(body, int(q)) for body, q in enumerate(self.parents) if q >= 0 and carried[body] and carried[q]]

    def limbs(self) -> dict[str, str]:
        """Parameters by which the limbs are the expert's."""
        groups = [[f"M{marker:03}" for marker in np.flatnonzero(self.body == one)] for one in np.unique(self.body)]
        together = "; ".join(", ".join(names) for names in groups if len(names) > 1)
        return {"together": together, "apart": ", ".join(names[0] for names in groups)}

    def hierarchy(self, project: Project) -> dict[str, str]:
        """Parent of every limb, given limbs that are the expert's."""
        markers = zip(project.trajectories.names, project.limbs.limb_of_marker.tolist(), strict=True)
        limb_of_body = {int(self.body[int(name[1:4])]): limb for name, limb in markers}
        found = {}
        for body, limb in limb_of_body.items():
            parent = int(self.parents[body])
            while parent >= 0 and parent not in limb_of_body:
                parent = int(self.parents[parent])
            found[f"limb{limb}"] = f"limb{limb_of_body[parent]}" if parent >= 0 else ""
        return found


def main() -> None:
    """Print a row per person and per what is given."""
    if "--unknown" in sys.argv:
        number = next((word for word in sys.argv[sys.argv.index("--unknown") + 1 :] if word.isdigit()), "30")
        hidden = sys.argv[sys.argv.index("--hidden") + 1] if "--hidden" in sys.argv else "0"
        show_unknown(int(number), lower="--lower" in sys.argv, hidden=float(hidden))
        return
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else USUAL_PLACE
    names = sorted(path.name.removesuffix(".truth.npz") for path in folder.glob("*.truth.npz"))
    if not names:
        raise SystemExit(f"no *.truth.npz in {folder}")
    show_machine()
    rows = []
    for name in names:
        person = load(folder, name)
        score = f"{score_error(person):.1f}" if person.joints is not None else ""
        for given in ("nothing", "limbs", "limbs, tree"):
            began = time.process_time()
            project = reconstruct(person, given)
            seconds = f"{time.process_time() - began:.1f}"
            rows.append((name, given, *scores(person, project), score, seconds))
    columns = ("take", "given", "purity", "bodies", "limbs", "edges", "tree", "joints [mm]", "worst", "", "SCoRE", "s")
    show("People", columns, rows)


def show_unknown(n_people: int, *, lower: bool, hidden: float) -> None:
    """Print a row per simulated person in a set that is not known, and how many trees are as wanted."""
    show_machine()
    every, rows = worn_sets.worn_sets(), []
    for number, (marker_set, told, everything) in enumerate(unknown_people(n_people)):
        who = everything.of(worn_sets.HALVES["lower"]) if lower else everything
        who = replace(who, take=with_hidden_pieces(who.take, hidden, np.random.default_rng([5, number])))
        known = tuple(one for one in every if one.name != marker_set)
        worn_sets.worn_sets = lambda known=known: known
        rows.append((marker_set, told, *scores(who, reconstruct(who, "nothing"))[:5]))
        print(*rows[-1], sep="  ", flush=True)
    show("People in sets that are not known", ("set", "motion", "purity", "bodies", "limbs", "edges", "tree"), rows)
    trees = np.array([float(row[-1]) for row in rows])
    print(f"trees {trees.mean():.3f} in the mean; {(trees < LEAST_TREE).sum()} of {len(trees)} below {LEAST_TREE}")


def unknown_people(n_people: int) -> Iterator[tuple[str, str, Person]]:
    """Yield the sets that simulated people wear, how they move, and the people."""
    sets = (*MARKER_SETS, *LABORATORY_SETS)
    for number in range(n_people):
        rng = np.random.default_rng([77, number])
        marker_set, n_frames = sets[number % len(sets)], LENGTHS[number // 3 % 3]
        who = person(marker_set, 0.0, rng, placed=PLACED)
        motion, angles, poses = _moving(who, number, n_frames, rng)
        positions = seen_markers(who, angles, poses, rng)
        body_of_marker, bodies = np.asarray(who.worn.limb_of_marker), list(who.worn.limb_names)
        kept = _kept(body_of_marker, rng) if number % 2 else np.arange(len(body_of_marker))
        allowed = body_of_marker[kept, np.newaxis] == np.arange(len(bodies))
        take = Trajectories(positions[:, kept], [f"M{marker:03}" for marker in range(len(kept))], RATE)
        yield marker_set, motion, Person(take, bodies, np.array(who.worn.parents), allowed, None)


def with_hidden_pieces(take: Trajectories, part: float, rng: np.random.Generator) -> Trajectories:
    """Return a take of which a part of the positions of each marker is hidden in pieces."""
    positions, length = take.positions.copy(), PIECE * take.rate
    for marker in np.repeat(np.arange(take.n_markers), round(part * take.n_frames / length)).tolist():
        first = int(rng.integers(-int(length), take.n_frames))
        positions[max(first, 0) : max(first + 1 + int(rng.exponential(length)), 0), marker] = np.nan
    return replace(take, positions=positions)


def _moving(who: WornPerson, number: int, n_frames: int, rng: np.random.Generator) -> tuple[str, list[Floats], Floats]:
    """How somebody moves, in words, the angles of all limbs, and their poses."""
    way, motion = WAYS[number % 3], MOTIONS[(number * 3 + 1) % len(MOTIONS)]
    if way == "posture":
        return way, *about_posture(who, n_frames, IN_POSTURE, rng, is_alike=number % 2 == 1)
    angles, poses = natural_motion(who, motion, n_frames, RATE, rng)
    if way == "arms still":
        part = [STILL if "arm" in limb.name or "hand" in limb.name else 1.0 for limb in who.body.limbs]
        angles = [own.mean(axis=0) + of * (own - own.mean(axis=0)) for of, own in zip(part, angles, strict=True)]
        poses = world_from_limbs(who.body, angles, poses[:, 0, :3, 3])
    return f"{motion}, {way}", angles, poses


def _kept(body_of_marker: Ints, rng: np.random.Generator) -> Ints:
    """Markers without those that somebody left off."""
    sizes = np.bincount(body_of_marker)[body_of_marker]
    lost = [marker for marker in rng.permutation(len(sizes))[:LOST].tolist() if sizes[marker] >= ENOUGH]
    return np.setdiff1d(np.arange(len(sizes)), lost)


def load(folder: Path, name: str) -> Person:
    """Read a person; markers lose their names."""
    truth = np.load(folder / f"{name}.truth.npz")
    take = skelgen.read(next(path for path in folder.glob(f"{name}.*") if path.suffix in {".trc", ".c3d"}))
    assert isinstance(take, Trajectories)
    index = {_bare(one): column for column, one in enumerate(take.names)}
    positions = take.positions[:, [index[_bare(one)] for one in truth["labels"]]]
    hidden = Trajectories(positions, [f"M{marker:03}" for marker in range(positions.shape[1])], take.rate)
    joints = truth["joints"] if "joints" in truth.files else None
    return Person(hidden, [str(one) for one in truth["bodies"]], truth["parent"], truth["allowed"], joints)


def reconstruct(person: Person, given: str) -> Project:
    """Run all stages with what is given."""
    parameters = {"limbs": person.limbs()} if "limbs" in given else None
    n_limbs = len(np.unique(person.body)) if "limbs" in given else None
    project = skelgen.reconstruct(person.take, n_limbs=n_limbs, parameters=parameters, until="limbs")
    hierarchy = person.hierarchy(project) if "tree" in given else None
    return skelgen.reconstruct(project, hierarchy=hierarchy)


def scores(person: Person, project: Project) -> tuple[str, ...]:
    """Purity, bodies, limbs, edges, tree, and median and worst error of the joints with its name."""
    marker = np.array([int(name[1:4]) for name in project.trajectories.names])
    limb, allowed = project.limbs.limb_of_marker, person.allowed[marker]
    share = np.stack([allowed[limb == one].sum(axis=0) for one in range(project.limbs.n_limbs)])
    best = [set(np.flatnonzero((row == row.max()) & (row > 0)).tolist()) for row in share]
    pure = np.mean(
        [one >= 0 and bool(best[one] & set(np.flatnonzero(row))) for one, row in zip(limb, allowed, strict=True)]
    )
    carried, own = np.flatnonzero(person.allowed.any(axis=0)), allowed[allowed.sum(axis=1) == 1].sum(axis=0)
    halves = [{body for body in b if row[body] >= own[body] / 2} for b, row in zip(best, share, strict=True)]
    whole = [body for body in carried if any(body in half for half in halves)]
    near = {frozenset((body, int(q))) for body, q in enumerate(person.parents)} | {frozenset((b,)) for b in carried}
    joints = project.skeleton.joints
    right = [any(frozenset((a, b)) in near for a in best[one.parent] for b in best[one.child]) for one in joints]
    found = {edge: [i for i, one in enumerate(joints) if _joins(best[one.parent], best[one.child], edge)]
             for edge in person.edges}  # fmt: skip
    errors = {}
    for (body, _), same in found.items():
        if same and person.joints is not None and not person.bodies[body].startswith(SMALL):
            apart = project.motion.joint_positions[:, same] - person.joints[:, body, np.newaxis]
            errors[person.bodies[body]] = float(np.nanmedian(np.linalg.norm(apart, axis=2), axis=0).min())
    worst = max(errors, key=lambda name: errors[name], default="")
    tree = np.mean([bool(same) for same in found.values()])
    figures = (f"{np.median(list(errors.values())):.1f}", f"{errors[worst]:.0f}", worst) if errors else ("", "", "")
    edges = f"{np.mean(right):.2f}" if right else ""
    return (f"{pure:.3f}", f"{len(whole)} of {len(carried)}", f"{len(best)}", edges, f"{tree:.2f}", *figures)


def score_error(person: Person) -> float:
    """Median error of SCoRE's joints [mm]."""
    errors, positions = [], person.take.positions
    for body, parent in person.edges:
        groups = [np.flatnonzero(person.body == one) for one in (parent, body)]
        if min(map(len, groups)) < POSED or person.bodies[body].startswith(SMALL):
            continue
        every = np.arange(len(positions))
        poses = [fit_shape(positions[:, group], every).world_from_limb for group in groups]
        fit = fit_fixed_point(*poses, np.zeros(3), np.zeros(3))
        assert fit is not None and person.joints is not None
        images = [pose[:, :3, :3] @ place + pose[:, :3, 3]
                  for pose, place in zip(poses, (fit.in_first, fit.in_second), strict=True)]  # fmt: skip
        apart = (images[0] + images[1]) / 2 - person.joints[:, body]
        errors.append(np.nanmedian(np.linalg.norm(apart, axis=1)))
    return float(np.median(errors))


def _joins(first: set[int], second: set[int], edge: tuple[int, int]) -> bool:
    return (edge[0] in first and edge[1] in second) or (edge[1] in first and edge[0] in second)


def _bare(name: str) -> str:
    return str(name).split(":")[-1].strip().lower()


if __name__ == "__main__":
    main()
