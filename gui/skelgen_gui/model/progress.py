"""How much of a whole job is done: one share that never runs back, from parts whose number nobody knows ahead."""

from collections.abc import Mapping

_PART = 0.5  # of what is left of a step: so much is given to a part of it when that begins
_LEAST = 1e-9
_SOON = 0.03  # share that must be done before the time left can be told
_EARLY = 2.0  # s, before which it is not told either


class WholeProgress:
    """The share of a job that is done.

    A step of the plan has a room in proportion to its weight. Parts that begin within a step take half of what is left
    of its room each, since more of them may follow.

    Parameters
    ----------
    plan : mapping of str to float
        Names of the steps in their order, with weights, e.g. in seconds; without any, the job is one step.

    Examples
    --------
    >>> whole = WholeProgress({"labels": 3.0, "limbs": 1.0})
    >>> whole.begin("labels"), whole.advance(1.0), whole.begin("limbs"), whole.advance(0.0)
    (0.0, 0.375, 0.75, 0.75)
    """

    def __init__(self, plan: Mapping[str, float] | None = None) -> None:
        weights = {name: max(weight, _LEAST) for name, weight in (plan or {"": 1.0}).items()}
        total = sum(weights.values())
        self._rooms: dict[str, tuple[float, float]] = {}
        first = 0.0
        for name, weight in weights.items():
            self._rooms[name] = first, first + weight / total
            first += weight / total
        self._is_planned = bool(plan)
        self._end = 1.0 if not plan else self._rooms[next(iter(weights))][1]
        self._part = 0.0, 0.0 if plan else 1.0
        self._n_parts = 0
        self._in_part = 0.0
        self.share = 0.0

    def begin(self, name: str) -> float:
        """Note that a step of the plan, or a part of the current one, begins; return the share."""
        if name in self._rooms:
            first, self._end = self._rooms[name]
            self.share = max(self.share, first)
        self._take_room()
        return self.share

    def advance(self, done: float) -> float:
        """Note which part of the current work is done, 0 .. 1; return the share."""
        if done < self._in_part:  # something else has begun, without a name
            self._take_room()
        self._in_part = done
        first, end = self._part
        self.share = max(self.share, first + (end - first) * min(max(done, 0.0), 1.0))
        return self.share

    def _take_room(self) -> None:
        self._n_parts += 1
        is_all = not self._is_planned and self._n_parts <= 1
        self._part = self.share, self.share + (self._end - self.share) * (1.0 if is_all else _PART)
        self._in_part = 0.0


def seconds_left(share: float, elapsed: float) -> float | None:
    """Return how long a job will take yet [s], as it went so far; None while that cannot be told.

    Parameters
    ----------
    share : float
        What is done of it, 0 .. 1.
    elapsed : float, s
        Since it began.

    Examples
    --------
    >>> seconds_left(0.25, 10.0), seconds_left(0.01, 10.0)
    (30.0, None)
    """
    if share < _SOON or elapsed < _EARLY:
        return None
    return elapsed * (1.0 - share) / share
