"""Simulated time for fake serial ports: it passes only while a read waits for bytes."""

import time

import pytest

from drivers.serial import port, request_port

SLICE_S = 0.005


class PortTime:
    """The time of one fake port, which stands in for the module ``time`` of the real driver."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def monotonic(self) -> float:
        return self.now_s

    def time(self) -> float:
        return self.now_s

    def wait_for_bytes(self) -> None:
        """What a read does while nothing has come."""
        self.now_s += SLICE_S
        time.sleep(0)  # lets other threads go on

    def install(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Make it the time of every serial port."""
        monkeypatch.setattr(port, "time", self)
        monkeypatch.setattr(request_port, "time", self)
