"""How sure each marker's identity is over time: a row per marker, warm where it is doubtful."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from skelgen.app.report import measures, svg
from skelgen.app.report.colours import ramp_rgba
from skelgen.app.report.png import png_uri
from skelgen.app.report.timeline import (
    BOTTOM,
    LEAST_WIDTH,
    LEFT,
    MOST_BINS,
    PLOT,
    WIDTH,
    parted,
    row_height,
    row_labels,
    time_axis,
)
from skelgen.app.report.wording import percent
from skelgen.model import Project
from skelgen.model.arrays import Floats


def confidence_figure(project: Project) -> Markup:
    """Draw the least confidence of each marker in each stretch, and its mean at the right."""
    order = measures.subtree_markers(project)
    confidence = project.labelling.confidence[:, order]
    row = row_height(len(order))
    height = row * len(order)
    names = [project.trajectories.names[marker] for marker in order.tolist()]
    means = [percent(float(mean)) for mean in project.labelling.marker_confidence[order]]
    picture = svg.image(LEFT, 0, PLOT, height, png_uri(parted(_pixels(confidence), row)))
    axis = time_axis(project.trajectories, height)
    labels = row_labels(names, means, row)
    title = "Confidence of every marker over time"
    return svg.drawing(WIDTH, height + BOTTOM, title, picture, *labels, axis, least=LEAST_WIDTH)


def _pixels(confidence: Floats) -> NDArray[np.uint8]:
    """Colours, shape (n_markers, n_bins, 4); nothing where a marker is unseen."""
    starts, _ = measures.bin_edges(len(confidence), MOST_BINS)
    least = np.fmin.reduceat(confidence, starts, axis=0).T
    pixels = ramp_rgba(least)
    pixels[np.isnan(least)] = 0
    return np.ascontiguousarray(pixels)
