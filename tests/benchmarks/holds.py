"""Joints that hold for a part of a take: how many are found, how far their frames are off, and how many are false.

python tests/benchmarks/holds.py [--seeds 20]
"""

import argparse

import numpy as np

from skelgen.simulation import simulate
from skelgen.stages.joints import find_joint_spans

ERRORS = ((0.5, 0.1), (4.0, 0.4))  # mm, degrees
MOTIONS = ("walk", "run", "squat", "reach", "jump")


def spans_of(structure: str, seed: int, errors: tuple[float, float], **options: object) -> tuple[bool, int, int]:
    """Whether the spans that are true are found, how many frames they are off, and how many others are found."""
    noise, turn_noise = errors
    case = simulate(structure, seed=seed, n_frames=800, sensors=True, noise=noise, turn_noise=turn_noise, **options)
    truth = case.truth
    found, _ = find_joint_spans(case.take.world_from_body, truth.parents, truth.rate)
    true = [tuple(sorted(pair)) for pair in truth.hold_limbs.tolist()]
    hits = [span for span in found if span.limbs in true]
    off = [abs(np.array([span.first_frame, span.last_frame]) - truth.hold_frames[0]).max() for span in hits]
    return len(hits) == len(true), int(max(off, default=0)), len(found) - len(hits)


def main() -> None:
    """Print one line for each kind of take."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    n_seeds = parser.parse_args().seeds
    kinds = [("tool", {"hold": "tool"}), ("partners", {"hold": "partners", "subjects": 2}), ("nothing", {})]
    cases = [(structure, name, options) for structure in ("human", "quadruped") for name, options in kinds]
    cases += [("human", motion, {"motion": motion}) for motion in MOTIONS]
    for errors in ERRORS:
        for structure, name, options in cases:
            seeds = range(n_seeds if name not in MOTIONS else max(n_seeds // 4, 1))
            scores = [spans_of(structure, seed, errors, **options) for seed in seeds]
            found, off, false = (list(values) for values in zip(*scores, strict=True))
            print(
                f"{structure:10} {name:9} {errors[0]:g} mm, {errors[1]:g} deg: {sum(found)} of {len(found)} found, "
                f"frames off by {max(off)} at most, {sum(false)} false",
                flush=True,
            )


if __name__ == "__main__":
    main()
