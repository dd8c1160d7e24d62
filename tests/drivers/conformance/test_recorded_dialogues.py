"""A trace of a driver with a simulated device becomes a test dialogue for the same driver."""

import pytest

from drivers.conformance import DialogueDiffers, recorded_bus, recorded_line, served_twin
from drivers.encoders.cia406 import Cia406Bank
from drivers.serial.shared_port import SharedSerialPorts
from drivers.simulated.encoders.bank import SimulatedEncoderBank
from drivers.wire_trace import TraceEntry, TrafficDirection, WireTrace, read_trace
from hexacell.cell.devices import GaugeSettings, LinearEncoderSettings
from hexacell.clock import CellClock
from hexacell.plugins import Group, load

WORST_LATENCY_S = 0.2


def gauge_settings(protocol: str, port: str | None = None) -> GaugeSettings:
    return GaugeSettings(name="x", axis="x", protocol=protocol, port=port, timeout_s=5.0)


async def technician(
    settings: GaugeSettings, trace: WireTrace | None = None, reads: int = 3
) -> list[float]:
    """Open a gauge, read it, check it."""
    ports = SharedSerialPorts(trace=trace, worst_latency_s=WORST_LATENCY_S)
    gauge = load(Group.GAUGES, settings.protocol)(settings, ports)
    try:
        await gauge.open()
        values = [(await gauge.read()).value_mm for _ in range(reads)]
        await gauge.check()
    finally:
        await gauge.close()
    return values


@pytest.fixture(params=["cdi", "sylvac"])
async def recorded(request):
    """A trace as it stands in a run folder, its line, the protocol, and what was read."""
    trace = WireTrace()
    with served_twin(gauge_settings(request.param)) as twin:
        twin.show(1.25)
        values = await technician(twin.settings, trace)
        [line] = {entry.line for entry in trace.entries()}
    return trace.text(), line, request.param, values


async def test_the_driver_reads_from_the_trace_what_it_read_from_the_gauge(recorded):
    text, line, protocol, values = recorded
    assert values == [1.25] * 3
    with recorded_line(read_trace(text), line) as url:
        assert await technician(gauge_settings(protocol, url)) == values


async def test_a_driver_that_asks_more_is_told_where(recorded):
    text, line, protocol, _ = recorded
    words = r"asks b'(\?|R)\\r', where request \d+ of the trace, at \d+\.\d+, is b'"
    with pytest.raises(DialogueDiffers, match=words), recorded_line(read_trace(text), line) as url:
        await technician(gauge_settings(protocol, url), reads=4)


async def test_what_comes_unasked_comes_again_before_the_first_request():
    def entry(time_s, direction, data):
        return TraceEntry(time_s, "line", direction, data)

    sent, received = TrafficDirection.SENT, TrafficDirection.RECEIVED
    trace = [
        entry(1.0, received, b"DT1010+1.5M\r"),
        entry(2.0, sent, b"?\r"),
        entry(2.01, received, b"+1\r"),
    ]
    with recorded_line(trace, "line") as url:
        ports = SharedSerialPorts(worst_latency_s=WORST_LATENCY_S)
        port = ports.acquire(url, "x", {})
        await port.open()
        assert await port.exchange(b"", b"\r", 5.0) == b"DT1010+1.5M\r"
        assert await port.exchange(b"?\r", b"\r", 5.0) == b"+1\r"
        await ports.close()


@pytest.fixture
async def recorded_encoders():
    """A trace of six encoders, its line, and the counts that were read."""
    trace, settings = WireTrace(), LinearEncoderSettings(timeout_s=5.0, heartbeat_ms=5000)
    simulated = SimulatedEncoderBank(settings, lambda: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], CellClock())
    bank = Cia406Bank(settings.model_copy(update={"bus": simulated.bus_settings}), trace)
    try:
        await bank.open()
        samples = [await bank.read() for _ in range(3)]
    finally:
        await bank.close()
        simulated.close()
    [line] = {entry.line for entry in trace.entries()}
    return read_trace(trace.text()), line, settings, [sample.counts for sample in samples]


async def test_encoders_are_read_from_a_trace(recorded_encoders):
    entries, line, settings, counts = recorded_encoders
    with recorded_bus(entries, line) as bus:
        bank = Cia406Bank(settings.model_copy(update={"bus": dict(bus)}))
        await bank.open()
        assert [(await bank.read()).counts for _ in counts] == counts
        await bank.close()


async def test_a_frame_that_the_trace_has_nowhere_is_named(recorded_encoders):
    entries, line, settings, _ = recorded_encoders
    nowhere = pytest.raises(DialogueDiffers, match=r"asks b'000#800B', which the trace has nowhere")
    with nowhere, recorded_bus(entries, line) as bus:
        changes = {"nodes": (11, 2, 3, 4, 5, 6), "timeout_s": 0.2, "bus": dict(bus)}
        await Cia406Bank(settings.model_copy(update=changes)).open()
