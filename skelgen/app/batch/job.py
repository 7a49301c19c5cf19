"""What is done with every take of a batch, as it is sent to the workers."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import skelgen
from skelgen.app.stages import Wishes


@dataclass(frozen=True)
class KnownFile:
    """The file of a known skeleton.

    Attributes
    ----------
    path : str
        A project; on a cluster all machines see it at this path.
    sha256 : str
        Checksum of its content: takes of one batch have one skeleton.
    """

    path: str
    sha256: str


@dataclass(frozen=True)
class Job:
    """What is done with every take.

    Attributes
    ----------
    settings : mapping of str to mapping
        Parameters that somebody wants otherwise, by stage.
    wishes : Wishes
        Known numbers and trees; one process for each take.
    seed : int or None
        Seed of every take; None for that of a project, or 0.
    until : str or None
        Last stage; None for the last of all.
    format_name : str or None
        Format in which all takes are read; None finds it for each.
    reader_options : mapping of str to value
        What readers are told.
    formats : tuple of str
        Formats that are written beside the usual files.
    skeleton : KnownFile or None
        Skeleton of another take, by which all takes are labelled and posed; None finds that of each.
    version : str
        Version of skelgen that all workers must have: results of two would not be those of either.
    """

    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    wishes: Wishes = field(default_factory=Wishes)
    seed: int | None = None
    until: str | None = None
    format_name: str | None = None
    reader_options: Mapping[str, Any] = field(default_factory=dict)
    formats: tuple[str, ...] = ()
    skeleton: KnownFile | None = None
    version: str = skelgen.__version__

    def as_mapping(self) -> dict[str, Any]:
        """Return all of it as plain values."""
        return dataclasses.asdict(self)

    @property
    def fingerprint(self) -> str:
        """Text that differs for jobs that differ."""
        text = json.dumps(self.as_mapping(), sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()
