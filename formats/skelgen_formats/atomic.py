"""Files appear whole or not at all: the formats' name for `skelgen.files.replacing`."""

from skelgen.files import replacing

__all__ = ["replacing"]
