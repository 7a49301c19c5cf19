"""Measures accuracy, speed and memory on this machine: what `skelgen benchmark` and tests/benchmarks share.

May change with every version; scripts import what they need from `skelgen`.
"""

from skelgen.benchmark.page import Section, write_benchmark_page
from skelgen.benchmark.suites import SUITES, measure_page, run_benchmark

__all__ = ["SUITES", "Section", "measure_page", "run_benchmark", "write_benchmark_page"]
