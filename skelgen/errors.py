"""The errors that skelgen raises on purpose: one root, one sentence each, always with what to do."""

import errno
from pathlib import Path


class SkelgenError(Exception):
    """Root of all errors that a user can cause and can act on; the command line exits with 2."""

    exit_code = 2
    longest = 300
    """Characters of its sentence."""

    def __init__(self, sentence: str = "") -> None:
        super().__init__(shortened(sentence, self.longest))


class FormatError(SkelgenError):
    """A file is not what its format demands.

    Parameters
    ----------
    path : Path or str
        The file.
    place : str or int
        Where in the file: a line number, ``"byte 16"``, ``"frame 3"``; empty for the whole file.
    what : str
        What was expected, what was found, and what to do.

    Examples
    --------
    >>> str(FormatError("walk.csm", 4, "8 numbers where 9 belong"))
    'walk.csm:4: 8 numbers where 9 belong'
    """

    def __init__(self, path: Path | str, place: str | int, what: str) -> None:
        self.path = Path(path)
        self.place = place
        where = f"{place}: " if place != "" else " "
        Exception.__init__(self, f"{path}:{shortened(where + what)}")  # the name of the file is not cut


class RecordingMovedError(FormatError):
    """The recording that a project refers to is not where it was: its new place must be said."""


class InputError(SkelgenError):
    """Values that no stage can work on: one marker, two frames, nothing but NaN."""

    longest = 800  # what to change about a body of balls is said ball by ball


class ParameterError(SkelgenError):
    """A parameter is unknown, of the wrong type or out of its bounds."""


class CaptureError(SkelgenError):
    """A camera is missing, cannot be set as asked, or breaks off; pairs before that stay good."""

    longest = 800  # calibration says what to do ball by ball


class MissingResultError(SkelgenError):
    """A stage was asked for before the one that it builds on has run."""


class WriteError(SkelgenError):
    """A file cannot be written: no rights, disk full, or a format that cannot hold the value."""


class ReaderGoneError(SkelgenError):
    """Nobody reads the standard output any more, as after ``| head -1``: the command ends without a word."""

    exit_code = 141  # that of programs which the signal SIGPIPE ends


class MissingPackageError(SkelgenError):
    """A package of an extra is not installed; the sentence says how to install it."""


class KernelError(SkelgenError):
    """A kernel cannot be compiled, or its machine code cannot be kept."""


class Cancelled(SkelgenError):  # noqa: N818 - no error, but what the user asked for
    """The user asked for a stop; nothing half-written is left."""

    exit_code = 130


_CUT = " [...] "


def shortened(sentence: str, longest: int = SkelgenError.longest) -> str:
    """Return one line that is not too long: its middle is left out, as what to do stands at the end.

    Parameters
    ----------
    sentence : str
        What is said, with names of foreign files in it.
    longest : int
        Characters of the line.
    """
    sentence = printable(sentence)
    if len(sentence) <= longest:
        return sentence
    behind = longest // 2
    return sentence[: longest - behind - len(_CUT)] + _CUT + sentence[-behind:]


def printable(text: str) -> str:
    """Return a text in one line, without what a foreign name could tell a terminal to do."""
    if text.isprintable():
        return text
    line = " ".join(part.strip() for part in text.splitlines())
    return "".join(character if character.isprintable() else "?" for character in line)


def out_of_memory(error: BaseException) -> str:
    """Return the sentence on an error that came of too little memory, itself or by one that led to it; else nothing."""
    seen: list[BaseException] = []
    at: BaseException | None = error
    while at is not None and at not in seen:
        says_so = any(words in str(at).lower() for words in _NO_MEMORY)
        if isinstance(at, MemoryError) or getattr(at, "errno", None) == errno.ENOMEM or says_so:
            reason = f" ({shortened(str(at))})" if str(at) else ""
            return f"the memory of this computer does not suffice{reason}: take fewer frames, or end other programs"
        seen.append(at)
        at = at.__cause__ or at.__context__
    return ""


_NO_MEMORY = ("cannot allocate memory", "failed to map segment")  # of libraries that are loaded
