import random

from hypothesis import given
from hypothesis import strategies as st

from tests.drivers.simulated.gauges.garbling import flip_bit, flip_digit


@given(st.binary(min_size=1), st.integers())
def test_one_bit_but_not_the_parity_bit_is_flipped(data, seed):
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
