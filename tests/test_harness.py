"""The test suite itself: a test that leaks resources fails alone, and long tests take turns."""

from pathlib import Path
from textwrap import dedent

import pytest

from tests.turns import TURN, TURNS

HERE = Path(__file__).parent

LEAKS = {
    "ERROR *::test_thread - *left behind: daemon thread worker (*)": """
        def test_thread():
            threading.Thread(target=END.wait, name="worker", daemon=True).start()
    """,
    "ERROR *::test_terminal - *left behind: descriptor * -> /dev/ptmx, descriptor * -> /dev/pts/*": """
        def test_terminal():
            pty.openpty()
    """,
    "ERROR *::test_server - *left behind: descriptor * -> socket:*": """
        async def test_server():
            KEPT.append(await asyncio.start_server(print, "127.0.0.1", 0))
    """,
    "ERROR *::test_signal - *left behind: <Signals.SIGUSR1: *> blocked": """
        def test_signal():
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})
    """,
    "ERROR *::test_task_of_a_fixture - *left behind: <Task pending name='pump' *": """
        @pytest.fixture
        async def link():
            yield KEPT.append(asyncio.create_task(asyncio.Event().wait(), name="pump"))

        def test_task_of_a_fixture(link):
            pass
    """,
}

THREADS_END = """
    def test_threads_end():
        END.set()
"""

HEADER = """
    import asyncio, os, pty, signal, socket, threading, time, warnings
    import pytest
    from hypothesis import given, settings, strategies as st

    KEPT = []
    END = threading.Event()
"""


@pytest.fixture
def suite(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """A project with this one's settings and conftest."""
    tests = pytester.mkdir("tests")
    for name in ("conftest.py", "turns.py"):
        (tests / name).write_text((HERE / name).read_text())
    (tests / "long_tests.txt").touch()
    (pytester.path / "pyproject.toml").write_text((HERE.parent / "pyproject.toml").read_text())
    monkeypatch.setenv("COLUMNS", "500")
    return pytester


def run(suite: pytest.Pytester, *sources: str) -> pytest.RunResult:
    """Run tests of these sources in a process of its own, so that what they leave dies with it."""
    text = "\n".join(dedent(source) for source in (HEADER, *sources))
    (suite.path / "tests" / "test_inner.py").write_text(text)
    return suite.runpytest_subprocess("tests")


def test_a_leak_fails_its_test_and_no_other(suite: pytest.Pytester) -> None:
    innocent = [f"def test_innocent_{number}(): pass" for number in range(len(LEAKS))]
    sources = [source for pair in zip(LEAKS.values(), innocent, strict=True) for source in pair]
    with (suite.path / "tests" / "conftest.py").open("a") as conftest:
        conftest.write("\nGRACE_S = 0.1\n")
    result = run(suite, *sources, THREADS_END)
    result.stdout.fnmatch_lines_random(list(LEAKS))
    result.assert_outcomes(passed=2 * len(LEAKS) + 1, errors=len(LEAKS))


def test_each_case_of_a_long_test_has_its_turn_and_the_others_run_always(
    suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = """
        @pytest.mark.parametrize("case", range(12))
        def test_long(case): pass

        def test_short(): pass
    """
    (suite.path / "tests" / "test_inner.py").write_text(dedent(HEADER) + dedent(source))
    (suite.path / "tests" / "long_tests.txt").write_text("tests/test_inner.py::test_long\n")
    ran: list[str] = []
    for number in range(TURNS):
        monkeypatch.setenv(TURN, str(number))
        result = suite.runpytest_subprocess("tests", "-m", "not slow", "-v")
        ran += [line.split()[0].rpartition("::")[2] for line in result.outlines if "PASSED" in line]
    assert sorted(ran) == sorted([f"test_long[{case}]" for case in range(12)] + TURNS * ["test_short"])


def test_a_long_test_that_is_gone_is_not_left_in_the_list(suite: pytest.Pytester) -> None:
    (suite.path / "tests" / "long_tests.txt").write_text("tests/test_inner.py::test_renamed\n")
    result = run(suite, "def test_now(): pass")
    result.stderr.fnmatch_lines(["*long_tests.txt lists tests that are not there: *test_renamed*"])
