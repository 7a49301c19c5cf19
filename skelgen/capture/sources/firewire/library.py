"""libdc1394 through ctypes: its types and functions, which stand in the table beside this module.

The layouts have not changed since 2.2.0 (soname 22 to 26). Nothing here decides anything; see `camera`.
"""

import contextlib
import ctypes
import functools
from typing import Any

from skelgen.errors import CaptureError
from skelgen.files import read_table

MONO8_MODES = {69: (640, 480), 73: (800, 600), 76: (1024, 768), 81: (1280, 960), 84: (1600, 1200)}
"""dc1394video_mode_t of the grey modes of 8 bits, and their width and height [px]."""

FRAME_RATES = {32 + step: 1.875 * 2**step for step in range(8)}
"""dc1394framerate_t and its pairs a second [Hz]."""

ISO_SPEEDS = {100: 0, 200: 1, 400: 2, 800: 3}
"""Mb/s, and dc1394speed_t."""

BUS_UNITS = 4915
"""Bandwidth that a bus gives to cameras: 100 of its 125 us, in units of a quadlet at 1600 Mb/s (IEEE 1394)."""

LEGACY, MODE_1394B = 480, 481
SHUTTER, GAIN, TRIGGER = 423, 424, 428
MANUAL = 736
POLL = 673
CAPTURE_DEFAULT = 4
OFF, ON = 0, 1

NO_RESOURCES = (-7, -8)
"""No channel, no bandwidth: of a bus without bandwidth Linux says that it has no channel either."""
_NAMES = ("libdc1394.so.25", "libdc1394.so.26", "libdc1394.so.22", "libdc1394.dylib")
_LOG_LEVELS = (768, 769, 770)


_TABLE = read_table(__file__, "libdc1394")
_TYPES: dict[str, Any] = {
    "u16": ctypes.c_uint16,
    "u32": ctypes.c_uint32,
    "u64": ctypes.c_uint64,
    "int": ctypes.c_int,
    "text": ctypes.c_char_p,
    "address": ctypes.c_void_p,
    "nothing": None,
}


def _type(word: str) -> Any:
    """The type of ctypes that a word of the table stands for."""
    if word.endswith("*"):
        return ctypes.POINTER(_type(word[:-1]))
    name, _, count = word.removesuffix("]").partition("[")
    return _TYPES[name] * int(count) if count else _TYPES[name]


for _name, _fields in _TABLE["structures"].items():
    _laid_out = [(field, _type(word)) for field, word in _fields.items()]
    _TYPES[_name] = type(_name, (ctypes.Structure,), {"_fields_": _laid_out})
CameraList, VideoModes, FrameRates, Frame = map(_type, ("CameraList", "VideoModes", "FrameRates", "Frame"))


class FireWireError(CaptureError):
    """What libdc1394 refused.

    Parameters
    ----------
    code : int
        Its dc1394error_t, below zero.
    sentence : str
        What happened.
    """

    def __init__(self, code: int, sentence: str) -> None:
        self.code = code
        super().__init__(sentence)


class Library:
    """The loaded library; it does not print."""

    def __init__(self, loaded: ctypes.CDLL) -> None:
        self._loaded = loaded
        calls = {name: ["int", *arguments] for name, arguments in _TABLE["calls"].items()}
        for name, words in (_TABLE["others"] | calls).items():
            function = getattr(loaded, name)
            function.restype, *function.argtypes = map(_type, words)
        for level in _LOG_LEVELS:
            self.call("dc1394_log_register_handler", level, None, None)

    def other(self, name: str, *arguments: Any) -> Any:
        """Call a function that cannot fail with a code.

        Parameters
        ----------
        name : str
            Of the function.
        *arguments
            As libdc1394 declares them.
        """
        return getattr(self._loaded, name)(*arguments)

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function.

        Parameters
        ----------
        name : str
            Of the function.
        *arguments
            As libdc1394 declares them.

        Raises
        ------
        FireWireError
            If it returns an error.
        """
        code = getattr(self._loaded, name)(*arguments)
        if code:
            words = self.other("dc1394_error_get_string", code) or b"unknown error"
            raise FireWireError(code, f"{name} failed: {words.decode(errors='replace')} ({code})")

    def number(self, name: str, *arguments: Any, kind: Any = ctypes.c_uint32) -> int:
        """Call a function that returns one number through its last argument.

        Parameters
        ----------
        name : str
            Of the function.
        *arguments
            As libdc1394 declares them, without the last.
        kind : type
            Type of the number, of ctypes.
        """
        value = kind()
        self.call(name, *arguments, ctypes.byref(value))
        return int(value.value)


@functools.cache
def dc1394() -> Library:
    """Load the library.

    Raises
    ------
    CaptureError
        If it is not installed.
    """
    for name in _NAMES:
        with contextlib.suppress(OSError):
            return Library(ctypes.CDLL(name))
    raise CaptureError("FireWire cameras need the library libdc1394: apt install libdc1394-25")
