"""The simulated gauges of a cell: one line for each gauge, or for all gauges of a multiplexer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial

from drivers.simulated.gauges.described import ByRequest, Scpi, Streaming, visa_resource
from drivers.simulated.gauges.displays import DigimaticUsb, HeidenhainNd, IdH, KeyenceDlRs1a, Uwave
from drivers.simulated.gauges.indicator import Indicator, PlungerPosition
from drivers.simulated.gauges.instruments import INSTRUMENTS as ASKED
from drivers.simulated.gauges.instruments import Instrument
from drivers.simulated.gauges.modbus import Modbus
from drivers.simulated.gauges.server import LATE_TIMEOUTS, GaugeLineServer, LineFault, LineFaults
from drivers.simulated.serial_line import PtyLine, SocketLine
from drivers.simulated.served_device import Closeable, Switch
from hexacell.cell.described_devices import (
    DescribedFrame,
    ModbusSettings,
    RequestSettings,
    StreamSettings,
    VisaSettings,
)
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.simulation import FaultKind, SimulatedGauges
from hexacell.clock import CellClock
from hexacell.errors import FileError
from hexacell.plugins import Group, load, names

INSTRUMENTS: Mapping[str, type[Instrument]] = {
    **ASKED,
    "digimatic-usb": DigimaticUsb,
    "heidenhain-nd": HeidenhainNd,
    "keyence-dl-rs1a": KeyenceDlRs1a,
    "mitutoyo-id-h": IdH,
    "uwave": Uwave,
}
"""By the protocol in the cell file."""

DESCRIBED = ("request", "stream", "visa", "modbus")
"""Protocols whose instruments the cell file describes."""

InstrumentFactory = Callable[[Mapping[int, Indicator]], Instrument]
"""Makes an instrument of its indicators by channel."""


def simulated_instrument(
    protocol: str,
    indicators: Mapping[int, Indicator],
    described: DescribedFrame | VisaSettings | ModbusSettings | None = None,
) -> Instrument:
    """An instrument with ``protocol``, with ``indicators`` by channel; of this program or of a plug-in.

    Raises:
        FileError: There is no such simulated instrument.
        UsageError: A plug-in for it cannot be loaded.
    """
    if protocol == "request" and isinstance(described, RequestSettings):
        return ByRequest(indicators, described)
    if protocol == "stream" and isinstance(described, StreamSettings):
        return Streaming(indicators, described)
    if protocol == "visa" and isinstance(described, VisaSettings):
        return Scpi(indicators, described)
    if protocol == "modbus" and isinstance(described, ModbusSettings):
        return Modbus(indicators, described)
    if protocol in INSTRUMENTS:
        return INSTRUMENTS[protocol](indicators)
    others = names(Group.SIMULATED_GAUGES)
    if protocol in others:
        made: Instrument = load(Group.SIMULATED_GAUGES, protocol)(indicators)
        return made
    raise FileError(
        f"no simulated gauge speaks protocol {protocol}",
        action=f"Choose one of {', '.join(sorted({*INSTRUMENTS, *DESCRIBED, *others}))}",
    )


class SimulatedGaugeBank(Closeable):
    """The gauges of a simulated cell; serves until it is closed. ``instruments``: others, by protocol.

    ``plungers`` gives the plunger position of each gauge by its name: mm from the middle of the
    travel, in the instrument's own direction, with noise; called from the threads of the lines.

    Raises:
        FileError: A gauge's protocol has no simulated device.
    """

    def __init__(
        self,
        gauges: Sequence[GaugeSettings],
        plungers: Mapping[str, PlungerPosition],
        settings: SimulatedGauges,
        clock: CellClock,
        instruments: Mapping[str, InstrumentFactory] | None = None,
    ) -> None:
        self._instruments = instruments or {}
        self.indicators = {gauge.name: Indicator(plungers[gauge.name], gauge.travel_mm) for gauge in gauges}
        self._settings = settings
        self._clock = clock
        self._channels = {gauge.name: _channel(gauge) for gauge in gauges}
        self._lines: dict[str, GaugeLineServer] = {}
        with ExitStack() as served:
            for group in _by_line(gauges):
                line = served.enter_context(self._serve(group))
                self._lines |= {gauge.name: line for gauge in group}
            self._served = served.pop_all()
        self.gauges = tuple(gauge.model_copy(update={"port": self._address(gauge)}) for gauge in gauges)
        """The settings of the gauges with the ports on which they are served."""

    def line(self, gauge: str) -> GaugeLineServer:
        """The line of ``gauge``."""
        return self._lines[gauge]

    def faults(self, gauge: str) -> dict[FaultKind, Switch]:
        """The faults of ``gauge`` and of its line."""
        line, indicator = self._lines[gauge], self.indicators[gauge]
        return {
            "unplugged": line.set_unplugged,
            "silent": line.set_silent,
            "at its end": indicator.set_at_end,
            "off its plate": indicator.set_pushed,
            "off its middle": indicator.set_off_middle,
            "reversed": indicator.set_reversed,
            "in inches": indicator.set_inch,
            "exchanged": partial(self._exchange, gauge),
            "frozen": indicator.set_frozen,
            "on hold": indicator.set_hold,
            "in peak mode": indicator.set_peak,
            "zeroed": indicator.set_zeroed,
            "low battery": indicator.set_battery_low,
            "switched on again": partial(_switch_on, line, self._channels[gauge]),
            **{fault.value: partial(line.faults.switch, fault) for fault in LineFault},
        }

    def _exchange(self, gauge: str, *, on: bool) -> None:
        """Exchange a gauge with the next one; clearing it exchanges them again."""
        del on
        names = list(self.indicators)
        other = names[(names.index(gauge) + 1) % len(names)]
        self.indicators[gauge].exchange_with(self.indicators[other])

    def _address(self, gauge: GaugeSettings) -> str:
        url = self._lines[gauge.name].url
        return visa_resource(url) if gauge.protocol == "visa" else url

    def _serve(self, group: Sequence[GaugeSettings]) -> GaugeLineServer:
        indicators = {_channel(gauge): self.indicators[gauge.name] for gauge in group}
        first = group[0]
        own = self._instruments.get(first.protocol)
        instrument = (
            own(indicators)
            if own
            else simulated_instrument(
                first.protocol, indicators, first.request or first.stream or first.visa or first.modbus
            )
        )
        name = "-".join(gauge.name for gauge in group)
        return GaugeLineServer(
            instrument,
            PtyLine(name) if self._settings.transport == "pty" else SocketLine(),
            self._clock,
            latency_s=self._settings.latency_s,
            baudrate=self._settings.baudrate,
            faults=LineFaults(LATE_TIMEOUTS * group[0].timeout_s),
        )

    def close(self) -> None:
        """Close every line; closing twice is harmless."""
        self._served.close()


def _switch_on(line: GaugeLineServer, channel: int, *, on: bool) -> None:
    if on:
        line.switch_on(channel)


def _channel(gauge: GaugeSettings) -> int:
    return gauge.place_on_line if gauge.shares_line else 1


def _by_line(gauges: Sequence[GaugeSettings]) -> list[list[GaugeSettings]]:
    """The gauges grouped by line: those of one multiplexer (same protocol and port) together."""
    lines: dict[tuple[str | None, ...], list[GaugeSettings]] = {}
    for gauge in gauges:
        line = (gauge.protocol, gauge.port) if gauge.shares_line else (gauge.name,)
        lines.setdefault(line, []).append(gauge)
    return list(lines.values())
