"""One IIDC camera on an IEEE 1394 bus: settings within its boundaries, a ring of images, time-outs."""

import contextlib
import ctypes
import os
import select
import time as clock
from dataclasses import dataclass
from typing import Any

import numpy as np

from skelgen.capture.sources.firewire import library as dc
from skelgen.capture.sources.pairs import Shot
from skelgen.errors import CaptureError, ParameterError

Modes = dict[tuple[int, int], tuple[float, ...]]
"""Sizes (width, height) [px] of grey images of 8 bits, and the rates [Hz] of each."""

_MICROSECONDS = 1e-6
_GONE = select.POLLHUP | select.POLLERR | select.POLLNVAL


@dataclass(frozen=True)
class Setting:
    """How a camera is to run.

    Attributes
    ----------
    size : tuple of int, px
        Width and height.
    rate : float, Hz
        Frames a second.
    speed : int, Mb/s
        Of the bus; 800 needs 1394b.
    shutter, gain : int
        In the camera's units; -1 keeps its value.
    buffers : int
        Images in the ring.
    """

    size: tuple[int, int]
    rate: float
    speed: int
    shutter: int
    gain: int
    buffers: int


class FireWireCamera:
    """A camera, open until `close`.

    Parameters
    ----------
    context : int
        What ``dc1394_new`` gave.
    guid : int
        The camera's number, unique in the world.

    Raises
    ------
    CaptureError
        If there is no such camera on the bus.
    """

    def __init__(self, context: int, guid: int) -> None:
        self._library = dc.dc1394()
        self._camera = self._library.other("dc1394_camera_new", context, guid)
        if not self._camera:
            raise CaptureError(f"no FireWire camera {guid:016x} can be opened; is it plugged in?")
        about = self._camera.contents
        self.name = f"camera {guid:016x} ({_text(about.vendor)} {_text(about.model)})"
        self.knows_1394b = bool(about.bmode_capable)
        self.size = (0, 0)
        self.capacity: int | None = 0
        self._descriptor = -1
        self._poll = select.poll()

    def modes(self) -> Modes:
        """Return what the camera offers in grey."""
        found = dc.VideoModes()
        self._call("dc1394_video_get_supported_modes", ctypes.byref(found))
        offered = [mode for mode in found.modes[: found.num] if mode in dc.MONO8_MODES]
        return {dc.MONO8_MODES[mode]: self._rates(mode) for mode in offered}

    def set_up(self, setting: Setting) -> None:
        """Set speed, size, rate, shutter and gain, and make the ring; images flow when `transmit` is called.

        Raises
        ------
        CaptureError
            If the camera refuses, or the bus has no bandwidth left (a `FireWireError` with such a code).
        ParameterError
            If shutter or gain lie outside what the camera says.
        """
        self.transmit(False)  # a program that died may have left it on
        self._call("dc1394_video_set_operation_mode", dc.MODE_1394B if setting.speed >= 800 else dc.LEGACY)
        self._call("dc1394_video_set_iso_speed", dc.ISO_SPEEDS[setting.speed])
        self._call("dc1394_video_set_mode", _key(dc.MONO8_MODES, setting.size))
        self._call("dc1394_video_set_framerate", _key(dc.FRAME_RATES, setting.rate))
        if self._has(dc.TRIGGER):
            self._call("dc1394_external_trigger_set_power", dc.OFF)
        self._fix(dc.SHUTTER, "shutter", setting.shutter)
        self._fix(dc.GAIN, "gain", setting.gain)
        self._call("dc1394_capture_setup", setting.buffers, dc.CAPTURE_DEFAULT)
        self.size, self.capacity = setting.size, setting.buffers
        self._descriptor = self._library.other("dc1394_capture_get_fileno", self._camera)
        self._poll.register(self._descriptor, select.POLLIN)

    def bandwidth(self) -> int:
        """Return how many of the bus's units the present setting needs."""
        return self._number("dc1394_video_get_bandwidth_usage")

    def transmit(self, on: bool, broadcast: bool = False) -> None:
        """Start or stop sending images.

        Parameters
        ----------
        on : bool
            Whether to send.
        broadcast : bool
            All cameras on the bus do so in one cycle.
        """
        if broadcast:
            self._call("dc1394_camera_set_broadcast", dc.ON)
        try:
            self._call("dc1394_video_set_transmission", dc.ON if on else dc.OFF)
        finally:
            if broadcast:
                self._call("dc1394_camera_set_broadcast", dc.OFF)

    def transmits(self) -> bool:
        """Whether the camera says that it sends."""
        return self._number("dc1394_video_get_transmission", kind=ctypes.c_int) == dc.ON

    def feature(self, which: int) -> tuple[int, bool]:
        """Return the value of a feature, and whether it is manual."""
        mode = self._number("dc1394_feature_get_mode", which, kind=ctypes.c_int)
        return self._number("dc1394_feature_get_value", which), mode == dc.MANUAL

    def take(self, timeout: float) -> Shot | None:
        """Return the next image of the ring, copied; None if none comes in time.

        libdc1394 itself would wait for ever, so its descriptor is polled first.

        Parameters
        ----------
        timeout : float, s
            How long to wait; 0 only looks.

        Raises
        ------
        CaptureError
            If the camera was unplugged.
        """
        until = clock.monotonic() + timeout
        frame = ctypes.POINTER(dc.Frame)()
        while True:
            waits = max(until - clock.monotonic(), 0.0)
            events = self._poll.poll(waits * 1000)
            if events and events[0][1] & _GONE:
                raise CaptureError(f"{self.name} was unplugged")
            if not events:
                return None
            self._call("dc1394_capture_dequeue", dc.POLL, ctypes.byref(frame))
            if frame:  # else it was an event without an image: the bus was reset
                return self._copied(frame)

    def close(self) -> None:
        """Stop and let go of everything, whatever the camera still answers."""
        if not self._camera:
            return
        with contextlib.suppress(CaptureError):
            self.transmit(False)
        stopped = self._descriptor < 0
        with contextlib.suppress(CaptureError):
            if not stopped:
                self._call("dc1394_capture_stop")
                stopped = True
        self._library.other("dc1394_camera_free", self._camera)
        self._camera = None
        if not stopped:  # of an unplugged camera the library leaves the descriptor open
            with contextlib.suppress(OSError):
                os.close(self._descriptor)
        self._descriptor = -1

    def _copied(self, frame: Any) -> Shot:
        about = frame.contents
        (width, height), stride = about.size[:2], about.stride
        taken = about.timestamp * _MICROSECONDS if about.timestamp else clock.time()
        ring = (ctypes.c_uint8 * (height * stride)).from_address(about.image)
        image = np.frombuffer(ring, np.uint8).reshape(height, stride)[:, :width].copy()
        self._call("dc1394_capture_enqueue", frame)
        return Shot(image, taken)

    def _rates(self, mode: int) -> tuple[float, ...]:
        found = dc.FrameRates()
        self._call("dc1394_video_get_supported_framerates", mode, ctypes.byref(found))
        return tuple(sorted(dc.FRAME_RATES[rate] for rate in found.framerates[: found.num]))

    def _fix(self, which: int, name: str, value: int) -> None:
        """Make a feature manual, so that brightness does not change by itself, and set it within its boundaries.

        The library itself neither clamps nor refuses values out of bounds.
        """
        if not self._has(which):
            if value >= 0:
                raise ParameterError(f"{self.name} has no {name} that could be set")
            return
        low, high = ctypes.c_uint32(), ctypes.c_uint32()
        self._call("dc1394_feature_get_boundaries", which, ctypes.byref(low), ctypes.byref(high))
        if value >= 0 and not low.value <= value <= high.value:
            raise ParameterError(f"{name} is {value}; {self.name} takes {low.value} .. {high.value}")
        self._call("dc1394_feature_set_mode", which, dc.MANUAL)
        if value >= 0:
            self._call("dc1394_feature_set_value", which, value)

    def _has(self, which: int) -> bool:
        return bool(self._number("dc1394_feature_is_present", which, kind=ctypes.c_int))

    def _number(self, name: str, *arguments: Any, kind: Any = ctypes.c_uint32) -> int:
        try:
            return self._library.number(name, self._camera, *arguments, kind=kind)
        except dc.FireWireError as error:
            raise dc.FireWireError(error.code, f"{self.name}: {error}") from error

    def _call(self, name: str, *arguments: Any) -> None:
        try:
            self._library.call(name, self._camera, *arguments)
        except dc.FireWireError as error:
            raise dc.FireWireError(error.code, f"{self.name}: {error}") from error


def _text(name: bytes | None) -> str:
    return (name or b"?").decode(errors="replace")


def _key(table: dict[int, Any], value: Any) -> int:
    return next(key for key, entry in table.items() if entry == value)


__all__ = ["FireWireCamera", "Modes", "Setting"]
