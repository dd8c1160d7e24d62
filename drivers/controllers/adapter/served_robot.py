"""Serves a robot by the adapter protocol on stdin and stdout: all that a controller's own program needs.

Only Python's own library is used, and nothing of this program: the file also runs under the interpreter
that a controller comes with.
"""

from __future__ import annotations

import json
import queue
import sys
import threading
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Protocol, TextIO

VERSION = 1
IDLE_S, AGAIN_S = 0.02, 0.1
Told = Mapping[str, Any]
Report = Callable[[Sequence[float]], None]
"""Tells where the robot is on its way: x, y, z, mm, and a, b, c, deg."""


class FailedError(Exception):
    """A failed request: its kind (``refused``, ``pose``, ``interrupted``, ``fault``), reason and more."""

    def __init__(self, kind: str, reason: str, **more: Any) -> None:  # noqa: ANN401 - as the protocol allows
        self.answer = {"kind": kind, "reason": reason, **more}
        super().__init__(reason)


class Robot(Protocol):
    """What a program implements. ``status``, ``position`` and ``stop`` are called while others work.

    What is returned is the answer's ``done``; a failure is a :class:`FailedError`.
    """

    def hello(self, told: Told) -> Told:
        """Connect, by ``settings``, ``host`` and ``port`` of the cell file; its name. Nothing moves."""

    def status(self) -> Told:
        """``estop``, ``enabled``, ``homed``, ``remote``, ``moving``, ``errors``, ``heartbeat``."""

    def position(self) -> Told:
        """``pose`` (6,), mm and deg, and ``joints`` (6,); None where it does not know."""

    def start_up(self, action: str) -> None:
        """``reset-estop``, ``switch-on``, ``switch-off``, ``home`` or ``reload``; returns when it is so."""

    def move(self, pose: Sequence[float], duration_s: float, report: Report) -> None:
        """Move straight to a pose; returns at rest there, and is ``interrupted`` by a stop."""

    def stop(self) -> None:
        """Stop the motion in place, at once; returns at rest."""


def serve(
    robot: Robot,
    lines: Iterable[str] = sys.stdin,
    answers: TextIO = sys.stdout,
    ends: Callable[[Exception], bool] = lambda _error: False,
) -> None:
    """Answer each line of requests until they end; then the robot is stopped, if it does anything or moves.

    ``ends`` is given each error that is no answer: whether it ends the service.
    """
    _Service(robot, lines, answers, ends).run()


class _Service:
    def __init__(
        self, robot: Robot, lines: Iterable[str], answers: TextIO, ends: Callable[[Exception], bool]
    ) -> None:
        self._robot, self._lines, self._answers, self._ends = robot, lines, answers, ends
        self._writing = threading.Lock()
        self._orders: queue.SimpleQueue[Told | None] = queue.SimpleQueue()

    def run(self) -> None:
        worker = threading.Thread(target=self._work, daemon=True)
        worker.start()
        for line in self._lines:
            request = json.loads(line)
            if request["do"] == "stop":  # what is asked before it may hang
                threading.Thread(target=self._answer, args=(request,), daemon=True).start()
            elif request["do"] in {"hello", "status", "position"}:
                self._answer(request)
            else:  # what takes its time; the others do not wait for it
                self._orders.put(request)
        self._orders.put(None)
        worker.join(IDLE_S)
        is_over = not worker.is_alive() and not self._moves()
        while not is_over:  # again, as the first one may precede the motion
            with suppress(FailedError):
                self._robot.stop()  # nobody is there any more who could
            worker.join(AGAIN_S)
            is_over = not worker.is_alive()

    def _moves(self) -> bool:
        """Whether the robot moves, or may, although all that was asked for is done."""
        try:
            return bool(self._robot.status().get("moving", True))
        except FailedError:
            return True

    def _work(self) -> None:
        while (request := self._orders.get()) is not None:
            self._answer(request)

    def _answer(self, request: Told) -> None:
        try:
            done = self._done(request)
        except FailedError as failure:
            self._send(request, failed=failure.answer)
        except Exception as error:  # whatever fails in a controller's own library
            if self._ends(error):
                return
            traceback.print_exc()
            self._send(request, failed={"kind": "fault", "reason": f"{type(error).__name__}: {error}"})
        else:
            self._send(request, done=done or {})

    def _done(self, request: Told) -> Told | None:
        robot, do = self._robot, request["do"]
        if do == "hello":
            if request["version"] != VERSION:
                raise FailedError("refused", f"this program has version {VERSION} of the protocol")
            return {"version": VERSION, "length": "mm", "angle": "deg", **robot.hello(request)}
        if do in {"status", "position", "stop"}:
            answer: Told | None = getattr(robot, do)()
            return answer
        if do == "move":
            robot.move(
                request["pose"], request["duration_s"], lambda pose: self._send(request, at=list(pose))
            )
        else:
            robot.start_up(do)
        return None

    def _send(self, request: Told, **answer: Any) -> None:  # noqa: ANN401 - what JSON can hold
        with self._writing, suppress(OSError):  # where nobody listens any more, the requests end too
            print(json.dumps({"id": request["id"], **answer}), file=self._answers, flush=True)
