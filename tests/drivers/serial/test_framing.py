"""Protects how bytes of a serial line are cut into frames."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.serial.framing import LINE_ENDS, cut_frame

plain = st.binary(max_size=20).filter(lambda data: not set(data) & set(LINE_ENDS))
ends = st.sampled_from([b"", b"\r", b"\n", b"\r\n", b"\0", b"\0\0\r\n"])


def test_no_frame_until_it_is_complete():
    assert cut_frame(b"", b"?\r", b"\r") is None
    assert cut_frame(b"+1.23", b"?\r", b"\r") is None
    assert cut_frame(b"?", b"?\r", b"\r") is None


def test_the_echo_of_the_request_is_no_answer():
    assert cut_frame(b"?\r", b"?\r", b"\r") is None
    assert cut_frame(b"?\r+1.234\r", b"?\r", b"\r") == (b"+1.234\r", b"")
    assert cut_frame(b"R\r\n+1, MM\r\n", b"R\r", b"\r\n") == (b"+1, MM\r\n", b"")
    assert cut_frame(b"M0\rM0,+001.0000\r\n", b"M0\r\n", b"\r") == (b"M0,+001.0000\r", b"\n")


def test_an_answer_that_begins_like_the_request_is_none_of_its_echo():
    assert cut_frame(b"911\r", b"9\r", b"\r") == (b"911\r", b"")
    assert cut_frame(b"M0,+001.0000\r\n", b"M0\r\n", b"\r") == (b"M0,+001.0000\r", b"\n")


def test_bytes_after_the_frame_are_returned_separately():
    assert cut_frame(b"\n+1.234\r\n+2.345\r", b"?\r", b"\r") == (b"+1.234\r", b"\n+2.345\r")


@given(
    ends, st.booleans(), ends, plain.filter(lambda frame: frame not in {b"", b"?"}), st.binary(max_size=20)
)
def test_a_frame_is_found_behind_line_ends_and_echo(before, echoed, between, frame, rest):
    echo = b"?\r" if echoed else b""
    received = before + echo + between + frame + b"\r" + rest
    assert cut_frame(received, b"?\r", b"\r") == (frame + b"\r", rest)


@given(st.binary(max_size=60))
def test_a_frame_consists_of_received_bytes(noise):
    cut = cut_frame(noise, b"?\r", b"\r")
    if cut is not None:
        assert noise.endswith(cut[0] + cut[1])
        assert cut[0].count(b"\r") == 1
