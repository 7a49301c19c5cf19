"""A whole recording of two cameras to unlabelled markers; time shows which pairs of balls are wrong."""

from skelgen.capture.markers.recording import ImageHealth, markers_of, misfit_in_space

__all__ = ["ImageHealth", "markers_of", "misfit_in_space"]
