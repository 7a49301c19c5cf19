"""What the filters of the live capture leave of its errors: ``python tests/benchmarks/capture_prediction.py [pairs]``.

The reference arm is rendered, its balls touch and hide each other. Errors are those of the middle of each target's
balls and of the joints' rotations, in the pairs in which both are found without a filter; the noise of the rig is what
nobody has measured (0.1 px), then what its calibration measures.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from shown import show, show_machine

from skelgen.capture.bodies.prediction import PredictionParameters
from skelgen.capture.live import Captured, MotionCapture
from skelgen.capture.simulated_rig import SimulatedRig, simulated_rig
from skelgen.geometry.rotations import vector_from_matrix

WAYS = {
    "as found": None,
    "--predict": PredictionParameters(),
    "--predict-joints": PredictionParameters(joints=True),
}
NOISES = (0.1, 0.016)  # px
SEED = 5


def main(n_pairs: int) -> None:
    """Print a table for each noise."""
    show_machine()
    source = simulated_rig("arm", n_frames=n_pairs, seed=SEED)
    pairs = [source.render(index)[0] for index in range(n_pairs)]
    for noise in NOISES:
        settings = replace(source.settings, rig=replace(source.settings.rig, noise=noise))
        rows, common = [], None
        for way, prediction in WAYS.items():
            with MotionCapture(settings, prediction, threads=False) as capture:
                captured = [capture.see(pair) for pair in pairs]
            common = common or captured
            rows.append((way, *row(source, captured, common)))
        names = [f"{body.name} [mm]" for body in settings.bodies] + [f"{joint.name} [deg]" for joint in settings.joints]
        show(f"{n_pairs} rendered pairs, {noise:g} px", ("way", *names, "targets found", "ms"), rows)


def row(source: SimulatedRig, captured: list[Captured], common: list[Captured]) -> list[str]:
    """Error of each target and joint where it was found in common, how many were found, and the median latency."""
    cells, poses = [], source.scene.world_from_body
    names = [body.name for body in source.settings.bodies]
    for number, body in enumerate(source.settings.bodies):
        there = [
            (one.bodies[body.name], frame) for frame, one in enumerate(captured) if body.name in common[frame].bodies
        ]
        middle = np.append(body.points.mean(axis=0), 1.0)
        off = [(found.world_from_body - poses[frame, number])[:3] @ middle for found, frame in there]
        cells.append(f"{np.sqrt(np.square(off).sum(axis=1).mean()):.4f}")
    for joint in source.settings.joints:
        parent, child = (poses[:, names.index(name)] for name in (joint.parent, joint.child))
        turns = (parent @ joint.parent_from_joint)[:, :3, :3].swapaxes(1, 2) @ (child @ joint.child_from_joint)[
            :, :3, :3
        ]
        true = vector_from_matrix(turns)
        off = [
            one.angles[joint.name].angles - (turn if joint.kind == "ball" else turn[2:])
            for one, other, turn in zip(captured, common, true, strict=True)
            if joint.name in other.angles
        ]
        cells.append(f"{np.degrees(np.sqrt(np.square(off).sum(axis=1).mean())):.4f}")
    found = sum(len(one.bodies) for one in captured)
    latency = 1e3 * float(np.median([one.latency for one in captured]))
    return [*cells, f"{found} of {len(captured) * len(names)}", f"{latency:.1f}"]


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
