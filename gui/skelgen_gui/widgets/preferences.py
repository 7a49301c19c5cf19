"""What is kept between runs: preferences, recent files, the place of the window.

Everything is stored as text by QSettings; what a damaged or newer file holds is replaced by defaults.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from PySide6.QtCore import QByteArray, QObject, QSettings, Signal

from skelgen.errors import ParameterError
from skelgen.parameters import StageParameters, declare

MOST_RECENT = 10
"""Files that are remembered."""

_PREFERENCES = "preferences"
_RECENT = "recent"
_COMPILED = "compiled"
_WINDOW = "window"


FOUND, AXES = "found", ("x", "y", "z")
"""What may point up: the axis that the recording determines, or a coordinate axis."""


@dataclass(frozen=True)
class PreferenceValues(StageParameters):
    """How the window looks and behaves; declared as the parameters of stages are, so that one form shows both."""

    stage: ClassVar[str] = _PREFERENCES

    theme: str = declare(
        "system",
        "Colours of the window: dark, light, or as the system has them.",
        choices=("system", "dark", "light"),
        basic=True,
    )
    up_axis: str = declare(
        FOUND,
        "Axis of recordings that points up in the 3-D view: as found from the recording, or always the same.",
        choices=(FOUND, *AXES),
        basic=True,
    )
    embed: bool = declare(
        True, "Whether project files hold the recording; otherwise they refer to it, and are small.", basic=True
    )
    autosave: int = declare(
        60,
        "How often work that is not saved is put aside, for recovery after a crash; 0 = never.",
        unit="s",
        within=(0, 3600),
        basic=True,
    )


class Preferences(QObject):
    """Settings of the window that are kept between runs.

    Signals
    -------
    changed()
        Another preference.
    recent_changed()
        Other recent files.

    Parameters
    ----------
    settings : QSettings
        Where they are kept.
    """

    changed = Signal()
    recent_changed = Signal()

    def __init__(self, settings: QSettings, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._settings = settings
        self._values = self._stored()

    @property
    def values(self) -> PreferenceValues:
        """The preferences."""
        return self._values

    def change(self, values: PreferenceValues) -> None:
        """Keep other preferences."""
        self._values = values
        for name, value in values.as_mapping().items():
            self._settings.setValue(f"{_PREFERENCES}/{name}", str(value))
        self._settings.sync()
        self.changed.emit()

    @property
    def recent(self) -> tuple[Path, ...]:
        """Files opened or saved lately, the last one first, whether or not they are still there."""
        stored = self._settings.value(_RECENT)
        texts = [stored] if isinstance(stored, str) else stored  # an INI file with one entry gives a plain text
        return tuple(Path(text) for text in texts if isinstance(text, str)) if isinstance(texts, list) else ()

    def remember(self, path: Path) -> None:
        """Put a file at the head of the recent ones."""
        path = path.absolute()
        self._keep_recent([path, *(other for other in self.recent if other != path)][:MOST_RECENT])

    def forget_recent(self) -> None:
        """Clear the recent files."""
        self._keep_recent([])

    @property
    def compiled(self) -> str:
        """Digest of the kernels that were compiled ahead; empty at first."""
        return str(self._settings.value(_COMPILED) or "")

    @compiled.setter
    def compiled(self, digest: str) -> None:
        self._settings.setValue(_COMPILED, digest)

    @property
    def geometry(self) -> QByteArray:
        """Place and size of the window, as `QWidget.saveGeometry` gives it; empty at first."""
        return self._bytes("geometry")

    @property
    def layout(self) -> QByteArray:
        """Arrangement of docks and tool bars, as `QMainWindow.saveState` gives it; empty at first."""
        return self._bytes("layout")

    def keep_window(self, geometry: QByteArray, layout: QByteArray) -> None:
        """Keep place and arrangement of the window.

        Parameters
        ----------
        geometry : QByteArray
            Place and size, as `QWidget.saveGeometry` gives it.
        layout : QByteArray
            Docks and tool bars, as `QMainWindow.saveState` gives it.
        """
        self._settings.setValue(f"{_WINDOW}/geometry", geometry)
        self._settings.setValue(f"{_WINDOW}/layout", layout)
        self._settings.sync()

    def _keep_recent(self, paths: list[Path]) -> None:
        self._settings.setValue(_RECENT, [str(path) for path in paths])  # reaches the disk when the window is idle
        self.recent_changed.emit()

    def _bytes(self, name: str) -> QByteArray:
        stored = self._settings.value(f"{_WINDOW}/{name}")
        return stored if isinstance(stored, QByteArray) else QByteArray()

    def _stored(self) -> PreferenceValues:
        values = {}
        for declaration in PreferenceValues.declarations():
            stored = self._settings.value(f"{_PREFERENCES}/{declaration.name}")
            try:
                values[declaration.name] = declaration.check(stored)
            except ParameterError:  # absent, damaged, or of a newer version
                values[declaration.name] = declaration.default
        return PreferenceValues(**values)
