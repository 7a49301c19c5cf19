"""The licences of everything that skelgen installs, from the metadata of the installed packages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from email.message import Message
from importlib import metadata
from typing import cast

PACKAGE = "skelgen"
_FOR_DEVELOPERS = frozenset({"dev", "all"})  # tools that no user installs, and a name for all other extras together
_REQUIREMENT = re.compile(r"^\s*([A-Za-z0-9._-]+)\s*(?:\[([^\]]*)\])?")
_EXTRA = re.compile(r"""extra\s*==\s*['"]([^'"]+)['"]""")
_CLASSIFIER = "License :: OSI Approved :: "
_LONGEST_NAME = 60  # characters; what is longer is the text of a licence where its name belongs
_TEXTS = (
    ("Permission is hereby granted, free of charge", "MIT"),
    ("Redistribution and use in source and binary forms", "BSD"),
    ("Apache License", "Apache-2.0"),
)
"""How the text of a licence begins that stands where its name belongs, and its name."""


@dataclass
class Dependency:
    """A package that skelgen installs.

    Attributes
    ----------
    name : str
        As the package index calls it.
    licence : str
        Name of its licence, as the package states it.
    page : str
        Where it is at home; empty where the package does not say.
    wanted_by : list of str
        Packages and extras of skelgen that need it: ``skelgen``, ``skelgen[gui]``, ...
    """

    name: str
    licence: str
    page: str
    wanted_by: list[str] = field(default_factory=list)


def find_dependencies() -> list[Dependency]:
    """Return every installed package that skelgen or one of its extras needs, itself or through others, by name.

    What is needed only on other systems, or by an extra that is not installed, is not known here.
    """
    found: dict[str, Dependency] = {}
    waiting = [*direct_dependencies()]
    while waiting:
        wanted_by, name, extras = waiting.pop(0)
        distribution = _installed(name)
        if distribution is None:
            continue
        key = _normal(name)
        if key not in found:
            found[key] = _described(distribution)
            waiting += [(found[key].name, *entry[1:]) for entry in _requirements(distribution, extras)]
        if wanted_by not in found[key].wanted_by:
            found[key].wanted_by.append(wanted_by)
    return sorted(found.values(), key=lambda entry: _normal(entry.name))


def direct_dependencies() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Yield who needs it (``skelgen`` or ``skelgen[extra]``), a package's name, and the package's extras."""
    distribution = metadata.distribution(PACKAGE)
    extras = set(distribution.metadata.get_all("Provides-Extra") or ()) - _FOR_DEVELOPERS
    for extra, name, wanted in _requirements(distribution, tuple(sorted(extras))):
        if _normal(name) != PACKAGE:
            yield f"{PACKAGE}[{extra}]" if extra else PACKAGE, name, wanted


def licences_markdown() -> str:
    """Return the page docs/licences.md."""
    rows = [
        f"| {f'[{entry.name}]({entry.page})' if entry.page else entry.name} | {entry.licence} "
        f"| {', '.join(sorted(entry.wanted_by))} |"
        for entry in find_dependencies()
    ]
    lines = [
        "# Licences of what skelgen installs",
        "",
        "skelgen itself is under the MIT licence. This page is generated from the metadata of the installed packages;",
        "the tests compare it with them. `skelgen[gui]` and the like are extras, installed only when asked for.",
        "",
        "| package | licence, as the package states it | needed by |",
        "|---|---|---|",
        *rows,
    ]
    return "\n".join(lines) + "\n"


def _requirements(
    distribution: metadata.Distribution, extras: tuple[str, ...]
) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Yield the extra that asks for it (or empty), the name and the extras of what a package needs."""
    for text in distribution.requires or ():
        requirement, _, marker = text.partition(";")
        asked = _EXTRA.search(marker)
        match = _REQUIREMENT.match(requirement)
        if match is None or (asked is not None and asked.group(1) not in extras):
            continue
        wanted = tuple(name.strip() for name in (match.group(2) or "").split(",") if name.strip())
        yield asked.group(1) if asked else "", match.group(1), wanted


def _installed(name: str) -> metadata.Distribution | None:
    try:
        return metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return None


def _described(distribution: metadata.Distribution) -> Dependency:
    told = cast(Message, distribution.metadata)
    name = str(told["Name"])
    return Dependency(name, _licence(told) or "not stated", _page(told))


def _licence(told: Message) -> str:
    """The licence's name: the expression, else the field, unless that holds the whole text, else the classifiers."""
    expression = told.get("License-Expression")
    if expression:
        return str(expression)
    stated = " ".join(str(told.get("License") or "").split())
    if stated and stated != "UNKNOWN" and len(stated) <= _LONGEST_NAME:
        return stated
    classifiers = [str(entry) for entry in told.get_all("Classifier") or ()]
    names = [entry.removeprefix(_CLASSIFIER) for entry in classifiers if entry.startswith(_CLASSIFIER)]
    if names:
        return ", ".join(names)
    return next((name for beginning, name in _TEXTS if beginning in stated), "")


def _page(told: Message) -> str:
    """The home page, or the first address that looks like one."""
    pages = dict(str(entry).split(", ", 1) for entry in told.get_all("Project-URL") or () if ", " in str(entry))
    by_name = {name.lower(): page for name, page in pages.items()}
    known = [by_name.get(name, "") for name in ("homepage", "home", "source", "source code", "repository")]
    stated = [str(told.get("Home-page") or ""), *known, *pages.values()]
    return next((page for page in stated if page), "")


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
