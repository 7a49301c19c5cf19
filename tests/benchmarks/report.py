"""What the report and its view cost: ``python tests/benchmarks/report.py``, on a person of 9 s with 39 markers.

Processor time is measured, as other work on the machine does not count in it; of the command with all that it loads.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from shown import show, show_machine, verdict

import skelgen
from skelgen.app.report import write_report, write_view
from skelgen.simulation import simulate

OPTIONS = {"n_frames": 900, "motion": "walk", "marker_set": "plug-in-gait", "soft_tissue": "realistic"}
REPORT_SECONDS, COMMAND_SECONDS, VIEW_MB = 0.6, 2.0, 2.0  # wanted at most


def main() -> None:
    """Print what is wanted and what is reached."""
    show_machine()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        project = skelgen.reconstruct(simulate("human", noise=0.2, dropouts=0.03, **OPTIONS).take)
        skelgen.write(project, folder / "take.skelgen")
        seconds = min(_seconds(lambda: write_report(project, folder / "report.html")) for _ in range(3))
        view = write_view(project, folder / "view.html").stat().st_size / 1e6
        command = [
            sys.executable,
            "-m",
            "skelgen",
            "report",
            folder / "take.skelgen",
            "--output",
            folder / "again.html",
        ]
        before = _seconds_of_children()
        subprocess.run(command, check=True, capture_output=True)
        whole = _seconds_of_children() - before
    rows = [
        ("write_report [s]", REPORT_SECONDS, seconds),
        ("skelgen report [s]", COMMAND_SECONDS, whole),
        ("the view alone [MB]", VIEW_MB, view),
    ]
    table = [(what, f"{most:g}", f"{reached:.2f}", verdict(reached <= most)) for what, most, reached in rows]
    show("report", ("figure", "wanted", "reached", ""), table)


def _seconds(act) -> float:
    start = time.process_time()
    act()
    return time.process_time() - start


def _seconds_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
