"""What an error says to a person, and what it says to those who mend the program."""

from __future__ import annotations

import importlib.metadata
import platform
import traceback

import PySide6
from PySide6.QtCore import QCoreApplication, qVersion

import skelgen
from skelgen.errors import SkelgenError

translate = QCoreApplication.translate

_PACKAGES = ("numpy", "scipy", "scikit-learn", "numba", "ezc3d")


def sentence_of(error: BaseException) -> str:
    """Return one sentence: that of an error which the user can act on, or that the program has a fault."""
    if isinstance(error, SkelgenError):
        return str(error)
    kind = type(error).__name__
    reason = " ".join(f"{kind}: {error}".split()) if str(error) else kind
    told = translate("Errors", "The program has a fault ({0}). What is open stays open; please report the details.")
    return told.format(reason)


def details_of(error: BaseException) -> str:
    """Return where an error came from, and the versions of everything that took part."""
    lines = "".join(traceback.format_exception(error))
    return f"{sentence_of(error)}\n\n{lines}\n{versions()}\n"


def versions() -> str:
    """Return a line per program that takes part, with its version."""
    known = {
        "skelgen": skelgen.__version__,
        "Python": platform.python_version(),
        "PySide6": PySide6.__version__,
        "Qt": qVersion(),
        **{name: _installed(name) for name in _PACKAGES},
        "system": platform.platform(),
    }
    return "\n".join(f"{name} {version}" for name, version in known.items())


def _installed(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return translate("Errors", "is not installed")
