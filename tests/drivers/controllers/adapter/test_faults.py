"""A program that lies, hangs, dies or talks nonsense is named, and its robot rests until it is prepared."""

import random
from pathlib import Path

import pytest

from drivers.errors import (
    CommandRefused,
    ConnectionLost,
    MotionInterrupted,
    MoveRefused,
    PoseRefused,
    ResponseTimeout,
    StartupNotPermitted,
)
from hexacell.errors import DeviceError
from tests.drivers.controllers.adapter.faulty import ALL, EVERY, TARGETS, done_by, driver, whole_job

NONSENSE = (
    "garbage",
    "text",
    "list",
    "empty",
    "no answer in it",
    "two answers in it",
    "number as text",
    "nested",
)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "done"


async def test_without_a_fault_the_whole_job_is_done(log: Path) -> None:
    assert await whole_job(driver(log), log) is None
    assert done_by(log) == 6 * ["move", "rest"]


@pytest.mark.parametrize(
    ("fault", "at", "kind", "words"),
    [
        ("silence", "move", MotionInterrupted, "was still moving after"),
        ("silence", "status", ResponseTimeout, "did not answer 'status'"),
        *((nonsense, "status", ConnectionLost, "which is no answer") for nonsense in NONSENSE),
        ("long", "position", ConnectionLost, "more than 65536 bytes"),
        ("endless", "position", ConnectionLost, "more than 65536 bytes"),
        ("nan", "position", ConnectionLost, "finite number"),
        ("infinite", "move", ConnectionLost, "finite number"),
        ("aside", "move", ConnectionLost, "is not on the way from"),
        ("another number", "status", ConnectionLost, "answered before or never asked"),
        ("twice", "move", ConnectionLost, "answered before or never asked"),
        ("inch", "hello", DeviceError, "counts in 'inch', not in mm"),
        ("version 2", "hello", DeviceError, "has version 2 of the adapter protocol"),
        ("not remote", "status", DeviceError, "takes no commands from here"),
        ("early", "move", DeviceError, ""),
        ("elsewhere", "position", MotionInterrupted, "after it said that the move was over"),
        ("nowhere", "position", DeviceError, "does not know where it is"),
        ("no effect", "home", DeviceError, "'home' is done, which had no effect"),
        ("half", "move", ConnectionLost, "in the middle of a line"),
        ("exit", "home", ConnectionLost, "ended with exit status 3: out of oil"),
        ("pose", "move", PoseRefused, "so it is"),
        ("refused", "move", MoveRefused, "so it is"),
        ("interrupted", "move", MotionInterrupted, "before reaching X5.000"),
        ("fault", "switch-on", CommandRefused, "refuses 'switch-on': so it is"),
        ("refused", "hello", DeviceError, "so it is"),
    ],
)
async def test_each_is_named(log: Path, fault: str, at: str, kind: type[DeviceError], words: str) -> None:
    nth = 0 if fault in {"elsewhere", "nowhere"} else 1
    error = await whole_job(driver(log, fault, at, nth), log)
    assert isinstance(error, kind), error
    assert words in error.problem


async def test_a_flood_on_stderr_harms_nothing(log: Path) -> None:
    assert await whole_job(driver(log, "flood", "status"), log) is None


async def test_a_robot_that_moved_by_itself_does_not_move_before_it_is_prepared(log: Path) -> None:
    error = await whole_job(driver(log, "jump", "position", nth=4), log)
    assert isinstance(error, MotionInterrupted)
    assert "it moved without a command" in error.problem


@pytest.mark.parametrize("fault", ["refused", "interrupted", "still moving", "silence"])
async def test_a_stop_that_failed_once_is_not_forgotten(log: Path, fault: str) -> None:
    error = await whole_job(driver(log, fault, "stop"), log)  # which tries to move afterwards
    assert fault in {"still moving", "silence"} or "could not be stopped" in str(error)


async def test_what_is_not_permitted_is_not_asked_for(log: Path) -> None:
    controller = driver(log)
    await controller.open()
    with pytest.raises(StartupNotPermitted, match="emergency stop"):
        await controller.prepare(frozenset())
    await controller.close()


async def test_after_a_failure_it_moves_again_once_prepared(log: Path) -> None:
    controller = driver(log, "exit", "move", nth=2)
    await controller.open()
    await controller.prepare(ALL)
    await controller.move(TARGETS[0], 0.05)
    with pytest.raises(ConnectionLost, match="out of oil"):
        await controller.move(TARGETS[1], 0.05)
    await controller.prepare(ALL)  # by another process of the program
    await controller.move(TARGETS[2], 0.05)
    await controller.close()


@pytest.mark.parametrize("seed", range(40))
async def test_any_fault_anywhere(log: Path, seed: int) -> None:
    drawn = random.Random(seed)
    fault, at = drawn.choice(EVERY)
    await whole_job(driver(log, fault, at, nth=drawn.choice([1, 1, 2, 3])), log)
