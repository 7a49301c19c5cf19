"""Cameras of a GenTL producer (a maker's .cti file: GigE, USB3, CoaXPress), by harvesters."""

import contextlib
import os
import time as clock
from contextlib import ExitStack
from pathlib import Path
from types import ModuleType
from typing import Any

from skelgen.capture.images import extra_module
from skelgen.capture.sources import genicam
from skelgen.capture.sources.options import GenicamOptions, only_two
from skelgen.capture.sources.pairs import Opener, Shot, with_rate
from skelgen.errors import CaptureError, ParameterError

EXAMPLE = "gentl:producer.cti,LEFT,RIGHT"
"""Two cameras, as a user would name them."""

_PATH_VARIABLES = ("GENICAM_GENTL64_PATH", "GENICAM_GENTL32_PATH", "ProgramFiles")
_INSTALLED = ("/opt", "/usr", "/Library")
_NANOSECONDS = 1e-9
_BUFFERS = 8  # images that wait: a late program loses none within an eighth of a second at 60 Hz
_LEAST_WAIT = 0.001  # s; with zero, harvesters would wait for ever
_RATE, _EXPOSURE = ("AcquisitionFrameRate", "AcquisitionFrameRateAbs"), ("ExposureTime", "ExposureTimeAbs")
_GAIN = ("Gain", "GainRaw")


def opener(places: tuple[str, ...], options: GenicamOptions) -> Opener:
    """Return what opens cameras of a producer.

    Parameters
    ----------
    places : tuple of str
        The producer's file, then identifiers or serial numbers of cameras; without them the only two there are, in the
        producer's order.
    options : GenicamOptions
        Rate, exposure, trigger and the like.

    Raises
    ------
    ParameterError
        If no file is named.
    CaptureError
        If there is no such file.
    """
    if not places:
        raise ParameterError(f"gentl: names no producer's .cti file, as in {EXAMPLE}")
    producer = Path(places[0])
    if not producer.is_file():
        raise CaptureError(f"{producer}: no such GenTL producer; the camera's maker installs it, often below /opt")
    return lambda stack: with_rate(_open(stack, producer, places[1:], options))


def check_trusted(places: tuple[str, ...]) -> None:
    """Raise `CaptureError` unless a producer that a file names is where producers are installed.

    A producer is a program: it runs as soon as it is loaded. Trusted are the folders of `GENICAM_GENTL64_PATH`, which
    makers' installers set, and those that only an administrator writes to.

    Parameters
    ----------
    places : tuple of str
        As of `opener`.
    """
    listed = os.pathsep.join(os.environ.get(name, "") for name in _PATH_VARIABLES)
    folders = [Path(folder).resolve() for folder in (*listed.split(os.pathsep), *_INSTALLED) if folder]
    producer = Path(places[0] if places else "").resolve()
    if not any(producer.is_relative_to(folder) for folder in folders):
        what = "a program that settings name is loaded only from a folder of GENICAM_GENTL64_PATH, /opt or /usr"
        raise CaptureError(f"{producer}: {what}; if you trust it, name it yourself: --source gentl:{producer}")


class GentlCamera:
    """A camera that streams until the stack closes it.

    Parameters
    ----------
    harvester : harvesters.core.Harvester
        With the producer loaded.
    device : harvesters device information
        One of its list.
    options : GenicamOptions
        How it is to run.
    stack : ExitStack
        Closes the camera.
    """

    capacity: int | None = _BUFFERS

    def __init__(self, harvester: Any, device: Any, options: GenicamOptions, stack: ExitStack) -> None:
        self.name = f"camera {device.id_} ({device.vendor} {device.model})"
        self._clock, self._number = genicam.SharedClock(), genicam.FrameNumber()
        with genicam.errors_in_words(self.name, *_errors()):
            self._camera = harvester.create({"id_": device.id_})
            genicam.close_at_the_end(stack, self._camera.destroy, *_genicam_error())
            self._camera.num_buffers = max(_BUFFERS, self._camera.min_num_buffers)
            self.capacity = self._camera.num_buffers
            self.rate = _set_up(self._camera.remote_device.node_map, options)
            self._camera.start()
            genicam.close_at_the_end(stack, self._camera.stop, *_genicam_error())
        self.size = genicam.first_size(self, options)

    def take(self, timeout: float) -> Shot | None:
        """Return the next image, or None if none comes in time.

        Raises
        ------
        CaptureError
            If the producer fails, or sends no grey images.
        """
        with genicam.errors_in_words(self.name, *_errors()):
            buffer = self._camera.try_fetch(timeout=max(timeout, _LEAST_WAIT))
            if buffer is None:
                return None
            arrived = clock.time()
            with buffer:
                image = buffer.payload.components[0]
                values = image.data
                if values.size == image.height * image.width:
                    values = values.reshape(image.height, image.width)
                taken = self._clock.time(_device_time(buffer), arrived)
                return Shot(genicam.grey(values, image.data_format, self.name), taken, self._number.of(buffer.frame_id))


