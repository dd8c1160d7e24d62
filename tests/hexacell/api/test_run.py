"""A run as an object, in scripts and notebooks: nothing moves unasked, whatever happens is told."""

import asyncio
import os
import signal
import threading
from pathlib import Path

import pytest

from hexacell import api
from hexacell.errors import AnswerNeeded, ExitCode, UsageError
from procedures.journal.journal import read_journal
from procedures.steps import events
from tests.waiting import until, wait_until

SAMPLED = "sampled"


def until_told(run: api.Run, kind: str) -> api.RunEvent:
    """The next event of a kind; gauges are placed meanwhile."""
    for event in run:
        if event.kind == kind:
            return event
        if event.question is not None:
            run.answer("placed")
    pytest.fail("the run is over")


def is_free(cell: api.Cell) -> bool:
    """Whether no run goes on: its devices can be had."""
    try:
        api.LiveDevices(cell).close()
    except api.HexacellError:
        return False
    return True


def host_of(cell: api.Cell) -> int:
    """The process that runs the cell."""
    for folder in Path("/proc").glob("[0-9]*"):
        words = (folder / "cmdline").read_bytes().split(b"\0") if (folder / "cmdline").exists() else []
        if b"host" in words and os.fsencode(cell.path) in words:
            return int(folder.name)
    pytest.fail("no process runs it")


@pytest.mark.parametrize("word", [False, None, "yes", 1])
def test_nothing_begins_without_a_persons_word(cell, word) -> None:
    for begin in (api.start_run, api.resume_run):
        with pytest.raises(UsageError, match=r"nobody has said.*moves_robot=True"):
            begin(cell, moves_robot=word)
    assert not (cell.path.parent / "runs").exists()


def test_what_cannot_begin_says_why(cell) -> None:
    with pytest.raises(UsageError, match=r"no mode 'optimize'. There are: .*optimise"):
        api.start_run(cell, "optimize", moves_robot=True)
    with pytest.raises(UsageError, match=r"no run of simulated-hexaglide goes on. Begin one"):
        api.attach_to_run(cell)
    with pytest.raises(UsageError, match="no run of this cell was interrupted"):
        api.resume_run(cell, moves_robot=True)
    with pytest.raises(api.HexacellError, match="no accepted result") as refusal:
        api.start_run(cell, "quick", moves_robot=True).result()
    assert refusal.value.exit_code is ExitCode.USAGE
    cell.path.write_text(cell.text.replace('axis = "x"', 'axis = "q"'))
    with pytest.raises(api.HexacellError, match=r"simulated-hexaglide.toml:\d+: .*axis"):
        api.start_run(cell, moves_robot=True)


def test_a_script_answers_and_aborts_and_another_goes_on(cell) -> None:
    with api.start_run(cell, moves_robot=True) as run:
        with pytest.raises(AnswerNeeded, match=r"Put the gauges around the ball at point 1(?s:.*)placed"):
            run.result()
        assert run.status == "awaiting operator"
        assert "Put the gauges" in run._repr_html_()
        with pytest.raises(UsageError, match=r"'done' is no answer .* Answer one of: placed"):
            run.answer("done")
        until_told(run, SAMPLED)
        with pytest.raises(UsageError, match="no question is open"):
            run.answer("placed")
        run.abort()
        with pytest.raises(api.HexacellError) as end:
            run.result()
        assert end.value.exit_code is ExitCode.INTERRUPTED
        with pytest.raises(api.HexacellError):
            run.pause()
    measured = len(run.records)
    wait_until(lambda: is_free(cell))
    with api.resume_run(cell, run.folder, moves_robot=True) as again:
        assert again.folder == run.folder
        while len(again.records) <= measured:
            until_told(again, SAMPLED)
    history = read_journal(run.folder / "journal.jsonl")
    assert isinstance(history[-1], events.Interrupted), "the end of the context ended the run"
    assert api.read_result(run.folder).line == "the run is not over"


async def test_a_notebook_pauses_and_goes_on_while_its_loop_runs(cell) -> None:
    """What blocks works on a loop that runs, and from threads; the loop goes on where it is awaited."""
    kinds: list[str] = []
    told: list[api.HexacellError] = []

    def wait_for_result() -> None:
        with pytest.raises(api.HexacellError) as end:
            run.result()
        told.append(end.value)

    async def follow() -> None:
        async for event in run:
            kinds.append(event.kind)
            match event.kind:
                case "question":
                    run.answer("placed")
                case "sampled" if kinds.count(SAMPLED) == 1:
                    run.pause()
                case "paused":
                    await until(lambda: run.status == "paused")
                    with pytest.raises(UsageError, match="moves_robot=True"):
                        run.resume()
                    with pytest.raises(TimeoutError):  # it waits, and nobody else is disturbed
                        await asyncio.wait_for(anext(run), 0.2)
                    run.resume(moves_robot=True)
                case "sampled":
                    waiting.start()
                    run.abort()

    waiting = threading.Thread(target=wait_for_result)
    with await asyncio.to_thread(api.start_run, cell, moves_robot=True) as run:
        with pytest.raises(api.HexacellError, match="a person aborted it"):
            await follow()
        with pytest.raises(api.HexacellError, match="a person aborted it"):
            await run
        await until(lambda: bool(told))
    waiting.join()
    assert kinds.index("paused") < kinds.index("resumed") < kinds.index("interrupted")
    history = [event.kind for event in read_journal(run.folder / "journal.jsonl")]
    assert [kind for kind in kinds if kind != "question"] == history


def test_a_second_one_is_refused_and_may_attach(cell) -> None:
    with api.start_run(cell, moves_robot=True) as run:
        with pytest.raises(api.HexacellError, match="another process runs this cell") as busy:
            api.start_run(cell, moves_robot=True)
        assert busy.value.exit_code is ExitCode.BUSY
        other = api.attach_to_run(cell)
        assert (other.folder, next(other).kind) == (run.folder, "started")
        wait_until(lambda: other.question is not None)
        with pytest.raises(UsageError, match=r"is in control of this run. Call take_control"):
            other.answer("placed")
        other.take_control()
        other.answer("placed")
        assert until_told(other, SAMPLED).text.startswith("point 1, orientation 1")
        wait_until(lambda: run.live is not None and run.live.encoders.value is not None)
        with pytest.raises(UsageError, match="is in control of this run"):
            run.pause()
        other.abort()
        for one in (run, other):
            with pytest.raises(api.HexacellError, match="a person aborted it"):
                list(one)


def test_a_run_left_alone_goes_on(cell) -> None:
    run = api.start_run(cell, moves_robot=True)
    run.leave(keep_running=True)
    with pytest.raises(UsageError, match="over"):
        run.result()
    with api.attach_to_run(cell) as again:
        until_told(again, SAMPLED)


def test_a_process_that_is_killed_is_told_everywhere(cell) -> None:
    run = api.start_run(cell, moves_robot=True)
    until_told(run, SAMPLED)
    os.kill(host_of(cell), signal.SIGKILL)
    with pytest.raises(api.HexacellError, match="the connection to the run is lost") as lost:
        list(run)
    assert lost.value.exit_code is ExitCode.HARDWARE
    with pytest.raises(api.HexacellError, match="lost"):
        run.result()
    with pytest.raises(api.HexacellError, match="lost"):
        run.abort()
