"""The linuxcncrsh protocol: time-outs, commands and responses, without a connection.

A client sends ``get <what>`` or ``set <what> <value>``, one line each. ``get`` answers
``<WHAT> <words>``, ``set`` answers ``SET <WHAT> ACK`` once verbose is on, and both answer ``NAK``
when refused. LinuxCNC 2.9 ends lines with CR LF after ``get`` and with LF CR after ``set``, and
adds a blank line after some refusals; 2.10 ends all with CR LF and explains a refusal in
``error: ...`` lines before the NAK. (linuxcncrsh(1), and a wire trace of 2.9.)
"""

import asyncio
import math
from dataclasses import dataclass

from hexacell.cell.robot import ControllerSettings
from hexacell.errors import UsageError
from hexacell.kinematics.parameters import LEGS

MAX_LINE_BYTES = 255
"""Longest command with its line end; a longer one overruns the buffer of LinuxCNC 2.9."""

_EXPLANATION = "error:"
_RESPONSE_NAME = {"SET_WAIT": "WAIT_MODE"}


def subject_of(settings: ControllerSettings) -> str:
    """The subject of error messages; raises ``UsageError`` if the cell file names no port."""
    if settings.port is None:
        raise UsageError("the cell file names no controller port", action="Set controller.port")
    return f"controller {settings.host}:{settings.port}"


@dataclass(frozen=True, slots=True)
class Timeouts:
    """Longest waits, s of real time. A move may take twice its duration and ``beyond_move``.

    Measured on LinuxCNC 2.9: a query is answered in 1 ms, switching takes at most 0.4 s, an
    abort 0.6 s; a refusal of 2.10 comes together with its explanation. On a computer with five times the
    load that it can carry, a change of state was acknowledged after 5.3 s (``command``), or without effect.
    """

    connect: float = 3.0
    answer: float = 5.0
    command: float = 20.0
    explanation: float = 0.3
    poll: float = 0.05
    arrival: float = 1.0
    stop: float = 5.0
    switch: float = 5.0
    reload: float = 120.0
    reconnect: float = 60.0
    beyond_move: float = 10.0
    restore: float = 1.0


def loop_time() -> float:
    """The time of the running event loop, s."""
    return asyncio.get_running_loop().time()


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


def encode_command(command: str, subject: str) -> bytes:
    """The bytes of one command line.

    Raises:
        UsageError: It is longer than the server's buffer, or is more than one line.
    """
    line = command.encode() + b"\r\n"
    if len(line) > MAX_LINE_BYTES:
        problem = f"a command of {len(line)} bytes is longer than the {MAX_LINE_BYTES} it can take"
        raise UsageError(problem, subject=subject)
    if b"\r" in line[:-2] or b"\n" in line[:-2]:
        raise UsageError("a command must be a single line", subject=subject)
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


def parse_positions(text: str) -> tuple[float, float, float, float, float, float]:
    """The first six numbers of an answer: joints 1 to 6, mm, or a pose's coordinates.

    Raises:
        ValueError: There are fewer than six, or one of them is no finite number.
    """
    try:
        x, y, z, a, b, c = (float(word) + 0.0 for word in text.split()[:LEGS])  # -0.0 becomes 0.0
    except ValueError as error:
        raise ValueError(f"it reports {text!r} where six positions belong") from error
    if not all(math.isfinite(value) for value in (x, y, z, a, b, c)):
        raise ValueError(f"it reports {text!r}, which is no position")
    return x, y, z, a, b, c


def parse_number(text: str) -> float:
    """The first number of an answer; not finite where there is none."""
    try:
        return float(text.split(maxsplit=1)[0])
    except (IndexError, ValueError):
        return math.nan
