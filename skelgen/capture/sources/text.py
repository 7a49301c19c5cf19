"""A frame source as one line of text: ``kind:places?option=value&option=value``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from skelgen.errors import ParameterError

_TEXT = re.compile(r"(?P<kind>[a-z][a-z0-9]+):(?P<place>.*?)(\?(?P<options>\w+=[^?]*))?", re.DOTALL)


@dataclass(frozen=True)
class SourceText:
    """What a text says, before anybody knows whether it exists.

    Attributes
    ----------
    kind : str
        ``folder``, ``video``, ``firewire``, ...; one letter before a colon is a drive of Windows, not a kind.
    place : str
        What stands between the colon and the options, e.g. ``left.avi,right.avi``.
    options : mapping
        Names and values behind the last question mark.
    """

    kind: str
    place: str
    options: Mapping[str, str] = field(default_factory=dict)

    @property
    def places(self) -> tuple[str, ...]:
        """The places between commas, without those that are empty."""
        return tuple(part.strip() for part in self.place.split(",") if part.strip())

    def __str__(self) -> str:
        options = "&".join(f"{name}={value}" for name, value in self.options.items())
        return f"{self.kind}:{self.place}" + (f"?{options}" if options else "")

    def two_places(self, example: str) -> tuple[str, str]:
        """Return the places of the left and the right camera.

        Raises
        ------
        ParameterError
            If there are not two; `example` shows how it should be.
        """
        if len(self.places) != 2:
            raise ParameterError(f"{self}: names {len(self.places)} where left and right belong, as in {example}")
        return self.places[0], self.places[1]


def check_two_cameras(kind: str, names: tuple[str, ...], example: str) -> None:
    """Check that a text names two cameras, or none and leaves the choice to what is there.

    Raises
    ------
    ParameterError
        If it names one, three or more, or one twice; `example` shows how it should be.
    """
    if len(names) not in (0, 2):
        raise ParameterError(f"{kind}: names {len(names)} cameras where left and right belong, as in {example}")
    if len(names) == 2 and names[0] == names[1]:
        raise ParameterError(f"{kind}: left and right are both {names[0]}; a pair needs two cameras, as in {example}")


def parse_source(text: str) -> SourceText | None:
    """Take a text apart; None if it has no kind.

    Examples
    --------
    >>> parse_source("video:left.avi,right.avi?frames=99")
    SourceText(kind='video', place='left.avi,right.avi', options={'frames': '99'})
    """
    parts = _TEXT.fullmatch(text.strip())
    if parts is None:
        return None
    pairs = [option.partition("=") for option in (parts["options"] or "").split("&") if option]
    return SourceText(parts["kind"], parts["place"].strip(), {name: value for name, _, value in pairs})


__all__ = ["SourceText", "check_two_cameras", "parse_source"]
