"""Find markers that have fallen off, and leave them out from then on: what lies on the floor is on no limb."""

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skelgen.geometry.falling import Fall, find_fall, has_left, moments_of
from skelgen.model import Trajectories
from skelgen.model.labelling import Finding


@dataclass(frozen=True, eq=False)
class FallenMarker:
    """A marker that has fallen off.

    Attributes
    ----------
    marker : int
        Index.
    name : str
        Its label.
    fall : Fall
        When and where.
    """

    marker: int
    name: str
    fall: Fall

    @property
    def sentence(self) -> str:
        """Notice for the user."""
        return f"{self.name} falls off at frame {self.fall.first} and lies still later: it is left out from then on"

    def finding(self, last_frame: int) -> Finding:
        """Finding for the label quality; `last_frame` is that of the take."""
        evidence = f"it falls as gravity makes it, and lies still from frame {self.fall.rest} on"
        return Finding("fallen", (self.name,), self.fall.first, last_frame, evidence, "left out from then on")


def find_falls(trajectories: Trajectories) -> tuple[FallenMarker, ...]:
    """Find markers that fall off and lie still until they are last seen.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    """
    found, positions = [], trajectories.positions
    for marker, name in enumerate(trajectories.names):
        fall = find_fall(positions[:, marker], trajectories.rate)
        if fall is not None and has_left(positions[moments_of(fall, trajectories.seen[:, marker])], marker):
            found.append(FallenMarker(marker, name, fall))
    return tuple(found)


def without_fallen(trajectories: Trajectories, falls: Iterable[FallenMarker]) -> Trajectories:
    """Leave markers out from where they fall on.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    falls : iterable of FallenMarker
        From `find_falls`.

    Returns
    -------
    Trajectories
        With a notice per fall; the same object if there is none.
    """
    falls = tuple(falls)
    if not falls:
        return trajectories
    positions = trajectories.positions.copy()
    for one in falls:
        positions[one.fall.first :, one.marker] = np.nan
    notices = (*trajectories.notices, *(one.sentence for one in falls))
    return dataclasses.replace(trajectories, positions=positions, notices=notices)
