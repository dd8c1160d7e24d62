"""Three gauges and six encoders inside this process, in simulated time, with the faults of both by name."""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import pytest

from drivers.encoders.cia406 import Cia406Bank
from drivers.simulated.gauges.server import LineFault
from drivers.wire_trace import WireTrace
from hexacell.cell.devices import GaugeSettings, LinearEncoderSettings
from procedures.devices.device_set import Devices
from tests.benchmarks.line_in_process import TRACE_BYTES, Damage, GaugesOnLines, InstrumentLine, LineTime
from tests.benchmarks.paced_can_bus import NODES, PacedBus

PROTOCOLS = {"x": "sylvac", "y": "cdi", "z": "mux10"}
BITRATE = 500_000
HEARTBEAT_S = 0.5
IDLE_S = 0.1
PATIENCE_S = 0.002
UM = 1e-3
JUMP_COUNTS = 400_000
SEEN_BY_ALL = {"silent", "unplugged", "late", "at its end", "in inches"}
SEEN_BY_SETTINGS = {"on hold", "in peak mode", "reversed"}
SEEN = {
    "x": SEEN_BY_ALL | SEEN_BY_SETTINGS | {"low battery", "switched on again"},
    "y": SEEN_BY_ALL | SEEN_BY_SETTINGS,
    "z": SEEN_BY_ALL,
}
"""The faults that a driver sees by itself; of the others in docs/device-faults.md it reads right."""


@dataclass(frozen=True)
class Fault:
    """A fault of one device that can be switched.

    Attributes:
        is_seen: whether its driver has to tell of it.
        ends_when_told: when it is opened again it cannot know; in a run a trial or the reference tells.
    """

    name: str
    switch: Callable[[bool], object]
    is_seen: bool
    ends_when_told: bool = False


class FaultyCell:
    """The devices of a cell, and where its plungers and joints really are.

    Attributes:
        plungers_mm: of the three gauges.
        joints_mm: the six joint variables.
        elapsed_s: how long its devices were left alone.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.plungers_mm, self.joints_mm = [1.0] * 3, [0.0] * 6
        self.elapsed_s = 0.0
        self._jumped = dict.fromkeys(NODES, 0)
        gauges = [
            GaugeSettings(name=axis, axis=axis, protocol=protocol, port=axis, timeout_s=0.5)
            for axis, protocol in PROTOCOLS.items()
        ]
        time = LineTime(lambda: self.elapsed_s)
        self._gauges = GaugesOnLines(monkeypatch, gauges, self.plungers_mm, Damage(), time)
        self.bus = PacedBus(BITRATE, HEARTBEAT_S, idle_s=IDLE_S, patience_s=PATIENCE_S)
        self.bus.install(monkeypatch)
        encoders = {
            "bus": {"interface": "paced"},
            "heartbeat_ms": round(1000 * HEARTBEAT_S),
            "largest_speed_mm_s": 100.0,
        }
        bank = Cia406Bank(LinearEncoderSettings.model_validate(encoders), WireTrace(TRACE_BYTES))
        self.devices = Devices(self._gauges.mounted, bank, None)  # type: ignore[arg-type]

    def pass_by(self, seconds: float) -> None:
        """Leave all devices alone for so long."""
        self.elapsed_s += seconds
        self.bus.time.wait_until(self.bus.time.monotonic() + seconds)

    def stand_at(self, plungers_mm: list[float], joints_mm: list[float]) -> None:
        """Move plungers and joints."""
        self.plungers_mm[:], self.joints_mm[:] = plungers_mm, joints_mm
        for node, joint in zip(NODES, joints_mm, strict=True):
            self.bus.nodes[node].counts = round(joint / UM) + self._jumped[node]

    async def open(self) -> None:
        """All gauges and the encoders, again."""
        await self._gauges.open()
        await self.devices.encoders.open()

    async def close(self) -> None:
        await self._gauges.close()
        await self.devices.encoders.close()

    def faults(self) -> list[Fault]:
        """Those of all devices."""
        found = [fault for place, axis in enumerate(PROTOCOLS) for fault in self._of_gauge(place, axis)]
        return found + [fault for node in NODES for fault in self._of_encoder(node)]

    def _of_gauge(self, place: int, axis: str) -> list[Fault]:
        line, indicator = self._gauges.lines[axis], self._gauges.indicators[place]
        switches: dict[str, Callable[[bool], object]] = {
            "silent": partial(setattr, line, "silent"),
            "unplugged": partial(setattr, line, "unplugged"),
            "at its end": partial(setattr, indicator, "is_at_end"),
            "in inches": partial(setattr, indicator, "inch"),
            "low battery": partial(setattr, indicator, "battery_low"),
            "on hold": lambda on: indicator.set_hold(on=on),
            "in peak mode": lambda on: indicator.set_peak(on=on),
            "reversed": partial(setattr, indicator, "reversed"),
            "switched on again": lambda on: line.introduce() if on else None,
            **{kind.value: partial(_switch, line, kind) for kind in LineFault},
        }
        # These are faults of instruments that can do such things only, whose drivers see them.
        left_out = {*SEEN_BY_SETTINGS, "switched on again"} - SEEN[axis]
        return [
            Fault(
                f"{name}, {PROTOCOLS[axis]}", switch, name in SEEN[axis], ends_when_told=name == "reversed"
            )
            for name, switch in switches.items()
            if name not in left_out
        ]

    def _of_encoder(self, node: int) -> list[Fault]:
        bus, raw = self.bus, self.bus.nodes[node]

        def unplug(on: bool) -> None:
            (bus.unplugged.add if on else bus.unplugged.discard)(node)

        def silence(on: bool) -> None:
            raw.answers_sync = (lambda _sync: []) if on else None

        def alarm(on: bool) -> None:
            raw.objects[0x1001, 0] = bytes((0x21 * on,))
            bus.say(0x80 + node, struct.pack("<HB5x", 0xFF00 * on, 0x21 * on))

        def set_object(index: int, on: bool) -> None:
            raw.objects[index, 0] = bytes((2 * on, 0))

        def boot(on: bool) -> None:
            if on:
                raw.state = 0x7F
                bus.say(0x700 + node, b"\0")

        def jump(on: bool) -> None:
            self._jumped[node] = JUMP_COUNTS * on
            raw.counts += JUMP_COUNTS if on else -JUMP_COUNTS

        switches: dict[str, Callable[[bool], object]] = {
            "unplugged": unplug,
            "silent": silence,
            "emergency": alarm,
            "alarm without emergency": partial(set_object, 0x6503),
            "warning": partial(set_object, 0x6505),
            "booted": boot,
            "jumped": jump,
        }
        return [
            Fault(f"{name}, encoder", switch, is_seen=True, ends_when_told=name == "jumped")
            for name, switch in switches.items()
        ]


def _switch(line: InstrumentLine, kind: LineFault, on: bool) -> None:
    line.faults.switch(kind, on=on)
