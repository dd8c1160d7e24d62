"""The simulated gauges of a cell: one line for each gauge, or for all gauges of a multiplexer."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

from drivers.simulated.gauges.instruments import OFF_MIDDLE_MM, Indicator, Instrument, PlungerPosition
from drivers.simulated.gauges.server import LATE_TIMEOUTS, GaugeLineServer, LineFault, LineFaults
from drivers.simulated.serial_line import PtyLine, SocketLine
from drivers.simulated.served_device import ServedGroup, Switch, lasting, setting
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.simulation import FaultKind, SimulatedGauges
from hexacell.clock import CellClock
from hexacell.errors import FileError
from hexacell.plugins import Group, load, names

InstrumentFactory = Callable[..., Instrument]
"""Makes an instrument of its indicators by channel; with its section, if the cell file describes it."""


def instrument_class(protocol: str) -> InstrumentFactory:
    """The simulated instrument that is announced for a protocol, by this program or a plug-in.

    Raises ``FileError`` if there is none, ``UsageError`` if the plug-in for it cannot be loaded.
    """
    known = names(Group.SIMULATED_GAUGES)
    if protocol not in known:
        raise FileError(
            f"no simulated gauge speaks protocol {protocol}", action=f"Choose one of {', '.join(known)}"
        )
    return load(Group.SIMULATED_GAUGES, protocol)


class SimulatedGaugeBank(ServedGroup):
    """The gauges of a simulated cell; serves until it is closed.

    ``plungers`` give, by name of a gauge, the position of its plunger, mm from the middle of the travel, in
    the instrument's own direction, with noise; called from the threads of the lines. ``instruments`` are
    others than those that are announced, by protocol; a protocol without any is a ``FileError``. ``gauges``
    are the settings with the ports on which they are served, ``lines`` the servers of these by name.
    """

    def __init__(
        self,
        gauges: Sequence[GaugeSettings],
        plungers: Mapping[str, PlungerPosition],
        settings: SimulatedGauges,
        clock: CellClock,
        instruments: Mapping[str, InstrumentFactory] | None = None,
    ) -> None:
        self._instruments = dict(instruments or {})
        self.indicators = {gauge.name: Indicator(plungers[gauge.name], gauge.travel_mm) for gauge in gauges}
        self._settings = settings
        self._clock = clock
        self._channels: dict[str, int] = {}
        self.lines: dict[str, GaugeLineServer] = {}
        with ExitStack() as served:
            for group in self._by_line(gauges):
                line = served.enter_context(self._serve(group))
                self.lines |= {gauge.name: line for gauge in group}
            self._served = served.pop_all()
        self.gauges = tuple(one.model_copy(update={"port": self.lines[one.name].address}) for one in gauges)

    def faults(self, gauge: str) -> dict[FaultKind, Switch]:
        line, indicator = self.lines[gauge], self.indicators[gauge]
        return {
            "unplugged": line.set_unplugged,
            "silent": setting(line, "is_silent"),
            "at its end": setting(indicator, "is_at_end"),
            "off its plate": indicator.set_pushed,
            "off its middle": setting(indicator, "off_middle_mm", OFF_MIDDLE_MM, 0.0),
            "reversed": setting(indicator, "reversed"),
            "in inches": setting(indicator, "inch"),
            "exchanged": partial(self._exchange, gauge),
            "frozen": indicator.set_frozen,
            "on hold": indicator.set_hold,
            "in peak mode": indicator.set_peak,
            "zeroed": indicator.set_zeroed,
            "low battery": setting(indicator, "battery_low"),
            "switched on again": lasting(partial(line.switch_on, self._channels[gauge])),
            **{fault.value: partial(line.faults.switch, fault) for fault in LineFault},
        }

    def _exchange(self, gauge: str, *, on: bool) -> None:
        """Exchange a gauge with the next one; clearing it exchanges them again."""
        del on
        names = list(self.indicators)
        other = names[(names.index(gauge) + 1) % len(names)]
        one, two = self.indicators[gauge], self.indicators[other]
        one.plunger, two.plunger = two.plunger, one.plunger

    def _by_line(self, gauges: Sequence[GaugeSettings]) -> list[list[GaugeSettings]]:
        """The gauges grouped by line: those of one multiplexer (same protocol and port) together."""
        lines: dict[tuple[str | None, ...], list[GaugeSettings]] = {}
        for gauge in gauges:
            if gauge.protocol not in self._instruments:
                self._instruments[gauge.protocol] = instrument_class(gauge.protocol)
            kind = self._instruments[gauge.protocol]
            shares = isinstance(kind, type) and issubclass(kind, Instrument) and kind.shares_line(gauge)
            self._channels[gauge.name] = gauge.place_on_line if shares else 1
            line = (gauge.protocol, gauge.port) if shares else (gauge.name,)
            lines.setdefault(line, []).append(gauge)
        return list(lines.values())

    def _serve(self, group: Sequence[GaugeSettings]) -> GaugeLineServer:
        first = group[0]
        described: tuple[Any, ...] = () if first.described is None else (first.described,)
        indicators = {self._channels[gauge.name]: self.indicators[gauge.name] for gauge in group}
        name = "-".join(gauge.name for gauge in group)
        return GaugeLineServer(
            self._instruments[first.protocol](indicators, *described),
            PtyLine(name) if self._settings.transport == "pty" else SocketLine(),
            self._clock,
            latency_s=self._settings.latency_s,
            restart_s=self._settings.restart_s,
            baudrate=self._settings.baudrate,
            faults=LineFaults(LATE_TIMEOUTS * first.timeout_s),
        )
