"""Where pairs of images come from: files, cameras on FireWire, GigE Vision and GenTL, and the simulated rig."""

from skelgen.capture.sources.table import SOURCES, SourceKind, open_source

__all__ = ["SOURCES", "SourceKind", "open_source"]
