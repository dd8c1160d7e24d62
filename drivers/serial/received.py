"""What came over a line, in words: a piece that can be printed, and the cause that it shows."""

import re

SHOWN_BYTES = 40
BIT_7 = 0x80
LINE_ENDS = {b"\r\n": "CR LF", b"\n": "LF", b"\r": "CR"}
REFUSAL = re.compile(rb'(?i)\W*(err|\?|unknown|invalid|syntax|nak\b|\x15|1..,")|.*(known|valid) command')
TEXT = re.compile(rb"[\t\r\n -~]+")


def quoted(data: bytes) -> str:
    """The bytes, printable and no more than a message can show."""
    if len(data) <= SHOWN_BYTES:
        return repr(data)
    return f"{data[:SHOWN_BYTES]!r} and {len(data) - SHOWN_BYTES} bytes more"


def is_text(data: bytes) -> bool:
    """Whether it can be read: at a wrong baud rate it could hardly."""
    return TEXT.fullmatch(data) is not None


def what_is_wrong_with(received: bytes, terminator: bytes, usual: str) -> tuple[str, str] | None:
    """What repeated answers show by their bytes alone, and what to do; None if that is nothing.

    ``usual`` is the line that the protocol has, in words.
    """
    line = f"parity settings and baud rate: {usual}"
    if received and not received.strip(b"\0\xff"):
        return "no characters", f"Check that its cable is wired right, and {line}"
    if any(byte & BIT_7 for byte in received):
        plain = bytes(byte & ~BIT_7 for byte in received)
        odd = {byte.bit_count() % 2 for byte in received}
        if is_text(plain) and len(odd) == 1:
            parity = "O" if odd.pop() else "E"
            serial = f'serial = {{ bytesize = 7, parity = "{parity}" }}'
            action = f"Write {serial} in the cell file, or check {line}"
            return f"bytes with bit 7 set, as a parity: {quoted(plain)}", action
        return "bytes with bit 7 set", f"Check {line}"
    if REFUSAL.match(received):
        return "so it does not know the question", "Correct protocol, or what is asked, in the cell file"
    if is_text(received) and terminator not in received:
        end = next((name for end, name in LINE_ENDS.items() if received.endswith(end)), "nothing")
        wanted = LINE_ENDS.get(terminator, repr(terminator))
        action = "Correct protocol, ends_with where the cell file describes it, or timeout_s if it is slow"
        return f"which ends with {end}, where {wanted} is expected", action
    return None
