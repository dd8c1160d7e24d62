"""Three gauges and six encoders inside this process, in simulated time, with the faults of both by name."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import pytest

from drivers.encoders.cia406 import Cia406Bank
from drivers.serial.shared_port import SharedSerialPorts
from drivers.simulated.gauges.bank import instrument_class
from drivers.simulated.gauges.instruments import Indicator
from drivers.simulated.gauges.server import LineFault
from drivers.wire_trace import WireTrace
from hexacell.cell.devices import GaugeSettings, LinearEncoderSettings
from hexacell.plugins import Group, load
from procedures.devices.device_set import Devices, MountedGauge
from tests.benchmarks.line_in_process import Damage, InstrumentLine, LineTime, have_lines
from tests.benchmarks.paced_can_bus import NODES, PacedBus

PROTOCOLS = {"x": "sylvac", "y": "cdi", "z": "mux10"}
BITRATE = 500_000
HEARTBEAT_S = 0.5
IDLE_S = 0.1
PATIENCE_S = 0.002
UM = 1e-3
JUMP_COUNTS = 400_000
TRACE_BYTES = 50_000
"""Of each line: so little that it is full soon, and grows no more."""

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
        self.ports = SharedSerialPorts(trace=WireTrace(TRACE_BYTES))
        self.elapsed_s = 0.0
        self._jumped = dict.fromkeys(NODES, 0)
        self.indicators, self.lines, mounted = {}, {}, []
        for place, (axis, protocol) in enumerate(PROTOCOLS.items()):
            settings = GaugeSettings(name=axis, axis=axis, protocol=protocol, port=axis, timeout_s=0.5)
            indicator = Indicator(partial(self.plungers_mm.__getitem__, place), settings.travel_mm)
            self.indicators[axis] = indicator
            self.lines[axis] = InstrumentLine(instrument_class(protocol)({1: indicator}), Damage())
            gauge = load(Group.GAUGES, protocol)(settings, self.ports)
            mounted.append(MountedGauge(gauge, settings.mounting))
        have_lines(monkeypatch, self.lines, LineTime(elsewhere_s=lambda: self.elapsed_s))
        self.bus = PacedBus(BITRATE, HEARTBEAT_S, idle_s=IDLE_S, patience_s=PATIENCE_S)
        self.bus.install(monkeypatch)
        encoders = Cia406Bank(
            LinearEncoderSettings.model_validate(
                {
                    "bus": {"interface": "paced"},
                    "heartbeat_ms": round(1000 * HEARTBEAT_S),
                    "largest_speed_mm_s": 100.0,
                }
            ),
            WireTrace(TRACE_BYTES),
        )
        self.devices = Devices(tuple(mounted), encoders, None)  # type: ignore[arg-type]

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
        for mounted in self.devices.gauges:
            await mounted.gauge.close()
            await mounted.gauge.open()
        await self.devices.encoders.open()

    async def close(self) -> None:
        for mounted in self.devices.gauges:
            await mounted.gauge.close()
        await self.devices.encoders.close()
        await self.ports.close()

    def faults(self) -> list[Fault]:
        """Those of all devices."""
        found = [fault for axis in PROTOCOLS for fault in self._of_gauge(axis)]
        return found + [fault for node in NODES for fault in self._of_encoder(node)]

    def _of_gauge(self, axis: str) -> list[Fault]:
        line, indicator, protocol = self.lines[axis], self.indicators[axis], PROTOCOLS[axis]
        switches: dict[str, Callable[[bool], object]] = {
            "silent": partial(setattr, line, "silent"),
            "unplugged": partial(setattr, line, "unplugged"),
            "at its end": lambda on: setattr(indicator, "is_at_end", on),
            "in inches": lambda on: setattr(indicator, "inch", on),
            "low battery": lambda on: setattr(indicator, "battery_low", on),
            **{kind.value: partial(_switch, line, kind) for kind in LineFault},
        }
        if "reversed" in SEEN[axis]:
            switches |= {
                "on hold": lambda on: indicator.set_hold(on=on),
                "in peak mode": lambda on: indicator.set_peak(on=on),
                "reversed": lambda on: setattr(indicator, "reversed", on),
            }
        if "switched on again" in SEEN[axis]:
            switches["switched on again"] = partial(self._switch_on, axis)
        return [
            Fault(f"{name}, {protocol}", switch, name in SEEN[axis], ends_when_told=name == "reversed")
            for name, switch in switches.items()
        ]

    def _switch_on(self, axis: str, on: bool) -> None:
        if on:
            self.lines[axis].introduce()

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
