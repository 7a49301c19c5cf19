"""Progress, notices and cancelling: a `Monitor` is the last argument of every long function, silent by default."""

from collections.abc import Iterable, Iterator
from typing import Protocol, TypeVar, runtime_checkable

from skelgen.errors import Cancelled

_T = TypeVar("_T")

_EVERY = 50  # items; a report costs a call, and nobody sees smaller steps


@runtime_checkable
class Monitor(Protocol):
    """Receives the progress and the notices of a long computation, and can stop it."""

    def begin(self, name: str) -> None:
        """Report that the work called `name` starts."""

    def advance(self, done: float, total: float) -> None:
        """Report how much of the current work is finished; raise `Cancelled` to stop it.

        Parameters
        ----------
        done : float
            Units of the current work that are finished.
        total : float
            Units of the work.
        """

    def notice(self, sentence: str) -> None:
        """Report something that the user should know but that stops nothing."""


class SilentMonitor:
    """A monitor that says nothing and never cancels."""

    def begin(self, name: str) -> None:
        """Ignore the start."""

    def advance(self, done: float, total: float) -> None:
        """Ignore the progress.

        Parameters
        ----------
        done : float
            Units of the current work that are finished.
        total : float
            Units of the work.
        """

    def notice(self, sentence: str) -> None:
        """Ignore the notice."""


SILENT = SilentMonitor()


def with_progress(items: Iterable[_T], n_items: int, monitor: Monitor, every: int = _EVERY) -> Iterator[_T]:
    """Yield items and report to a monitor how many of them are done.

    Parameters
    ----------
    items : iterable
        What is worked on.
    n_items : int
        How many there are.
    monitor : Monitor
        Receives the progress; it may raise `Cancelled`.
    every : int
        Number of items between two reports.

    Examples
    --------
    >>> sum(with_progress([1, 2, 3], 3, SILENT))
    6
    """
    for done, item in enumerate(items):
        if done % every == 0:
            monitor.advance(done, n_items)
        yield item


__all__ = ["SILENT", "Cancelled", "Monitor", "SilentMonitor", "with_progress"]


def counted(count: int, singular: str, plural: str = "") -> str:
    """Return a count with its noun.

    Parameters
    ----------
    count : int
        How many.
    singular, plural : str
        The noun; the plural with an s if left out.

    Examples
    --------
    >>> counted(1, "limb"), counted(1200, "frame"), counted(0, "body", "bodies")
    ('1 limb', '1200 frames', '0 bodies')
    """
    return f"{count} {singular if count == 1 else plural or singular + 's'}"


def frames_between(first: int, last: int) -> str:
    """Return words for frames.

    Parameters
    ----------
    first, last : int
        Both are of them.

    Examples
    --------
    >>> frames_between(3, 7), frames_between(5, 5)
    ('frames 3 to 7', 'frame 5')
    """
    return f"frames {first} to {last}" if first < last else f"frame {first}"


def listed(parts: Iterable[str]) -> str:
    """Join parts as a sentence does.

    Examples
    --------
    >>> listed(["pelvis", "chest", "head"]), listed(["pelvis"])
    ('pelvis, chest and head', 'pelvis')
    """
    *first, last = list(parts) or [""]
    return f"{', '.join(first)} and {last}" if first else last
