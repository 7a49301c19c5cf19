"""Points without labels, with gaps and false points, become labelled markers and a skeleton.

    python examples/04_unlabelled.py

The simulation knows which point is which marker: `evaluate` compares.
"""

import skelgen


class Notices(skelgen.SilentMonitor):
    """A monitor that prints the notices of the stages and ignores their progress."""

    def notice(self, sentence: str) -> None:
        print(f"note: {sentence}")


def main() -> None:
    simulated = skelgen.simulate("rods", seed=3, n_frames=1000, noise=0.3, dropouts=0.05, ghosts=0.2, labelled=False)
    project = skelgen.reconstruct(simulated.take, seed=3, monitor=Notices())
    scores = skelgen.evaluate(project, simulated.truth)
    if scores.labels and scores.limbs:
        print(
            f"markers: {scores.labels.n_markers_found} of {scores.labels.n_markers_true}, IDF1 {scores.labels.idf1:.4f}"
        )
        print(f"limbs agree by {scores.limbs.adjusted_rand:.3f}")
    for joint in scores.joints:
        print(f"{joint.name}: {joint.mean:.2f} mm from the truth on average")


if __name__ == "__main__":
    main()
