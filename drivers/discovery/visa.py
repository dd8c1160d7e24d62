"""What instrument is at a VISA resource: it is asked its name."""

from __future__ import annotations

import threading
from contextlib import closing

from drivers.gauges.visa import IDENTIFY, VisaGauge
from drivers.gauges.visa_port import VisaPort
from drivers.serial.port import NoAnswer

TIMEOUT_S = 2.0
SEPARATOR = "::"
"""In every VISA resource, and in no port."""


def identification(resource: str) -> str:
    """What it answers to ``*IDN?``; empty if nothing.

    Raises:
        HexacellError: PyVISA is not installed, or the resource cannot be opened.
    """
    port = VisaPort(resource, {}, threading.Event())
    with closing(port):
        port.open()
        try:
            answer = port.exchange(IDENTIFY, VisaGauge.terminator, TIMEOUT_S)
        except NoAnswer:
            return ""
    return answer.decode("ascii", "replace").strip()
