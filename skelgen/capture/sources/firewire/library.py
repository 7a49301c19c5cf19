"""libdc1394 through ctypes: its types as in dc1394/{types,camera,video,control}.h of version 2.2, and its functions.

The layouts have not changed since 2.2.0 (soname 22 to 26). Nothing here decides anything; see `camera`.
"""

import contextlib
import ctypes
import functools
from ctypes import POINTER, byref, c_char_p, c_int, c_uint16, c_uint32, c_uint64, c_void_p
from typing import Any

from skelgen.errors import CaptureError

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
_MAX_MODES, _MAX_RATES = 32, 8
_N_FORMAT7 = 8
_LOG_LEVELS = (768, 769, 770)


class CameraId(ctypes.Structure):
    """dc1394camera_id_t."""

    _fields_ = (("unit", c_uint16), ("guid", c_uint64))


class CameraList(ctypes.Structure):
    """dc1394camera_list_t."""

    _fields_ = (("num", c_uint32), ("ids", POINTER(CameraId)))


class Camera(ctypes.Structure):
    """dc1394camera_t."""

    _fields_ = (
        ("guid", c_uint64),
        ("unit", c_int),
        ("unit_spec_ID", c_uint32),
        ("unit_sw_version", c_uint32),
        ("unit_sub_sw_version", c_uint32),
        ("command_registers_base", c_uint32),
        ("unit_directory", c_uint32),
        ("unit_dependent_directory", c_uint32),
        ("advanced_features_csr", c_uint64),
        ("PIO_control_csr", c_uint64),
        ("SIO_control_csr", c_uint64),
        ("strobe_control_csr", c_uint64),
        ("format7_csr", c_uint64 * _N_FORMAT7),
        ("iidc_version", c_int),
        ("vendor", c_char_p),
        ("model", c_char_p),
        ("vendor_id", c_uint32),
        ("model_id", c_uint32),
        ("bmode_capable", c_int),
        ("one_shot_capable", c_int),
        ("multi_shot_capable", c_int),
        ("can_switch_on_off", c_int),
        ("has_vmode_error_status", c_int),
        ("has_feature_error_status", c_int),
        ("max_mem_channel", c_int),
        ("flags", c_uint32),
    )


class VideoModes(ctypes.Structure):
    """dc1394video_modes_t."""

    _fields_ = (("num", c_uint32), ("modes", c_int * _MAX_MODES))


class FrameRates(ctypes.Structure):
    """dc1394framerates_t."""

    _fields_ = (("num", c_uint32), ("framerates", c_int * _MAX_RATES))


class Frame(ctypes.Structure):
    """dc1394video_frame_t."""

    _fields_ = (
        ("image", c_void_p),
        ("size", c_uint32 * 2),
        ("position", c_uint32 * 2),
        ("color_coding", c_int),
        ("color_filter", c_int),
        ("yuv_byte_order", c_uint32),
        ("data_depth", c_uint32),
        ("stride", c_uint32),
        ("video_mode", c_int),
        ("total_bytes", c_uint64),
        ("image_bytes", c_uint32),
        ("padding_bytes", c_uint32),
        ("packet_size", c_uint32),
        ("packets_per_frame", c_uint32),
        ("timestamp", c_uint64),
        ("frames_behind", c_uint32),
        ("camera", POINTER(Camera)),
        ("id", c_uint32),
        ("allocated_image_bytes", c_uint64),
        ("little_endian", c_int),
        ("data_in_padding", c_int),
    )


_CAMERA = POINTER(Camera)
_FRAME = POINTER(Frame)
_OTHERS: dict[str, tuple[Any, tuple[Any, ...]]] = {  # result and arguments of what does not return dc1394error_t
    "dc1394_new": (c_void_p, ()),
    "dc1394_free": (None, (c_void_p,)),
    "dc1394_camera_free_list": (None, (POINTER(CameraList),)),
    "dc1394_camera_new": (_CAMERA, (c_void_p, c_uint64)),
    "dc1394_camera_free": (None, (_CAMERA,)),
    "dc1394_capture_get_fileno": (c_int, (_CAMERA,)),
    "dc1394_error_get_string": (c_char_p, (c_int,)),
}
_CALLS: dict[str, tuple[Any, ...]] = {  # arguments of what returns dc1394error_t
    "dc1394_log_register_handler": (c_int, c_void_p, c_void_p),
    "dc1394_camera_enumerate": (c_void_p, POINTER(POINTER(CameraList))),
    "dc1394_camera_set_broadcast": (_CAMERA, c_int),
    "dc1394_video_get_supported_modes": (_CAMERA, POINTER(VideoModes)),
    "dc1394_video_get_supported_framerates": (_CAMERA, c_int, POINTER(FrameRates)),
    "dc1394_video_set_operation_mode": (_CAMERA, c_int),
    "dc1394_video_set_iso_speed": (_CAMERA, c_int),
    "dc1394_video_set_mode": (_CAMERA, c_int),
    "dc1394_video_set_framerate": (_CAMERA, c_int),
    "dc1394_video_get_bandwidth_usage": (_CAMERA, POINTER(c_uint32)),
    "dc1394_video_set_transmission": (_CAMERA, c_int),
    "dc1394_video_get_transmission": (_CAMERA, POINTER(c_int)),
    "dc1394_feature_is_present": (_CAMERA, c_int, POINTER(c_int)),
    "dc1394_feature_get_boundaries": (_CAMERA, c_int, POINTER(c_uint32), POINTER(c_uint32)),
    "dc1394_feature_get_mode": (_CAMERA, c_int, POINTER(c_int)),
    "dc1394_feature_set_mode": (_CAMERA, c_int, c_int),
    "dc1394_feature_get_value": (_CAMERA, c_int, POINTER(c_uint32)),
    "dc1394_feature_set_value": (_CAMERA, c_int, c_uint32),
    "dc1394_external_trigger_set_power": (_CAMERA, c_int),
    "dc1394_capture_setup": (_CAMERA, c_uint32, c_uint32),
    "dc1394_capture_stop": (_CAMERA,),
    "dc1394_capture_dequeue": (_CAMERA, c_int, POINTER(_FRAME)),
    "dc1394_capture_enqueue": (_CAMERA, _FRAME),
}


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
        for name, (result, arguments) in _OTHERS.items():
            function = getattr(loaded, name)
            function.restype, function.argtypes = result, arguments
        for name, arguments in _CALLS.items():
            function = getattr(loaded, name)
            function.restype, function.argtypes = c_int, arguments
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

    def number(self, name: str, *arguments: Any, kind: Any = c_uint32) -> int:
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
        self.call(name, *arguments, byref(value))
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