def _open(stack: ExitStack, producer: Path, names: tuple[str, ...], options: GenicamOptions) -> list[GentlCamera]:
    with genicam.errors_in_words(str(producer), *_errors()):
        harvester = _harvesters().Harvester()
        genicam.close_at_the_end(stack, harvester.reset, *_genicam_error())
        harvester.add_file(str(producer))
        harvester.update()
    found = list(harvester.device_info_list)
    listed = "found " + (", ".join(device.id_ for device in found) or "no camera; check cables and power")
    if not names:
        chosen = only_two(found, f"{producer} {listed}", EXAMPLE)
    else:
        known = [(device.id_, _serial(device)) for device in found]
        chosen = genicam.named(found, known, names, f"{producer} has no camera", listed)
    return [GentlCamera(harvester, device, options, stack) for device in chosen]


def _set_up(nodes: Any, options: GenicamOptions) -> float | None:
    """Set what was asked for, and return the rate [Hz] if the camera runs at one of its own."""
    if nodes.has_node("PixelFormat") and "Mono8" in nodes.PixelFormat.symbolics:
        nodes.PixelFormat.value = "Mono8"
    if options.exposure:
        _set(nodes, _EXPOSURE, options.exposure)
    if options.gain >= 0:
        _set(nodes, _GAIN, options.gain)
    if options.trigger:
        trigger = {"TriggerSelector": "FrameStart", "TriggerSource": options.trigger, "TriggerMode": "On"}
        for name, value in trigger.items():
            _feature(nodes, (name,)).value = value
        return options.rate or None
    if options.rate:
        if nodes.has_node("AcquisitionFrameRateEnable"):
            nodes.AcquisitionFrameRateEnable.value = True
        _set(nodes, _RATE, options.rate)
    there = [name for name in _RATE if nodes.has_node(name)]
    return float(nodes.get_node(there[0]).value) if there else None


def _set(nodes: Any, names: tuple[str, ...], value: float) -> None:
    """Set a number, within its boundaries."""
    node = _feature(nodes, names)
    if not node.min <= value <= node.max:
        raise ParameterError(f"{names[0]} is {value:g}; the camera takes {node.min:g} .. {node.max:g}")
    node.value = type(node.value)(value)


def _feature(nodes: Any, names: tuple[str, ...]) -> Any:
    """Return the first feature of these names that the camera has."""
    there = [name for name in names if nodes.has_node(name)]
    if not there:
        raise CaptureError(f"the camera has no {names[0]} that could be set")
    return nodes.get_node(there[0])


def _device_time(buffer: Any) -> float | None:
    """Return when the image was taken by the camera's clock [s]; None if the producer does not say."""
    with contextlib.suppress(*_genicam_error()):
        nanoseconds = buffer.timestamp_ns
        return nanoseconds * _NANOSECONDS if nanoseconds else None
    return None


def _serial(device: Any) -> str:
    with contextlib.suppress(*_genicam_error()):
        return str(device.serial_number)
    return ""


def _errors() -> tuple[type[Exception], ...]:
    return (*_genicam_error(), OSError, ValueError)


def _genicam_error() -> tuple[type[Exception], ...]:
    _harvesters()
    from genicam import genapi, gentl  # noqa: PLC0415 - an extra that comes with harvesters

    return (gentl.GenericException, genapi.GenericException)


def _harvesters() -> ModuleType:
    return extra_module("harvesters.core", "harvesters for GenTL cameras", "gentl")
