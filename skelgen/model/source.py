"""Where a take was read from, so that a project can refer to the recording instead of holding it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Source:
    """A recording on disk.

    Attributes
    ----------
    path : str
        Absolute path of the file.
    format : str
        Name of the format that it was read as.
    options : mapping of str to value
        What the reader was told.
    size : int
        Bytes of the file when it was read.
    modified : int
        When it was last changed before that, in ns since 1970.
    sha256 : str
        Hash of its content; empty until a project refers to it.
    """

    path: str
    format: str
    options: Mapping[str, Any] = field(default_factory=dict)
    size: int = 0
    modified: int = 0
    sha256: str = ""
