"""Faults of a simulated cell begin and end at once, or with the move they are stated for."""

from typing import Any

import pytest

from drivers.simulated.fault_schedule import FaultSchedule
from hexacell.cell.simulation import FaultKind, SimulatedFault
from hexacell.clock import CellClock
from hexacell.errors import UsageError
from tests.drivers.simulated.conftest import served
from tests.waiting import wait_until


@pytest.fixture
def cell(bundled_cell):
    settings = bundled_cell.settings
    gauges = tuple(gauge.model_copy(update={"protocol": "sylvac"}) for gauge in settings.gauges)
    with served(bundled_cell, settings.model_copy(update={"gauges": gauges})) as simulated:
        yield simulated


@pytest.mark.parametrize(
    ("kind", "device"),
    [
        ("at its end", "w"),
        ("at its end", ""),
        ("at its end", "encoder 1"),
        ("alarm", "x"),
        ("alarm", "encoder 7"),
        ("alarm", "controller"),
        ("stop line", "x"),
        ("emergency stop", "encoder 2"),
    ],
)
def test_impossible_faults_are_refused(cell, kind: FaultKind, device: str) -> None:
    with pytest.raises(UsageError, match=f"no fault '{kind}' can be simulated of '{device}'"):
        cell.faults.inject(kind, device)


class Log:
    """A test double of a cell's faults that records its calls."""

    def __init__(self) -> None:
        self.clock = CellClock(100.0)
        self.told: list[tuple[str, str, float]] = []

    def check(self, kind: FaultKind, device: str) -> None:
        if device == "absent":
            raise UsageError("there is no such device")

    def inject(self, kind: FaultKind, device: str = "") -> None:
        self.told.append(("inject", device, self.clock.now()))

    def clear(self, kind: FaultKind, device: str = "") -> None:
        self.told.append(("clear", device, self.clock.now()))

    def wait_for(self, count: int) -> list[tuple[str, str]]:
        wait_until(lambda: len(self.told) >= count)
        return [(what, device) for what, device, _ in self.told]


@pytest.fixture
def log() -> Any:
    return Log()


def fault(device: str, **values: Any) -> SimulatedFault:
    return SimulatedFault.model_validate({"kind": "silent", "device": device, **values})


@pytest.mark.parametrize("speed", [100.0, 1e9], ids=["in time", "all due at once"])
def test_faults_are_injected_and_cleared_in_their_order(log, speed: float) -> None:
    log.clock = CellClock(speed)
    planned = [fault("b", after_s=4.0), fault("a", after_s=1.0, lasts_s=5.0)]
    with FaultSchedule(log, log.clock, planned):
        assert log.wait_for(3) == [("inject", "a"), ("inject", "b"), ("clear", "a")]
    for (_, _, at_s), due_s in zip(log.told, (1.0, 4.0, 6.0), strict=True):
        assert at_s >= due_s


def test_a_fault_waits_for_its_move(log) -> None:
    with FaultSchedule(log, log.clock, [fault("x", at_move=2)]) as schedule:
        schedule.on_motion_start()
        assert log.told == []
        schedule.on_motion_start()
        assert log.wait_for(1) == [("inject", "x")]
        schedule.on_motion_start()
        schedule.schedule(fault("y", at_move=schedule.move_count + 1))
        schedule.on_motion_start()
        assert log.wait_for(2) == [("inject", "x"), ("inject", "y")]
