"""Protects what a wire trace keeps of an exchange, how much memory it may take, and what is logged."""

import logging
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.conformance import served_twin
from drivers.errors import GaugeSilent
from drivers.gauges.sylvac import SylvacGauge
from drivers.serial.shared_port import SharedSerialPorts
from drivers.wire_trace import ENTRY_BYTES, TraceEntry, TrafficDirection, WireTrace, read_trace
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import FileError


def entry(data, time_s=1.5):
    return TraceEntry(time_s, "/dev/ttyUSB0", TrafficDirection.SENT, data)


def test_the_latest_bytes_are_kept_and_the_rest_is_counted() -> None:
    trace = WireTrace(capacity=2 * (ENTRY_BYTES + 4))
    for number in range(5):
        trace(entry(b"abcd", number))
    assert [kept.time_s for kept in trace.entries()] == [3, 4]
    assert trace.dropped == {"/dev/ttyUSB0": 3}
    assert trace.text().splitlines()[0] == "# 3 earlier entries of /dev/ttyUSB0 were forgotten"
    assert len(trace.text().splitlines()) == 3
    trace = WireTrace(capacity=ENTRY_BYTES + 3)
    trace(entry(b"abcd"))
    assert trace.entries() == ()
    assert trace.dropped == {"/dev/ttyUSB0": 1}


def test_what_is_kept_is_bounded_in_memory():
    trace = WireTrace(capacity=1 << 20)
    tracemalloc.start()
    try:
        for number in range(10_000):
            trace(TraceEntry(number / 7, "/dev/ttyUSB0", TrafficDirection.SENT, b"%d" % (number % 10)))
        held, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert trace.dropped
    assert held < 1.3 * (1 << 20)


def test_a_busy_line_takes_nothing_from_the_others():
    trace = WireTrace(capacity=3 * (ENTRY_BYTES + 4))
    trace(entry(b"?\r", 0))
    for number in range(1, 9):
        trace(TraceEntry(number, "encoder bus", TrafficDirection.RECEIVED, b"181#"))
    trace(entry(b"?\r", 9))
    assert [kept.time_s for kept in trace.entries()] == [0, 6, 7, 8, 9]
    assert trace.dropped == {"encoder bus": 5}


@given(
    st.lists(
        st.builds(
            TraceEntry,
            st.floats(0.0, 2e9).map(lambda seconds: round(seconds, 6)),
            st.sampled_from(["/dev/ttyUSB0", "socket://10.0.0.1:4001", "encoder bus slcan /dev/a > b"]),
            st.sampled_from(TrafficDirection),
            st.binary(min_size=1, max_size=40),
        ),
        max_size=20,
    )
)
def test_the_text_of_a_trace_is_read_back(entries):
    trace = WireTrace()
    for one in entries:
        trace(one)
    assert read_trace(f"# a remark\n{trace.text()}") == tuple(entries)


def test_what_is_no_entry_is_named_with_its_line():
    with pytest.raises(FileError, match="line 2 is no entry of a wire trace: 'hello'"):
        read_trace("1.500000 /dev/ttyUSB0 > 3f 0d  ?.\nhello\n")


def logged(caplog: pytest.LogCaptureFixture, name: str) -> list[tuple[str, str]]:
    return [(one.levelname, one.getMessage()) for one in caplog.records if one.name == name]


async def test_a_gauge_logs_under_its_name_and_its_bytes_at_debug(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, "drivers")
    ports = SharedSerialPorts(worst_latency_s=0.1)
    with served_twin(GaugeSettings(name="y", axis="y", protocol="sylvac")) as twin:
        gauge = SylvacGauge(twin.settings, ports)
        await gauge.open()
        twin.inject("silent", on=True)
        with pytest.raises(GaugeSilent):
            await gauge.read_once()
        await gauge.close()
    assert logged(caplog, "drivers.gauges.y") == [
        ("INFO", f"opened on port {twin.settings.port}: SY276"),
        ("WARNING", r"no answer to b'?\r' within 0.5 s"),
    ]
    [first, *_] = logged(caplog, "drivers.wire")
    assert first[0] == "DEBUG"
    assert first[1].endswith("> 55 4e 49 3f 0d  UNI?.")
