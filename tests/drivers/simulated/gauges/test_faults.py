import random

from hypothesis import given
from hypothesis import strategies as st

from drivers.simulated.gauges.faults import InjectedGaugeFault, WireFaults, flip_bit, flip_digit


@given(st.binary(min_size=1), st.integers())
def test_one_bit_and_never_the_parity_bit_is_flipped(data, seed):
    flipped = flip_bit(data, random.Random(seed))
    different = [old ^ new for old, new in zip(data, flipped, strict=True) if old != new]
    assert len(different) == 1
    assert different[0].bit_count() == 1
    assert different[0] < 0x80


@given(st.from_regex(rb"[+-][0-9]{1,3}\.[0-9]{3}\r", fullmatch=True), st.integers())
def test_one_digit_becomes_another_digit(data, seed):
    flipped = flip_digit(data, random.Random(seed))
    different = [new for old, new in zip(data, flipped, strict=True) if old != new]
    assert len(different) == 1
    assert bytes(different).isdigit()


def test_nothing_to_flip_stays_as_it_is():
    assert flip_digit(b"MM\r", random.Random(0)) == b"MM\r"
    assert flip_bit(b"", random.Random(0)) == b""


def test_a_fault_strikes_as_many_answers_as_told():
    faults = WireFaults()
    faults.inject(InjectedGaugeFault.SILENT, answers=2, seconds=0.0)
    assert [faults.apply(b"+1\r")[0] for _ in range(3)] == [b"", b"", b"+1\r"]


def test_a_fault_without_number_strikes_until_it_ends():
    faults = WireFaults()
    faults.inject(InjectedGaugeFault.LATE, answers=None, seconds=2.0)
    assert [faults.apply(b"+1\r") for _ in range(9)] == [(b"+1\r", 2.0)] * 9
    faults.clear(InjectedGaugeFault.LATE)
    faults.clear(InjectedGaugeFault.LATE)
    assert faults.apply(b"+1\r") == (b"+1\r", 0.0)


def test_faults_combine():
    faults = WireFaults()
    faults.inject(InjectedGaugeFault.LATE, answers=None, seconds=2.0)
    faults.inject(InjectedGaugeFault.GARBLED_DIGIT, answers=None, seconds=0.0)
    answer, delay = faults.apply(b"+1.234\r")
    assert answer != b"+1.234\r"
    assert delay == 2.0
