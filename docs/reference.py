"""Writes the pages of the reference: the public face first, then one page for each package, from the docstrings."""

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
_BASICS = ("skelgen.parameters", "skelgen.progress", "skelgen.files", "skelgen.errors")
_FACE = """Scripts need no more than ``import skelgen``. Lengths are in mm, times in s, angles in rad; frames come
first and xyz last; unseen is NaN."""
_NOT_FOR_USERS = """The pages below describe the packages behind :doc:`the public face <skelgen>`. They are for those
who change skelgen: names in them may change with every version."""


def write_reference(folder: Path) -> None:
    """Write an .rst page for the public face and for every package, and `index.rst` that lists them.

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    """
    folder.mkdir(exist_ok=True)
    pages = {package: _page(package, [package, *_modules(package)]) for package in PACKAGES}
    pages["skelgen.basics"] = _page("skelgen: errors, progress, files, parameters", _BASICS)
    for name, text in {"skelgen": _face(), **pages, "index": _index(pages)}.items():
        (folder / f"{name}.rst").write_text(text, encoding="utf-8")


def _face() -> str:
    """Functions in full, one after the other; values, errors and jobs in full where they are defined."""
    homes = {name: _home(name) for name in skelgen._HOMES}
    functions = [name for name, home in homes.items() if home == f"skelgen.{name}"]
    others = [f"* :py:obj:`skelgen.{name} <{home}>`" for name, home in homes.items() if name not in functions]
    listed = [f"* :py:obj:`skelgen.{name} <{homes[name]}>`" for name in functions]
    described = [f"{_heading(name, '-')}\n.. autofunction:: {homes[name]}\n" for name in functions]
    parts = [_heading("skelgen: the public face", "="), _FACE, "", *listed, "", "Values and errors:", "", *others, ""]
    return "\n".join([*parts, *described])


def _modules(package: str) -> Iterator[str]:
    """Yield the modules below a package; private ones, and the face, which has its own page, are left out."""
    found = util.find_spec(package)
    places = (found.submodule_search_locations if found else None) or ()
    for entry in pkgutil.walk_packages(list(places), f"{package}."):
        if not entry.name.rpartition(".")[2].startswith("_") and entry.name != "skelgen.app.face":
            yield entry.name


def _page(title: str, modules: list[str] | tuple[str, ...]) -> str:
    sections = [
        f"{_heading(name, '-')}\n.. automodule:: {name}\n   :members:\n   :ignore-module-all:\n" for name in modules
    ]
    return _heading(title, "=") + "\n".join(["", *sections])


def _index(pages: dict[str, str]) -> str:
    listed = "\n".join(f"   {name}" for name in pages)
    return (
        f"{_heading('Reference', '=')}\n{_FACE}\n\n.. toctree::\n   :maxdepth: 2\n\n   skelgen\n\n{_NOT_FOR_USERS}\n\n"
        f".. toctree::\n   :maxdepth: 2\n\n{listed}\n"
    )


def _home(name: str) -> str:
    """Where a public name is described: a function of the face on its page, all else in the module that defines it."""
    module = getattr(skelgen, name).__module__
    return f"skelgen.{name}" if module == "skelgen.app.face" else f"{module}.{name}"


def _heading(text: str, line: str) -> str:
    safe = text.replace("_", "\\_")
    return f"{safe}\n{line * len(safe)}\n"
