"""What the window's Capture page takes while it captures: ``python tests/benchmarks/window_capture.py [seconds]``.

The simulated rig delivers 30 pairs a second by the clock. Measured are the processor time of the window's own thread
for each pair that is shown, its longest piece of work without a break, and whether the memory grows. Then joints are
taken and calibrated for as long, which may not stop the window either.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from PySide6.QtWidgets import QApplication
from shown import show, show_machine, verdict
from skelgen_gui.main import SWITCH_INTERVAL
from skelgen_gui.window import Window
from window import FLAT, memory
from window_pauses import WANTED, Heart, Row, after, until, window_in

SECONDS = 60.0
SETTLING = 10.0  # s, until everything has been painted once
SOURCE = "simulated:arm?paced=yes&rate=30&frames={frames}"
WANTED_SHARE = 12.0  # ms a pair: a third of the time at 30 pairs a second
SIZE = (1440, 900)


def main() -> None:
    """Print the figures."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    sys.setswitchinterval(SWITCH_INTERVAL)
    app = QApplication([])
    show_machine()
    with tempfile.TemporaryDirectory() as folder:
        window, collector = window_in(Path(folder))
        window.resize(*SIZE)
        window.show()
        window.preloading.begin()
        until(app, lambda: not window.preloading.is_busy)
        titles = "what", "wanted", "reached", ""
        show("The Capture page", titles, capture_rows(app, window, seconds))
        show("Joints are taken and calibrated", titles, taking_rows(app, window, seconds))
        window.files.close(window._close)
        until(app, lambda: not window.isVisible())
        collector.end()


def capture_rows(app: QApplication, window: Window, seconds: float) -> list[Row]:
    """Let it capture for some time."""
    page, heart, n_shown = window.pages.page("capture"), Heart(), 0

    def count(_: object) -> None:
        nonlocal n_shown
        n_shown += 1

    page.live.shot.connect(count)
    page.live.choice.source.show_source(SOURCE.format(frames=30 * int(seconds + 6 * SETTLING)))
    heart.start()
    page.live.start()
    until(app, lambda: n_shown > 0)
    loading = heart.own
    until(app, after(SETTLING))
    before, n_shown, worked = memory(), 0, time.thread_time()
    heart.start()
    until(app, after(seconds))
    share, own, longest = 1000 * (time.thread_time() - worked) / max(n_shown, 1), heart.own, heart.longest
    shown, grown = n_shown / seconds, memory() - before
    print(page.live.numbers.text())
    page.live.stop()
    until(app, lambda: not window.jobs.is_busy)
    return [
        ("longest own work while it loads [ms]", f"< {WANTED:g}", f"{loading:.0f}", verdict(loading < WANTED)),
        ("own work for each pair shown [ms]", f"<= {WANTED_SHARE:g}", f"{share:.1f}", verdict(share <= WANTED_SHARE)),
        ("longest own work [ms]", f"< {WANTED:g}", f"{own:.0f}", verdict(own < WANTED)),
        ("longest pause by the clock [ms]", f"< {WANTED:g}", f"{longest:.0f}", verdict(longest < WANTED)),
        (f"memory grown in {seconds:g} s [MiB]", f"< {FLAT:g}", f"{grown:.1f}", verdict(grown < FLAT)),
        ("pairs shown a second", "", f"{shown:.0f}", ""),
    ]


def taking_rows(app: QApplication, window: Window, seconds: float) -> list[Row]:
    """Take the joints of the simulated arm for some time, and calibrate them."""
    page, heart = window.pages.page("capture"), Heart()
    page.tabs.setCurrentWidget(page.joints)
    heart.start()
    page.joints.form.take_source(SOURCE.format(frames=30 * int(seconds)))
    until(app, lambda: not window.jobs.is_busy)
    print(page.joints.verdict.text())
    longest, own = heart.longest, heart.own
    return [
        ("longest own work [ms]", f"< {WANTED:g}", f"{own:.0f}", verdict(own < WANTED)),
        ("longest pause by the clock [ms]", f"< {WANTED:g}", f"{longest:.0f}", verdict(longest < WANTED)),
    ]


if __name__ == "__main__":
    main()
