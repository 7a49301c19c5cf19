"""Cyclic garbage is collected on the window's thread alone."""

from __future__ import annotations

import gc
import threading
import weakref

import pytest
from skelgen_gui.main import GarbageCollector, collect_due_garbage


@pytest.fixture
def collector(qtbot):
    collector = GarbageCollector()
    yield collector
    collector.end()
    gc.disable()  # as the fixture of all tests has it


class Cycle:
    """Refers to itself, and notes the thread on which it ends."""

    def __init__(self, ended):
        self.itself, self.ended = self, ended

    def __del__(self):
        self.ended.append(threading.current_thread())


def drop_cycles(ended):
    """Leave much more garbage than what makes Python collect."""
    for _ in range(20 * gc.get_threshold()[0]):
        Cycle(ended)


def test_garbage_of_other_threads_ends_on_the_window_s(qtbot, collector):
    ended = []
    worker = threading.Thread(target=drop_cycles, args=(ended,))
    worker.start()
    worker.join()
    assert ended == []
    qtbot.waitUntil(lambda: len(ended) == 20 * gc.get_threshold()[0])
    assert set(ended) == {threading.main_thread()}


def test_what_outlives_the_young_is_collected_too(collector):
    ended = []
    kept = Cycle(ended)
    gc.collect(0)
    gc.collect(1)  # now it is of the oldest generation
    del kept
    for _ in range(200):
        drop_cycles([])
        collect_due_garbage()
        if ended:
            break
    assert ended


def test_what_is_spared_stays_and_the_rest_is_collected(qtbot, collector):
    ended = []
    spared = Cycle(ended)
    collector.freeze_existing()
    there = weakref.ref(spared)
    del spared
    gc.collect()
    assert there() is not None
    collector.end()
    gc.collect()
    assert there() is None


def test_python_collects_again_after_the_end(collector):
    assert not gc.isenabled()
    collector.end()
    assert gc.isenabled()
