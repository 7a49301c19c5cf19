"""Errors of the reference rig as the live capture has them, by chance and as predicted.

``python tests/benchmarks/capture_errors.py [number of poses]``; `skelgen.benchmark.stereo` says how.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

from shown import show, show_machine, verdict

from skelgen.benchmark.stereo import WANTED, WANTED_AT, WITHIN, Errors, rig_errors
from skelgen.capture.reference_rig import reference_rig

COVERED = (0.93, 0.97)  # part within the stated 95 %, of several thousand values

DISTANCES = (1000.0, 2000.0)
N_TRIALS = 1000


def main(n_trials: int) -> None:
    """Print the tables."""
    show_machine()
    columns = ("distance [mm]", "what [mm, degrees]", "rms error", "wanted", "predicted", "ratio (0.9 to 1.1)")
    columns += ("within stated 95 %", "")
    rows = [row for distance in DISTANCES for row in rows_of(distance, rig_errors(distance, n_trials), 1.0)]
    show(f"Reference rig, {reference_rig().noise:g} px, {n_trials} poses, all axes together", columns, rows)
    rows = rows_of(WANTED_AT, rig_errors(WANTED_AT, n_trials // 5, is_rendered=True), 0.0)
    show(f"Rendered images, {n_trials // 5} poses", columns, rows)


def rows_of(distance: float, errors: dict[str, Errors], least: float) -> Iterator[tuple[str, ...]]:
    """Rows of the table; `least` is 0 where errors may be smaller than predicted."""
    for name, one in errors.items():
        found, predicted, covered = one.row()
        ratio = found / predicted
        is_reached = least * (1 - WITHIN) <= ratio <= 1 + WITHIN and (distance > WANTED_AT or found <= WANTED[name])
        is_reached &= covered >= COVERED[0] and (least == 0.0 or covered <= COVERED[1])
        wanted = f"<= {WANTED[name]}" if distance == WANTED_AT else ""
        shown = (f"{distance:g}", name, f"{found:.3f}", wanted, f"{predicted:.3f}", f"{ratio:.3f}")
        yield (*shown, f"{100 * covered:.1f} %", verdict(is_reached))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else N_TRIALS)
