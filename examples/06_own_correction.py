"""What you know better is said once and obeyed by every later run, until you take it back: a correction by hand.

    python examples/06_own_correction.py [FOLDER]

The right hand of this human hardly moves against the forearm, so that they are found as one limb. We say that two
markers do not share a limb, and of which type a joint is; the stages from there on run again. The project keeps what
was said.
"""

import sys
from pathlib import Path

import skelgen

STILLNESS = 0.1  # of the usual angles


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
    take = skelgen.simulate("human", seed=3, n_frames=400, noise=0.5, motion_range=STILLNESS).take
    project = skelgen.reconstruct(take)
    print(f"found: {project.limbs.n_limbs} limbs of 15")

    markers = take.names
    limbs = ("right hand", "right forearm")
    hand, forearm = (next(name for name in markers if name.startswith(limb)) for limb in limbs)
    for kind, value in (("apart", ""), ("join", ""), ("kind", "ball")):
        project = skelgen.correct(project, kind, (hand, forearm), value)
        print(f"stated: {project.corrections[-1].sentence}")

    project = skelgen.reconstruct(project)  # goes on with the limbs, which have no result any more
    print(f"now: {project.limbs.n_limbs} limbs")
    pair = {int(project.limbs.limb_of_marker[markers.index(name)]) for name in (hand, forearm)}
    kind = next(joint.kind for joint in project.skeleton.joints if {joint.parent, joint.child} == pair)
    print(f"the joint between {forearm} and {hand} is a {kind}")
    (path,) = skelgen.write(project, folder / "corrected.skelgen")
    print(f"written with the corrections: {path}")

    free = skelgen.take_back(project, -1)  # the last; the skeleton is to be found again
    print(f"taken back: {project.corrections[-1].sentence}; {len(free.corrections)} corrections are left")


if __name__ == "__main__":
    main()
