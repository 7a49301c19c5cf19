"""A whole recording of two cameras to unlabelled markers, of which wrong pairs of balls are sorted out by time."""

from skelgen.capture.markers.recording import markers_of, misfit_in_space

__all__ = ["markers_of", "misfit_in_space"]
