"""Keys that are hit while a command runs: none is waited for."""

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType


class Keys:
    """Counts hits; each is answered once."""

    def __init__(self) -> None:
        self._hits = threading.Semaphore(0)

    def was_hit(self) -> bool:
        """Whether a key was hit that was not answered yet."""
        return self._hits.acquire(blocking=False)

    def listen(self) -> None:
        """Count keys until the input ends; runs in a thread of its own."""
        with contextlib.suppress(OSError, ValueError):  # the input was closed: there are no more keys
            while sys.stdin.read(1):
                self._hits.release()


@contextlib.contextmanager
def watched_keys() -> Iterator[Keys]:
    """Yield keys as they are hit: at once on a terminal that can do so, else with each character of a line."""
    keys = Keys()
    with _single_keys():
        threading.Thread(target=keys.listen, daemon=True).start()
        yield keys


@contextlib.contextmanager
def watched_interrupt() -> Iterator[threading.Event]:
    """Yield what Ctrl-C sets beside raising `KeyboardInterrupt`: Python drops an error that meets a finalizer."""
    interrupted = threading.Event()

    def stop(number: int, frame: FrameType | None) -> None:
        if not interrupted.is_set():  # a second one shall not disturb the end that the first one brings about
            interrupted.set()
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # where signals never arrive
        yield interrupted
        return
    before = signal.signal(signal.SIGINT, stop)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _single_keys() -> Iterator[None]:
    """Let the terminal hand on each key without waiting for the end of the line."""
    try:
        import termios
        import tty

        before = termios.tcgetattr(sys.stdin)
    except (ImportError, OSError, ValueError, termios.error):  # no such terminal: a pipe, or another system
        yield
        return
    try:
        tty.setcbreak(sys.stdin)
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
