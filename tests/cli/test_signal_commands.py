"""Signals while an engine runs: commands in their order, and no step is cut short."""

import asyncio
import os
import signal
from collections.abc import Iterator

import pytest

from hexacell.cli.console import Console
from hexacell.cli.process import handled
from hexacell.cli.terminal import ENDING_SIGNALS, SignalCommands
from hexacell.errors import Interruption
from procedures.engine.commands import Abort, Command, Stop
from procedures.run.cancellation import shielded
from tests.signals import terminal_signals


@pytest.fixture(autouse=True)
def handlers_are_restored() -> Iterator[None]:
    with terminal_signals():
        before = [signal.getsignal(number) for number in ENDING_SIGNALS]
        yield
        assert [signal.getsignal(number) for number in ENDING_SIGNALS] == before


@pytest.fixture
def signals() -> SignalCommands:
    return SignalCommands(Console())


def send(*numbers: int) -> None:
    for number in numbers:
        os.kill(os.getpid(), number)


async def sent(*numbers: signal.Signals) -> None:
    """Send signals; return when the event loop has dealt with them, and with one that came after them."""
    dealt_with = asyncio.Event()
    loop = asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGUSR1, dealt_with.set)
    try:
        send(*numbers, signal.SIGUSR1)
        await dealt_with.wait()
    finally:
        loop.remove_signal_handler(signal.SIGUSR1)


async def commands_after(signals: SignalCommands, *numbers: int) -> list[Command]:
    """The commands that an engine receives."""
    with signals.queue.attended():
        send(*numbers)
        return [await signals.queue.next() for _ in numbers]


STOP, ABORT = Stop("interrupted"), Abort("interrupted")
INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


@pytest.mark.parametrize(
    ("numbers", "commands"),
    [
        ((INT,), [STOP]),
        ((TERM,), [STOP]),
        ((HUP,), [STOP]),
        ((INT, INT), [STOP, ABORT]),
        ((TERM, INT), [STOP, ABORT]),
        ((TERM, HUP), [STOP, STOP]),
    ],
)
def test_the_first_signal_stops_and_a_second_ctrl_c_aborts(signals, numbers, commands, capsys) -> None:
    assert signals.run(commands_after(signals, *numbers)) == commands
    hint = "Stopping after this step; Ctrl-C again stops motion at once.\n"
    assert capsys.readouterr().out == (hint if numbers[0] is INT else "")


@pytest.mark.parametrize("number", ENDING_SIGNALS, ids=str)
def test_no_signal_ends_or_suspends_a_run_without_a_word(signals, number: int) -> None:
    with handled([number], signal.SIG_DFL):  # this test run may use it
        assert signals.run(commands_after(signals, number)) == [STOP]


def test_every_signal_that_would_end_a_process_is_heeded_or_has_a_reason() -> None:
    faults = {signal.SIGABRT, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGSEGV, signal.SIGSYS}
    harmless = {signal.SIGCHLD, signal.SIGCONT, signal.SIGURG, signal.SIGWINCH, signal.SIGTRAP}
    by_others = {signal.SIGKILL, signal.SIGSTOP, signal.SIGPIPE, signal.SIGXFSZ}  # the kernel, Python
    of_the_shell = {signal.SIGTTIN, signal.SIGTTOU}  # a job in the background asks for the terminal
    known = {*ENDING_SIGNALS, *faults, *harmless, *by_others, *of_the_shell}
    assert set(signal.Signals) - known == set()


def test_before_an_engine_runs_the_work_is_cancelled_and_cleans_up_undisturbed(signals) -> None:
    let_go: list[str] = []

    async def connecting() -> None:
        try:
            send(INT)
            await asyncio.Event().wait()
        finally:
            await shielded(cleaning_up())

    async def cleaning_up() -> None:
        for _ in range(3):
            await sent(INT, TERM)
        let_go.append("devices")

    with pytest.raises(Interruption):
        signals.run(connecting())
    assert let_go == ["devices"]


@pytest.mark.parametrize("number", [INT, TERM])
def test_a_signal_while_the_event_loop_is_being_made_cancels_the_work(signals, monkeypatch, number) -> None:
    begun = []
    made = asyncio.new_event_loop

    def interrupted() -> asyncio.AbstractEventLoop:
        send(number)
        return made()

    async def work() -> None:
        await asyncio.sleep(0)
        begun.append(True)

    monkeypatch.setattr("asyncio.events.new_event_loop", interrupted)
    with pytest.raises(Interruption):
        signals.run(work())
    assert not begun


def test_when_the_engine_has_ended_a_signal_changes_nothing(signals) -> None:
    async def over() -> str:
        with signals.queue.attended():
            pass
        await sent(INT, TERM)
        return "done"

    assert signals.run(over()) == "done"


def test_an_ignored_signal_stays_ignored(signals) -> None:
    former = signal.signal(INT, signal.SIG_IGN)

    async def background_job() -> bool:
        with signals.queue.attended():
            await sent(INT)
            return list(signals.queue.take()) == []

    try:
        assert signals.run(background_job())
        assert signal.getsignal(INT) is signal.SIG_IGN
    finally:
        signal.signal(INT, former)
