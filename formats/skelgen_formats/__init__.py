"""File formats: one module each, and the table of all of them."""

from skelgen_formats.registry import Format

FORMATS: tuple[Format, ...] = ()
"""All formats, in the order in which they are sniffed: the most particular content first."""

__all__ = ["FORMATS"]
