"""skelgen: markers in, skeleton out.

The public face, which scripts, tests and both front ends use::

    import skelgen
    take = skelgen.read("take.c3d")
    project = skelgen.reconstruct(take)
    skelgen.write(project, "walk.xml")

Everything is loaded at its first use, so that ``import skelgen`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from skelgen.app.face import read, reconstruct, write
    from skelgen.errors import SkelgenError
    from skelgen.model import Joint, Limbs, Motion, PointCloud, Poses, Project, Skeleton, Topology, Trajectories
    from skelgen.stages.labels.online import Tracker

__version__ = "0.1.0"

_MODEL = ("Joint", "Limbs", "Motion", "PointCloud", "Poses", "Project", "Skeleton", "Topology", "Trajectories")
_HOMES = dict.fromkeys(_MODEL, "skelgen.model")
_HOMES |= dict.fromkeys(("read", "reconstruct", "write"), "skelgen.app.face")
_HOMES |= {"SkelgenError": "skelgen.errors", "Tracker": "skelgen.stages.labels.online"}

__all__ = [
    "Joint",
    "Limbs",
    "Motion",
    "PointCloud",
    "Poses",
    "Project",
    "Skeleton",
    "SkelgenError",
    "Topology",
    "Tracker",
    "Trajectories",
    "read",
    "reconstruct",
    "write",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'skelgen' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
