import tracemalloc

from drivers.wire_trace import ENTRY_BYTES, TraceEntry, TrafficDirection, WireTrace


def entry(data, time_s=1.5):
    return TraceEntry(time_s, "/dev/ttyUSB0", TrafficDirection.SENT, data)


def test_an_entry_reads_as_one_line():
    received = TraceEntry(12.3456789, "/dev/ttyUSB0", TrafficDirection.RECEIVED, b"+1.2\r")
    assert str(received) == "12.345679 /dev/ttyUSB0 < 2b 31 2e 32 0d  +1.2."


def test_the_latest_bytes_are_kept_and_the_rest_is_counted():
    trace = WireTrace(capacity=2 * (ENTRY_BYTES + 4))
    for number in range(5):
        trace(entry(b"abcd", number))
    assert [kept.time_s for kept in trace.entries()] == [3, 4]
    assert trace.dropped == 3
    assert trace.text().splitlines()[0] == "# 3 earlier entries were forgotten"
    assert len(trace.text().splitlines()) == 3


def test_no_dropped_entries_are_not_mentioned():
    trace = WireTrace()
    trace(entry(b"?\r"))
    assert trace.text() == "1.500000 /dev/ttyUSB0 > 3f 0d  ?.\n"


def test_more_than_fits_at_once_is_not_kept():
    trace = WireTrace(capacity=ENTRY_BYTES + 3)
    trace(entry(b"abcd"))
    assert trace.entries() == ()
    assert trace.dropped == 1


def test_what_is_kept_is_bounded_in_memory():
    trace = WireTrace(capacity=1 << 20)
    tracemalloc.start()
    try:
        for number in range(50_000):
            trace(TraceEntry(number / 7, "/dev/ttyUSB0", TrafficDirection.SENT, b"%d" % (number % 10)))
        held, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert trace.dropped
    assert held < 1.3 * (1 << 20)
