"""Gauges of which nothing but the displayed value can be asked."""

from __future__ import annotations

from drivers.errors import GaugeAtEnd
from drivers.gauges.protocol import GaugeState
from drivers.gauges.serial_gauge import SerialGauge


class ValueOnlyGauge(SerialGauge):
    """Its unit, where the value tells it, and its decimals are all that can be checked."""

    async def _read_state(self) -> GaugeState:
        try:
            shown = await self._read_value()
        except GaugeAtEnd:
            return GaugeState()
        return GaugeState(unit=shown.apparent_unit, decimals=shown.decimals)
