"""Cameras on an IEEE 1394 bus (FireWire), by libdc1394."""

from skelgen.capture.sources.firewire.bus import firewire_pairs

__all__ = ["firewire_pairs"]
