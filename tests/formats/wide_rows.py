"""Two frames of two points, as the rows of wide tables that tests write titles over."""

from __future__ import annotations

import numpy as np

POSITIONS = np.array([[[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]], [[1.6, 2.6, 3.6], [np.nan] * 3]]) + 100
TIMES = [0.0, 0.02]


def rows(before: str = "", after: str = "", delimiter: str = ",") -> str:
    lines = [["" if np.isnan(x) else f"{x:g}" for x in frame.ravel()] for frame in POSITIONS]
    return "".join(before.format(n, TIMES[n]) + delimiter.join(cells) + after + "\n" for n, cells in enumerate(lines))


UNITS = "t,nose_x_mm,nose_y_mm,nose_z_mm,tail.base_x_mm,tail.base_y_mm,tail.base_z_mm\n" + rows("{1},")
