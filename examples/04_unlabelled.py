"""Points without labels, with gaps and false points, become labelled markers and a skeleton.

    python examples/04_unlabelled.py

The simulation knows which point is which marker: `evaluate` compares.
"""

from __future__ import annotations

import skelgen
from skelgen.evaluation import evaluate, evaluation_lines
from skelgen.simulation import simulate


class Notices:
    """A monitor that prints what the stages have to say, and ignores what they are doing and how far they are."""

    def begin(self, name: str) -> None:
        pass

    def advance(self, done: float, total: float) -> None:
        pass

    def notice(self, sentence: str) -> None:
        print(f"note: {sentence}")


def main() -> None:
    simulated = simulate("rods", seed=3, n_frames=1000, noise=0.3, dropouts=0.05, ghosts=0.2, labelled=False)
    project = skelgen.reconstruct(simulated.take, seed=3, monitor=Notices())
    print(*evaluation_lines(evaluate(project, simulated.truth)), sep="\n")


if __name__ == "__main__":
    main()
