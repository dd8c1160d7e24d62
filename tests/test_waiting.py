"""No test waits for a fixed time, because a busy machine may take longer."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).parent

SLEEPS = {"time.sleep", "asyncio.sleep"}
CLOCKS = {"time.monotonic", "time.perf_counter", "time.monotonic_ns", "time.perf_counter_ns"}
LIMITS = {"asyncio.wait_for", "asyncio.timeout"}
WAITS = {"wait", "join", "communicate", "result", "run", "acquire", "settimeout"}

ALLOWED = {
    "conftest.py": "how long a test's remains may last before the test fails",
    "cli/test_run_stopped.py": "compares a moment with those in a journal",
    "drivers/controllers/linuxcnc/test_status_channel.py": "outlasts a limit, which nobody may use",
    "drivers/encoders/test_lifetime.py": "cancels at sixty different moments",
    "drivers/simulated/linuxcnc/conftest.py": "how fast a fake machine moves, and that nothing is said",
    "faults/conftest.py": "how long a whole run takes, of which moments are drawn",
    "faults/driver.py": "kills at a drawn moment",
    "linuxcnc/conftest.py": "how long LinuxCNC may take before it is started again",
    "packages/scale_box/hexacell_scale_box.py": "is a driver, which waits for no answer longer than it may",
    "procedures/journal/test_journal.py": "compares a moment with those in a journal",
}


def clocks_in(source: str) -> Iterator[str]:
    """Every sleep, clock and time limit in a program, with its line."""
    for node in ast.walk(ast.parse(source)):
        if _is_a_clock(node) or (isinstance(node, ast.Call) and _waits_for_a_time(node)):
            yield f"{node.lineno}: {ast.unparse(node)}"  # type: ignore[attr-defined]


def _is_a_clock(node: ast.AST) -> bool:
    if isinstance(node, ast.ImportFrom):
        return node.module == "time"
    return isinstance(node, ast.Attribute) and ast.unparse(node) in CLOCKS | LIMITS


def _waits_for_a_time(call: ast.Call) -> bool:
    name = ast.unparse(call.func)
    if name in SLEEPS:
        return not _is_number(call.args[0]) or ast.literal_eval(call.args[0]) != 0
    method = name.rpartition(".")[2]
    limits = [keyword.value for keyword in call.keywords if keyword.arg == "timeout"]
    limits += call.args if method != "run" else []
    return method in WAITS and any(map(_is_number, limits))


def _is_number(value: ast.expr) -> bool:
    return isinstance(value, ast.Constant) and isinstance(value.value, float | int)


def test_no_test_waits_for_a_time() -> None:
    programs = {path.relative_to(HERE): path.read_text() for path in HERE.rglob("*.py")}
    found = {
        path.as_posix(): clocks
        for path, source in programs.items()
        if path.parts[0] not in {"benchmarks", "waiting.py"} and (clocks := list(clocks_in(source)))
    }
    assert {path: clocks for path, clocks in found.items() if path not in ALLOWED} == {}
    assert sorted(found) == sorted(ALLOWED), "what has no clock any more is allowed none"


@pytest.mark.parametrize(
    "line",
    [
        "time.sleep(0.1)",
        "await asyncio.sleep(pause_s)",
        "time.monotonic() - begun",
        "await asyncio.wait_for(task, 3)",
        "from time import sleep",
        "process.wait(timeout=10)",
        "event.wait(0.5)",
        "thread.join(5)",
    ],
)
def test_a_wait_for_a_time_is_found(line: str) -> None:
    assert len(list(clocks_in(f"async def test():\n    {line}"))) == 1


@pytest.mark.parametrize(
    "line", ["await asyncio.sleep(0)", "event.wait()", "await clock.sleep(0.3)", "','.join(words)"]
)
def test_a_wait_for_an_event_is_accepted(line: str) -> None:
    assert list(clocks_in(f"async def test():\n    {line}")) == []
