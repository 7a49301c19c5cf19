"""The errors of a rig as a picture, one panel for each thing, as the seed's figures 6.1 to 6.4."""

from __future__ import annotations

from pathlib import Path

from skelgen.capture.errors_by_distance import RigErrors
from skelgen.errors import WriteError

PANELS_IN_A_ROW = 2
PANEL = (5.0, 3.5)
"""Width and height of a panel [inch]."""


def plot_errors(errors: RigErrors, path: Path) -> None:
    """Draw all curves into a file; its suffix says which kind (SVG, PNG, PDF).

    Raises
    ------
    WriteError
        If the file cannot be written or its kind is unknown.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - a second to import

    n_rows = -(-len(errors.curves) // PANELS_IN_A_ROW)
    figure = Figure(figsize=(PANEL[0] * PANELS_IN_A_ROW, PANEL[1] * n_rows), layout="constrained")
    for index, curve in enumerate(errors.curves):
        panel = figure.add_subplot(n_rows, PANELS_IN_A_ROW, index + 1)
        for name, std in zip(curve.columns, curve.std.T, strict=True):
            panel.plot(errors.distances / 1000.0, std, marker=".", label=name)
        panel.set(
            title=curve.what, xlabel="distance [m]", ylabel=f"standard deviation [{curve.unit}]", ylim=(0.0, None)
        )
        panel.grid(alpha=0.3)
        panel.legend()
    try:
        figure.savefig(path)
    except (OSError, ValueError) as error:
        raise WriteError(f"{path}: the picture cannot be written: {error}") from error
