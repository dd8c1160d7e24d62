"""``hexacell run`` and ``hexacell demo``: the whole job, with progress, signals, keys and its outcome."""

import argparse
import shlex
import sys
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

from hexacell.campaign.pose_list import pose_list_of
from hexacell.cell.loader import Cell
from hexacell.cli.commands.cell import cell_with_devices_at
from hexacell.cli.commands.unattended import begun_in_window, notified_afterwards
from hexacell.cli.console import Console
from hexacell.cli.progress import RunProgress, gauges_on_request
from hexacell.cli.terminal import KeyboardCommands, SignalCommands, TerminalOperator, is_interactive
from hexacell.errors import ExitCode, HexacellError, UsageError
from hexacell.run_process.run_device_watch import RunDeviceWatch
from hexacell.runs.run_folder import new_run
from hexacell.services.history.resumption import run_to_resume
from hexacell.services.history.run_summary import state_of
from hexacell.services.run.calibration_run import RunRequest, calibrate
from hexacell.services.run.demo import prepare_demo
from hexacell.services.run.event_stream import EventStream
from hexacell.services.unattended import unattended_runs
from hexacell.services.unattended.notice import RunEnd
from hexacell.text.layout import wrapped
from hexacell.text.line_face import LETTERS
from hexacell.text.screens.checklist import exclusions_text
from hexacell.text.verdict import teaching_line, teaching_sentence
from procedures.calibration.calibration import Mode, expected_records
from procedures.engine.commands import CommandQueue, UnattendedOperator
from procedures.engine.engine import Listener
from procedures.journal.journal import is_evidence_lost, read_journal
from procedures.run.state import RunState, fold
from procedures.run.trips import may_still_move
from procedures.steps import events

REPEATED = "The check raised an alarm, which one unchanged machine in 100 does: it is made once more."
REPEATED_ALARM = "The alarm was raised again: the machine has changed."
NOT_REPEATED_ALARM = "The alarm was not raised again."

