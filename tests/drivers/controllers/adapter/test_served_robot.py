"""A robot whose client is gone is stopped, whatever it was asked to do last."""

import io
import threading
from collections.abc import Sequence

from drivers.controllers.adapter.served_robot import FailedError, Report, Told, serve


class Late:
    """It begins to move after it was stopped once, and then until it is stopped again."""

    def __init__(self) -> None:
        self._was_stopped, self._is_stopped = threading.Event(), threading.Event()

    def hello(self, settings: Told) -> Told:
        return {}

    def status(self) -> Told:
        return {}

    def position(self) -> Told:
        return {}

    def start_up(self, action: str) -> None:
        pass

    def move(self, pose: Sequence[float], duration_s: float, report: Report) -> None:
        self._was_stopped.wait()
        self._is_stopped.clear()
        self._is_stopped.wait()
        raise FailedError("interrupted", "it was stopped")

    def stop(self) -> None:
        self._is_stopped.set()
        self._was_stopped.set()


def test_a_move_that_begins_after_its_client_has_gone_is_stopped() -> None:
    answers = io.StringIO()
    serve(Late(), iter(['{"id": 1, "do": "move", "pose": [0, 0, 0, 0, 0, 0], "duration_s": 9}']), answers)
    assert "it was stopped" in answers.getvalue()


class EarlyDone(Late):
    """It says that a move is done, and goes on; ``stops`` counts how often it was stopped."""

    stops = 0

    def status(self) -> Told:
        return {"moving": not self.stops}

    def move(self, pose: Sequence[float], duration_s: float, report: Report) -> None:
        pass

    def stop(self) -> None:
        self.stops += 1


def test_a_robot_that_still_moves_when_all_is_done_is_stopped_and_one_at_rest_is_left_alone() -> None:
    robot = EarlyDone()
    for _ in range(2):
        serve(robot, iter(()), io.StringIO())
        assert robot.stops == 1
