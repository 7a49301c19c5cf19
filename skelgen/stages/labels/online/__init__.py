"""Labels while the points arrive, frame by frame."""

from skelgen.stages.labels.online.tracker import Tracker

__all__ = ["Tracker"]