UNVERIFIED = (
    "The controller's config holds the new geometry, which is not verified yet: resuming "
    "verifies it, or restores the old one."
)


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Calibrate a cell, or check it."""
    mode = Mode(options.mode or ("check" if options.unattended else "optimise"))
    if mode is Mode.CHECK and options.length_check:
        raise UsageError(
            "a check does not check the length scale", action="Use `hexacell length`, or --mode optimise"
        )
    request = replace(_request(options, console, mode), length_check=options.length_check)
    if options.events is None:
        return _run_to_end(request, console)
    with closing(EventStream(options.events, console.warn)) as stream:
        return _run_to_end(request, console, stream)


def length(options: argparse.Namespace, console: Console) -> ExitCode:
    """Check the scale of the encoders of a calibrated cell."""
    return _run_to_end(_request(options, console, Mode.LENGTH), console)


def _request(options: argparse.Namespace, console: Console, mode: Mode) -> RunRequest:
    cell = _cell(options, console, mode)
    attended = is_interactive() and not options.unattended
    return RunRequest(
        cell=cell,
        folder=run_to_resume(cell, options.resume) if options.resume is not None else new_run(cell),
        mode=mode,
        operator=TerminalOperator(console) if attended else UnattendedOperator(),
        unattended=not attended,
        resume=options.resume is not None,
        keeps_hours=options.unattended,
    )


def _cell(options: argparse.Namespace, console: Console, mode: Mode) -> Cell:
    """The cell; if its file has mistakes, the history of its runs says why nothing ran tonight."""
    try:
        return cell_with_devices_at(options.cell, console)
    except HexacellError as error:
        if options.unattended:
            unattended_runs.note_unreadable_cell(options.cell, mode.value, error)
        raise


def demo(options: argparse.Namespace, console: Console) -> ExitCode:
    """Copy a simulated cell into a folder of its own and calibrate it there."""
    request = prepare_demo(options.folder, options.config)
    machine = request.cell.settings.mechanism.words.machine
    devices = "gauges on serial lines, encoders on CAN, TCP controller."
    console.print(wrapped(f"A simulated {machine}: {devices}"))
    console.print("The geometry in its controller's config is wrong by millimetres:")
    console.print(f"  {request.cell.config_path}")
    return _run_to_end(request, console)


def _run_to_end(request: RunRequest, console: Console, stream: EventStream | None = None) -> ExitCode:
    """Carry out a run, its events copied to a ``stream`` if there is one, and print its outcome."""
    factor = request.cell.settings.timing.clock_factor
    if factor != 1.0:
        console.print(f"The simulated cell's clock runs {factor:g} times as fast as real time.")
    if excluded := exclusions_text(request.cell.settings):
        console.print(wrapped(excluded))
    end = notified_afterwards(request, console, lambda: _run_and_repeat(request, console, stream))
    console.document(run_document(end.request, end.ended, end.state))
    for line in closing_lines(end.request, end.ended):
        console.print(line)
    return ExitCode(end.ended.exit_code)


def run_document(request: RunRequest, ended: events.Ended, state: RunState) -> dict[str, Any]:
    """What ``--json`` prints."""
    judged, noise, found = state.judged, state.noise, state.identified
    measurements, moved = request.folder.measurements, ended.displacement
    return {
        "exit_code": ended.exit_code,
        "line": ended.line,
        "verdict": judged and judged.verdict,
        "verification": judged and judged.verification,
        "check": judged and judged.check,
        "quick": found and found.quick,
        "length": judged and judged.length,
        "measured_noise": noise and noise.noise,
        "displacement": moved,
        "teaching": moved and teaching_sentence(moved),
        "run": request.folder.path,
        "measurements": measurements if measurements.is_file() else None,
        "config": request.cell.config_path,
    }


def _run_and_repeat(request: RunRequest, console: Console, stream: EventStream | None) -> RunEnd:
    """Carry out a run, and the check that its alarm asks for."""
    ended = begun_in_window(
        request, console, lambda: execute_run(request, console, _copied(request, stream))
    )
    state = fold(read_journal(request.folder.journal))
    if (again := unattended_runs.repetition(request, state)) is None:
        return RunEnd(request, ended, state)
    console.print(REPEATED)
    ended = execute_run(again, console, _copied(again, stream))
    state = fold(read_journal(again.folder.journal))
    console.print(REPEATED_ALARM if state.alarm else NOT_REPEATED_ALARM)
    return RunEnd(again, ended, state)


def _copied(request: RunRequest, stream: EventStream | None) -> list[Listener]:
    return [] if stream is None else [stream.listener(request.folder.journal)]


def execute_run(request: RunRequest, console: Console, further: Sequence[Listener] = ()) -> events.Ended:
    """Carry out a run with a progress bar; ``further`` listeners hear of every event too.

    Ctrl-C, or any signal that ends a process, ends it after the step in progress, a second Ctrl-C at once.
    Raises ``HexacellError``.
    """
    expected = expected_records(
        request.cell.settings, request.mode, pose_list_of(request.cell), length_check=request.length_check
    )
    progress = RunProgress(console, expected)
    signals = SignalCommands(console)
    try:
        with progress.bar:
            return signals.run(_calibrate(request, console, progress, signals.queue, further))
    except HexacellError as error:
        if may_still_move(error):  # before anything else is said
            console.error(str(error).partition("\n")[0])
        state = state_of(request.folder)
        if progress.has_started and state.started is not None and not is_evidence_lost(error):
            console.print(f"Stopped; what was measured is kept. To continue:\n  {resume_command(request)}")
        if (progress.has_started or request.resume) and state.is_unverified:
            console.error(UNVERIFIED)
        raise


async def _calibrate(
    request: RunRequest,
    console: Console,
    progress: RunProgress,
    queue: CommandQueue,
    further: Sequence[Listener],
) -> events.Ended:
    """Calibrate; a person at a terminal may also type commands."""
    if not isinstance(request.operator, TerminalOperator):
        with unattended_runs.ended_in_time(request, queue):
            return await calibrate(request, [*further, progress], queue)
    watching = RunDeviceWatch(request.cell.settings.gauges)
    async with gauges_on_request(console, watching) as print_gauges:
        letters = {"g": print_gauges, "s": progress.print_status}
        keys = KeyboardCommands(console, queue.put, sys.stdin, letters)
        request.operator.before_question, request.operator.after_question = progress.bar.stop, keys.listen
        request.operator.type_command = keys.take
        console.print(LETTERS)
        listeners: list[Listener] = [*further, progress, keys, watching.note]
        run = calibrate(request, listeners, queue, watching.live, watching.follow)
        return await keys.listen_during(run)


def resume_command(request: RunRequest) -> str:
    """The shell command that resumes a run with a person at the terminal."""
    command = "length" if request.mode is Mode.LENGTH else "run"
    mode = ["--mode", request.mode.value] if request.mode in {Mode.CHECK, Mode.QUICK} else []
    words = ["hexacell", command, str(request.cell.path), "--resume", str(request.folder.path), *mode]
    return shlex.join(words)


def closing_lines(request: RunRequest, ended: events.Ended) -> tuple[str, ...]:
    """The run folder, what must be taught anew, and last the result in one line."""
    teaching = () if ended.displacement is None else (teaching_line(ended.displacement),)
    return (f"Everything about this run is in {request.folder.path}", *teaching, ended.line)
