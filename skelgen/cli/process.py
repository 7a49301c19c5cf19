"""The process of the command line: signals and errors of standard streams end it with a sentence.

A signal that ends a command (`skelgen.interrupts.ENDING`) interrupts it as Ctrl-C does: ``with`` blocks are left, and
release what they hold. Python drops an interrupt that is raised in a finalizer, and libraries may drop one, too. So a
process that goes on is ended after a while, or by a second signal; then only temporary files are removed.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from types import FrameType
from typing import TextIO

from skelgen.errors import ReaderGoneError, WriteError
from skelgen.interrupts import ENDING, remove_unfinished

_GRACE = 10.0  # s in which an interrupted command gives back what it holds
_SENTENCE = "skelgen: interrupted"
_SHOW_CURSOR = b"\x1b[?25h"  # which a bar hides


def run_process() -> int:
    """Run the command line with the arguments of the process and return the exit code."""
    signals = _Signals()
    try:
        signals.heed()
        _open_streams()
        if "--debug" not in sys.argv and not sys.warnoptions:
            warnings.simplefilter("ignore")  # what NumPy warns its programmers of is nothing for a user
            os.environ.setdefault("PYTHONWARNINGS", "ignore")  # of worker processes
            os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
        from skelgen.cli.application import run

        code = run(sys.argv[1:])
        code = signals.exit_code or code
        signals.forget(code)
    except BaseException:
        if not signals.number:
            raise
        print(_SENTENCE, file=sys.stderr)
        code = signals.exit_code
        signals.forget(code)
    remove_unfinished()
    exec("")  # Python forgets an interrupt amid text that it compiled, for which it would end with a code of its own
    return code


class _Signals:
    """Handles the signals that end a program: the first one interrupts it, the next one ends it at once."""

    def __init__(self) -> None:
        self.number = 0

    def heed(self) -> None:
        """Begin to handle them."""
        for number in ENDING:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as below nohup
                signal.signal(number, self._interrupt)
        if hasattr(signal, "SIGALRM"):
            signal.signal(signal.SIGALRM, self._leave)
        sys.unraisablehook = self._end_if_dropped

    @property
    def exit_code(self) -> int:
        """The exit code that shells report for a program that a signal ends; 0 if none came."""
        return 128 + self.number if self.number else 0

    def forget(self, code: int) -> None:
        """The command is done: a signal ends the process with the command's code, or is ignored if one came before."""
        if hasattr(signal, "SIGALRM") and not self.number:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number in ENDING:
            if signal.getsignal(number) == self._interrupt:
                signal.signal(number, signal.SIG_IGN if self.number else lambda *_: os._exit(code))

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        if self.number:
            self._leave()
        self.number = number
        if hasattr(signal, "SIGALRM"):
            signal.setitimer(signal.ITIMER_REAL, _GRACE)
        raise KeyboardInterrupt

    def _leave(self, *_: object) -> None:
        """End the process at once."""
        remove_unfinished()
        with contextlib.suppress(OSError):
            os.write(2, (_SHOW_CURSOR if os.isatty(2) else b"") + f"{_SENTENCE}\n".encode())
        os._exit(self.exit_code)

    def _end_if_dropped(self, dropped: sys.UnraisableHookArgs) -> None:
        """End the process if Python has dropped the exception of an interrupt."""
        if self.number:
            self._leave()
        if not issubclass(dropped.exc_type, KeyboardInterrupt | MemoryError):  # both are told in words
            sys.__unraisablehook__(dropped)


class _Stream(io.TextIOWrapper):
    """A standard stream that raises a sentence if it cannot be written any more; later writes are dropped.

    Parameters
    ----------
    stream : TextIO
        As Python opened it.
    """

    def __init__(self, stream: TextIO) -> None:
        self._holds_results = stream is sys.stdout
        at_once = not self._holds_results or stream.isatty()
        super().__init__(stream.buffer, stream.encoding, "replace", line_buffering=at_once)

    def write(self, text: str) -> int:
        """Write a text; on a terminal its lines are shown at once."""
        with self._errors_in_words():
            super().write(text)
        return len(text)

    def flush(self) -> None:
        """Write what was kept back."""
        with self._errors_in_words():
            super().flush()

    @contextlib.contextmanager
    def _errors_in_words(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            if self._holds_results and error.errno == errno.EPIPE:
                raise ReaderGoneError("nobody reads the standard output any more") from error
            if self._holds_results:
                raise WriteError(f"the standard output cannot be written: {error.strerror}") from error


def _open_streams() -> None:
    """Open the null device for closed standard streams, so that no file gets their number."""
    with contextlib.suppress(OSError):
        while os.open(os.devnull, os.O_RDWR) <= 2:
            pass
    sys.stdin = sys.stdin or io.TextIOWrapper(io.FileIO(0, closefd=False))
    sys.stdout = _Stream(sys.stdout) if sys.stdout else _nowhere()
    sys.stderr = _Stream(sys.stderr) if sys.stderr else _nowhere()


def _nowhere() -> io.TextIOWrapper:
    return io.TextIOWrapper(io.FileIO(os.open(os.devnull, os.O_WRONLY), "w", closefd=False), "utf-8", "replace")
