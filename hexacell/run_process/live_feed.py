"""Live values as the snapshots that screens get."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from statistics import stdev
from typing import Any

from drivers.interfaces import GaugeReading
from hexacell.cell.devices import GaugeSettings
from hexacell.kinematics.parameters import JointUnit
from hexacell.run_process.snapshots import ControllerSnapshot, EncoderSnapshot, GaugeSnapshot, LiveSnapshot
from procedures.devices.live_values import LiveValue, LiveValues

NOISE_READINGS = 10
"""Of how many readings at standstill the noise is told, at most; from half of them on."""


class LiveFeed:
    """Makes snapshots of the live values; to be asked for one after each change.

    Attributes:
        is_moving: whether the robot moves, so that readings tell no noise.
    """

    def __init__(self, live: LiveValues, gauges: Sequence[GaugeSettings]) -> None:
        self.is_moving = False
        self._live = live
        self._gauges = tuple(gauges)
        self._recent: dict[str, deque[tuple[float, float]]] = {
            gauge.name: deque(maxlen=NOISE_READINGS) for gauge in gauges
        }

    @property
    def gauges(self) -> tuple[LiveValue[GaugeReading], ...]:
        """The live values of the gauges."""
        return tuple(self._live.gauge(gauge.name) for gauge in self._gauges)

    def snapshot(self) -> LiveSnapshot:
        """The latest values of all devices."""
        live, sample = self._live, self._live.encoders.value
        return LiveSnapshot(
            gauges=tuple(map(self._gauge, self._gauges)),
            encoders=EncoderSnapshot(
                positions=None if sample is None else sample.positions,
                unit=JointUnit.MM if sample is None else sample.unit,
                age_s=_age(live.encoders),
                problem=live.encoders.problem,
            ),
            controller=self._controller(),
            stop_reason=live.stop_reason.value or live.stop_reason.problem,
        )

    def _gauge(self, settings: GaugeSettings) -> GaugeSnapshot:
        shown = self._live.gauge(settings.name)
        return GaugeSnapshot(
            name=settings.name,
            axis=settings.axis,
            sign=settings.sign,
            shown_mm=None if shown.value is None else shown.value.value_mm,
            age_s=_age(shown),
            noise_mm=self._noise(settings.name),
            problem=shown.problem,
            travel_mm=settings.travel_mm,
            middle_mm=settings.middle_mm,
        )

    def _controller(self) -> ControllerSnapshot:
        shown = self._live.controller
        if shown.value is None:
            return ControllerSnapshot(problem=shown.problem)
        return ControllerSnapshot(
            estop=shown.value.estop,
            enabled=shown.value.enabled,
            error_messages=shown.value.error_messages,
            age_s=_age(shown),
            problem=shown.problem,
        )

    def _noise(self, name: str) -> float | None:
        """Standard deviation of the latest readings; forgotten whenever the robot moves."""
        recent, shown = self._recent[name], self._live.gauge(name)
        if self.is_moving:
            recent.clear()
        elif shown.value is not None and (not recent or recent[-1][0] != shown.at_s):
            recent.append((shown.at_s, shown.value.value_mm))
        values = [value for _, value in recent]
        return stdev(values) if len(values) >= NOISE_READINGS // 2 else None


def _age(shown: LiveValue[Any]) -> float | None:
    return None if math.isinf(shown.age_s) else shown.age_s
