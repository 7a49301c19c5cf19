"""What any calibration is worth: a grade, and sentences that say why."""

from __future__ import annotations

from dataclasses import dataclass

GOOD, USABLE, REPEAT = "good", "usable", "repeat"
"""Grades, best first."""


@dataclass(frozen=True)
class Verdict:
    """A judgement in words.

    Attributes
    ----------
    grade : str
        ``good``, ``usable`` or ``repeat``.
    sentences : tuple of str
        The judgement, and then what would make it better, the most important first.
    """

    grade: str
    sentences: tuple[str, ...]

    def __str__(self) -> str:
        return " ".join(self.sentences)


def as_sentence(words: str) -> str:
    """Return a notice as a sentence: with a capital, and a full stop."""
    return f"{words[:1].upper()}{words[1:]}{'' if words.endswith('.') else '.'}"
