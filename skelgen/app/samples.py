"""Samples to begin with, made by the simulation, and compiling ahead of the first run.

``python -m skelgen.app.samples`` runs all stages on small ones, which compiles what they need and keeps it on disk: the
window does so in a process of its own while the user opens a first file.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from skelgen.errors import InputError
from skelgen.marker_sets import read_table
from skelgen.model import Project
from skelgen.parameters import ParameterValue

__all__ = ["SAMPLES", "SampleTake", "compile_ahead", "open_sample"]

_TABLES = Path(__file__).parents[1] / "simulation" / "tables"
_SHORT = 60  # frames, of the takes that are run to compile
_NICENESS = 10  # work ahead gives way to the user's


@dataclass(frozen=True)
class SampleTake:
    """A take that the simulation makes.

    Attributes
    ----------
    key : str
        Short name, e.g. ``person``.
    title, about : str
        What it is called, and what it shows, in a sentence.
    structure : str
        What moves, as `skelgen.simulate` knows it.
    options : mapping of str to value
        Of `skelgen.simulate`.
    """

    key: str
    title: str
    about: str
    structure: str
    options: Mapping[str, ParameterValue]


SAMPLES = tuple(SampleTake(**row) for row in read_table("samples", _TABLES)["samples"])
"""All samples, in the order in which they are offered."""


def open_sample(key: str) -> Project:
    """Return a sample as a bare project.

    Parameters
    ----------
    key : str
        One of the keys of `SAMPLES`.

    Raises
    ------
    InputError
        If there is no such sample.
    """
    sample = next((sample for sample in SAMPLES if sample.key == key), None)
    if sample is None:
        raise InputError(f"there is no sample {key!r}; there are {', '.join(sample.key for sample in SAMPLES)}")
    return _made(sample)


def _made(sample: SampleTake, **changes: ParameterValue) -> Project:
    from skelgen.simulation import simulate  # noqa: PLC0415 - takes time to load

    simulated = simulate(sample.structure, seed=0, parameters=None, **{**sample.options, **changes})
    return Project(replace(simulated.take, name=f"{sample.title} (sample)"))


def compile_ahead() -> None:
    """Run all stages on a person with names and a machine without: what the first run of a user needs is compiled."""
    from skelgen.app.face import reconstruct  # noqa: PLC0415 - takes time to load

    for sample, labelled in ((SAMPLES[0], True), (SAMPLES[1], False)):
        reconstruct(_made(sample, n_frames=_SHORT, labelled=labelled).take)


if __name__ == "__main__":
    os.nice(_NICENESS)
    compile_ahead()
