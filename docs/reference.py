"""Writes the pages of the reference: one for each package, with a section for each module, from the docstrings."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from importlib import util
from pathlib import Path

import skelgen

PACKAGES = (
    "skelgen.benchmark",
    "skelgen.app",
    "skelgen.stages",
    "skelgen.kinematics",
    "skelgen.geometry",
    "skelgen.model",
    "skelgen.capture",
    "skelgen.simulation",
    "skelgen.evaluation",
    "skelgen_formats",
)
_BASICS = ("skelgen.parameters", "skelgen.progress", "skelgen.files", "skelgen.compiling", "skelgen.errors")
_COMPILED = "compiled"  # modules that hold loops for numba, each with a twin that is easier to read


def write_reference(folder: Path) -> None:
    """Write an .rst page for every package, and `index.rst` that lists them.

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    """
    folder.mkdir(exist_ok=True)
    pages = {package: _page(package, [package, *_modules(package)]) for package in PACKAGES}
    pages["skelgen.basics"] = _page("skelgen: errors, progress, files, parameters, compiling", _BASICS)
    for name, text in {**pages, "index": _index(pages)}.items():
        (folder / f"{name}.rst").write_text(text, encoding="utf-8")


def _modules(package: str) -> Iterator[str]:
    """Yield the modules below a package; whatever is meant for numba's eyes is left out."""
    found = util.find_spec(package)
    places = (found.submodule_search_locations if found else None) or ()
    for entry in pkgutil.walk_packages(list(places), f"{package}."):
        last = entry.name.rpartition(".")[2]
        if not last.startswith("_") and _COMPILED not in last:
            yield entry.name


def _page(title: str, modules: list[str] | tuple[str, ...]) -> str:
    sections = [
        f"{_heading(name, '-')}\n.. automodule:: {name}\n   :members:\n   :ignore-module-all:\n" for name in modules
    ]
    return _heading(title, "=") + "\n".join(["", *sections])


def _index(pages: dict[str, str]) -> str:
    listed = "\n".join(f"   {name}" for name in pages)
    face = "\n".join(f"* :py:obj:`skelgen.{name} <{_home(name)}>`" for name in skelgen.__all__)
    return (
        f"{_heading('Reference', '=')}\n"
        "From the docstrings. Lengths are in mm, times in s, angles in rad; frames come first and xyz last; unseen is\n"
        "NaN. What other programs build on:\n\n"
        f"{face}\n\nPackages, from those that know most to those that know least:\n\n"
        f".. toctree::\n   :maxdepth: 2\n\n{listed}\n"
    )


def _home(name: str) -> str:
    """Where a public name is described: in the module that defines it."""
    return f"{getattr(skelgen, name).__module__}.{name}"


def _heading(text: str, line: str) -> str:
    safe = text.replace("_", "\\_")
    return f"{safe}\n{line * len(safe)}\n"
