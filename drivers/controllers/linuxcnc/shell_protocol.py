"""The linuxcncrsh protocol: time limits, commands and responses, without a connection.

A client sends ``get <what>`` or ``set <what> <value>``, one line each. ``get`` answers
``<WHAT> <words>``, ``set`` answers ``SET <WHAT> ACK`` once verbose is on, and both answer ``NAK``
when refused. LinuxCNC 2.9 ends lines with CR LF after ``get`` and with LF CR after ``set``, and
adds a blank line after some refusals; 2.10 ends all with CR LF and explains a refusal in
``error: ...`` lines before the NAK. (linuxcncrsh(1), and a wire trace of 2.9.)
"""

import math
from dataclasses import dataclass

from drivers.controllers.adapter.served_robot import FailedError

MAX_LINE_BYTES = 255
"""Longest command with its line end; a longer one overruns the buffer of LinuxCNC 2.9."""

_EXPLANATION = "error:"
_RESPONSE_NAME = {"SET_WAIT": "WAIT_MODE"}


@dataclass(frozen=True, slots=True)
class Limits:
    """Longest waits, s of real time.

    Measured on LinuxCNC 2.9: a query is answered in 1 ms, switching takes at most 0.4 s, an abort 0.6 s; a
    refusal of 2.10 comes together with its explanation. On a computer with five times the load that it can
    carry, a change of state was acknowledged after 5.3 s.

    Attributes:
        connect: to be connected.
        answer: for the answer to a query, and ``command`` for that to a command that moves nothing.
        explanation: for what follows an explanation.
        arrival: for a motion to go on, once its end was acknowledged elsewhere.
        quick: for each answer to a stop over a connection that is there, and ``stop`` over another one.
        rest: for a machine to be at rest after it was told to stop.
    """

    connect: float = 3.0
    answer: float = 5.0
    command: float = 20.0
    explanation: float = 0.3
    arrival: float = 1.0
    quick: float = 0.3
    stop: float = 1.25
    rest: float = 2.0


@dataclass(frozen=True, slots=True)
class Response:
    """The response to one command.

    ``text`` follows the queried name, and is empty after ``set``. ``explanations`` are the error lines
    that came with it.
    """

    accepted: bool
    text: str = ""
    explanations: tuple[str, ...] = ()


class LineBuffer:
    """Splits received bytes into lines at any mixture of CR and LF; drops blank lines."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        """The lines completed by ``data``; undecodable bytes become replacement characters."""
        *complete, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        return [line.decode("utf-8", "replace").strip() for line in complete if line.strip()]

    @property
    def rest(self) -> str:
        """The received part of an incomplete line."""
        return self._rest.decode("utf-8", "replace").strip()


def encode_command(command: str) -> bytes:
    """The bytes of one command line.

    Raises:
        FailedError: It is longer than the server's buffer, or is more than one line.
    """
    line = command.encode() + b"\r\n"
    if len(line) > MAX_LINE_BYTES:
        problem = f"a command of {len(line)} bytes is longer than the {MAX_LINE_BYTES} it can take"
        raise FailedError("fault", problem)
    if b"\r" in line[:-2] or b"\n" in line[:-2]:
        raise FailedError("fault", "a command must be a single line")
    return line


def parse_explanation(line: str) -> str:
    """The explanation in one of 2.10's ``error: ...`` lines, empty for any other line."""
    return line[len(_EXPLANATION) :].strip() if line.lower().startswith(_EXPLANATION) else ""


def parse_response(line: str, command: str) -> Response | None:
    """The response to ``command`` in ``line``; None if the line is something else, such as an echo."""
    verb, name = (word.upper() for word in command.split()[:2])
    names = (name, _RESPONSE_NAME.get(name, name))
    match line.upper().split():
        case [said, "NAK"] if said == verb:
            return Response(accepted=False)
        case [said, what, "NAK"] if said == verb and what in names:
            return Response(accepted=False)
        case ["SET", what, "ACK"] if verb == "SET" and what in names:
            return Response(accepted=True)
        case [what, *_] if verb == "GET" and what in names:
            return Response(accepted=True, text=line[len(what) :].strip())
    return None


def parse_positions(text: str, count: int = 6) -> tuple[float, ...]:
    """The first numbers of an answer: a pose's coordinates, or joints, mm or deg.

    Raises:
        FailedError: There are fewer, or one of them is no finite number.
    """
    try:
        found = tuple(float(word) + 0.0 for word in text.split()[:count])  # -0.0 becomes 0.0
    except ValueError:
        found = ()
    if len(found) < count:
        raise FailedError("fault", f"it reports {text!r} where {count} positions belong")
    if not all(map(math.isfinite, found)):
        raise FailedError("fault", f"it reports {text!r}, which is no position")
    return found


def parse_number(text: str) -> float:
    """The first number of an answer; not finite where there is none."""
    try:
        return float(text.split(maxsplit=1)[0])
    except (IndexError, ValueError):
        return math.nan
