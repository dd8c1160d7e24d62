"""How often the alarm entries are read, on a clock that only samples, pauses and SDO transfers move."""

from typing import Any

import pytest

from drivers.encoders import node_monitor as alarm_poll
from drivers.encoders.canopen_node import Leg
from drivers.encoders.node_monitor import AlarmPoll, AlarmTiming
from drivers.encoders.object_dictionary import WARNINGS
from drivers.errors import InvalidSampleError

SDO_S, SAMPLE_S = 0.002, 0.005


class SlowBus:
    """Two nodes with an error register and alarms, each of which takes its time to be read."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.value = 0
        self.read_s = 0.0
        self.nodes: list[Any] = [SlowNode(self, number) for number in (1, 2)]

    def monotonic(self) -> float:
        return self.now_s


class SlowNode:
    def __init__(self, bus: SlowBus, number: int) -> None:
        self.leg = Leg(number, number)
        self._bus = bus

    def read_optional(self, entry: object) -> int | None:
        return None if entry is WARNINGS else 0

    def read(self, entry: object) -> int:
        self._bus.now_s += SDO_S
        self._bus.read_s += SDO_S
        return self._bus.value


@pytest.fixture
def bus(monkeypatch):
    bus = SlowBus()
    monkeypatch.setattr(alarm_poll, "time", bus)
    return bus


def sample(bus: SlowBus, poll: AlarmPoll) -> None:
    poll.begin_sample()
    bus.now_s += SAMPLE_S
    poll.check()


def test_samples_leave_it_a_small_share_of_the_bus_and_each_pause(bus) -> None:
    poll = AlarmPoll(bus.nodes, [])
    begun_s, bus.read_s = bus.now_s, 0.0
    while bus.now_s < begun_s + 20.0:
        sample(bus, poll)
    assert 0.8 * AlarmTiming().bus_share < bus.read_s / (bus.now_s - begun_s) <= AlarmTiming().bus_share
    poll = AlarmPoll(bus.nodes, [])
    for _ in range(20):
        bus.now_s += AlarmTiming().period_s
        before_s = bus.read_s
        sample(bus, poll)
        assert bus.read_s > before_s


def test_an_alarm_once_found_is_found_again_until_it_is_gone(bus):
    poll = AlarmPoll(bus.nodes, [])
    bus.value = 1
    bus.now_s += AlarmTiming().period_s
    for _ in range(3):
        with pytest.raises(InvalidSampleError, match="leg 1"):
            sample(bus, poll)
    bus.value = 0
    sample(bus, poll)
