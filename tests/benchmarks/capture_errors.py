"""Errors of the seed's rig at one metre, by chance and as predicted: ``python tests/benchmarks/capture_errors.py``."""

from __future__ import annotations

from shown import show, show_machine, verdict

from skelgen.benchmark.stereo import WANTED, WANTED_AT, WITHIN, rig_errors
from skelgen.capture.optics.seed_rig import seed_rig

DISTANCES = (1000.0, 2000.0)
N_TRIALS = 400


def main() -> None:
    """Print the table."""
    show_machine()
    rows = []
    for distance in DISTANCES:
        for name, (found, predicted) in rig_errors(distance, N_TRIALS).items():
            ratio = found / predicted
            is_reached = abs(ratio - 1) <= WITHIN and (distance > WANTED_AT or found <= WANTED[name])
            wanted = f"<= {WANTED[name]}" if distance == WANTED_AT else ""
            shown = (f"{distance:g}", name, f"{found:.3f}", wanted, f"{predicted:.3f}", f"{ratio:.3f}")
            rows.append((*shown, verdict(is_reached)))
    columns = ("distance [mm]", "what [mm, degrees]", "rms error", "wanted", "predicted", "ratio (0.9 to 1.1)", "")
    show(f"Seed's rig, {seed_rig().noise:g} px, {N_TRIALS} poses, all axes together", columns, rows)


if __name__ == "__main__":
    main()
