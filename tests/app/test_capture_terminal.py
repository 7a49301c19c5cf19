"""What a person hits while a command runs."""

from __future__ import annotations

import signal

import pytest

from skelgen.cli.capture_terminal import watched_interrupt


class Ending:
    """Ctrl-C is hit while it is deleted."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_is_heard_even_where_python_drops_it():
    with watched_interrupt() as interrupted:
        one = Ending()
        del one
        assert interrupted.is_set()


def test_ctrl_c_interrupts_and_is_as_before_afterwards():
    before = signal.getsignal(signal.SIGINT)
    with watched_interrupt() as interrupted, pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    assert interrupted.is_set()
    assert signal.getsignal(signal.SIGINT) is before
