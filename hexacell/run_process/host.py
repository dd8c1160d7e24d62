"""The process that an engine runs in: it sends its clients everything and obeys one of them.

It outlives the terminal that began the run. If that is gone without a word, the run pauses after the record
in progress and goes on when somebody who has attached says so. Where nobody does for the time that the
cell file states, it ends in place and can be resumed.
"""

import asyncio
from socket import socket

from hexacell.campaign.pose_list import pose_list_of
from hexacell.errors import ExitCode, HexacellError
from hexacell.plugins import plugin_failures_named
from hexacell.run_process import messages
from hexacell.run_process.audience import Audience
from hexacell.run_process.run_device_watch import RunDeviceWatch
from hexacell.services.run.calibration_run import RunRequest, calibrate
from procedures.calibration.calibration import expected_records
from procedures.devices.device_set import Devices
from procedures.engine.command_loop import Status
from procedures.engine.commands import Abort, CommandQueue, Pause, Stop
from procedures.engine.engine import Engine
from procedures.journal.journal import is_evidence_lost, now, read_entries
from procedures.run.questions import Question
from procedures.run.state import RunState
from procedures.steps import events
from procedures.steps.base import Computation

FIRST_CLIENT_S = 30.0
"""How long a host waits for who started it; nothing moves before."""

ABORT_S = 0.2
"""How long an abandoned computation may last that moves nothing and writes nothing but its result."""


STOPPED = messages.HostFailed(problem="stopped by who left it", exit_code=int(ExitCode.INTERRUPTED))


class RemoteOperator:
    """A person who answers by commands; nobody else does."""

    async def ask(self, question: Question) -> str | None:  # noqa: ARG002 - clients are sent it
        """Wait for ever."""
        await asyncio.Event().wait()
        return None


class RunHost:
    """One run, whose operator should be a :class:`RemoteOperator`, and its audience."""

    def __init__(self, request: RunRequest, queue: CommandQueue) -> None:
        settings = request.cell.settings
        self._watching = RunDeviceWatch(settings.gauges)
        self._request = request
        self._queue = queue
        self._away_minutes = settings.recovery.away_minutes
        self._audience = Audience(
            self._opening, on_command=self._queue.put, on_control=self._on_control, on_leave=self._on_leave
        )
        described = messages.RunDescribed(
            cell=settings.name,
            cell_file=request.cell.path.absolute(),
            folder=request.folder.path.absolute(),
            mode=request.mode.value,
            expected_records=expected_records(
                settings, request.mode, pose_list_of(request.cell), length_check=request.length_check
            ),
        )
        self._lines: list[bytes] = [messages.message_line(described)]
        self._sequence = 0
        self._status = Status.IDLE
        self._question: Question | None = None
        self._failure: messages.HostFailed | None = None
        self._last: events.Event | None = None
        self._is_lost = False
        self._giving_up: asyncio.TimerHandle | None = None
        self._aborted = asyncio.Event()

    async def serve(self, listener: socket) -> ExitCode:
        """Carry out the run with who connects to ``listener``; how it ended.

        The run begins when the first client has come, and does not if none does.
        """
        most = messages.LONGEST_MESSAGE
        server = await asyncio.start_unix_server(self._audience.serve, sock=listener, limit=most)
        try:
            await asyncio.wait_for(self._audience.first_came.wait(), FIRST_CLIENT_S)
        except TimeoutError:
            return ExitCode.INTERRUPTED
        else:
            return await self._run_to_end()
        finally:
            server.close()

    async def _run_to_end(self) -> ExitCode:
        watching = asyncio.ensure_future(self._watch_devices())
        running = asyncio.ensure_future(self._run())
        aborting = asyncio.ensure_future(self._until_aborted(running))
        try:
            await asyncio.wait([running, aborting], return_when=asyncio.FIRST_COMPLETED)
            if running.done():
                return running.result()
            self._fail(STOPPED)
            return ExitCode.INTERRUPTED
        finally:
            self._watching.close()
            for task in (watching, aborting, self._giving_up):
                if task is not None:
                    task.cancel()
            await self._audience.dismiss()

    async def _run(self) -> ExitCode:
        request, live = self._request, self._watching.live
        try:
            with plugin_failures_named():
                ended = await calibrate(request, [self._record], self._queue, live, self._watch)
        except HexacellError as error:
            self._fail(failure_message(error))
            return error.exit_code
        except asyncio.CancelledError:
            self._fail(STOPPED)
            return ExitCode.INTERRUPTED
        except Exception as error:
            problem = f"this is a fault of the program: {type(error).__name__}: {error}"
            self._fail(messages.HostFailed(problem=problem, exit_code=int(ExitCode.FAULT)))
            raise
        return ExitCode(ended.exit_code)

    def _fail(self, failure: messages.HostFailed) -> None:
        self._failure = failure
        self._audience.send(failure)

    async def _until_aborted(self, running: asyncio.Future[ExitCode]) -> None:
        """Ends a little after an abort, if all that is left of the run is a computation in a thread."""
        await self._aborted.wait()
        if not self._queue.is_attended:  # it has not begun
            running.cancel()
        await asyncio.wait([running], timeout=ABORT_S)
        step = self._last.step if isinstance(self._last, events.StepBegun) else None
        if not isinstance(step, Computation):
            await asyncio.wait([running])

    def _watch(self, engine: Engine, devices: Devices) -> None:
        """Called with the engine before it begins: what happened before is sent first."""
        for entry in read_entries(self._request.folder.journal):
            self._send_event(messages.EventRecorded(sequence=entry.number, at=entry.at, event=entry.event))
        self._watching.follow(engine, devices)
        engine.commands.watchers.append(self._on_status)
        engine.broker.watchers.append(self._on_question)

    def _record(self, event: events.Event, _: RunState) -> None:
        self._send_event(messages.EventRecorded(sequence=self._sequence + 1, at=now()[0], event=event))

    def _send_event(self, recorded: messages.EventRecorded) -> None:
        self._sequence, self._last = recorded.sequence, recorded.event
        self._lines.append(messages.message_line(recorded))
        self._audience.send(recorded)
        self._watching.note(recorded.event)

    def _on_status(self, status: Status) -> None:
        self._status = status
        self._audience.send(messages.StatusChanged(status=status))
        if self._is_lost and status is Status.RUNNING:
            self._queue.put(Pause())
        self._reconsider()

    def _on_question(self, question: Question | None) -> None:
        self._question = question
        self._audience.send(messages.QuestionChanged(question=question))
        self._reconsider()

    def _opening(self) -> list[bytes]:
        present = [messages.message_line(messages.StatusChanged(status=self._status))]
        if self._question is not None:
            present.append(messages.message_line(messages.QuestionChanged(question=self._question)))
        if self._failure is not None:
            present.append(messages.message_line(self._failure))
        return [*self._lines, *present]

    def _on_control(self) -> None:
        self._is_lost = False
        self._reconsider()

    def _on_leave(self, leave: messages.Leave | None) -> None:
        self._is_lost = leave is None
        if leave is None and self._status is Status.RUNNING:
            self._queue.put(Pause())
        elif leave is not None and not leave.keep_running:
            self._queue.put(Abort(STOPPED.problem))
            self._aborted.set()
        self._reconsider()

    def _reconsider(self) -> None:
        """Count the time while the run waits and nobody is there."""
        is_away = self._watching.is_waiting and not self._audience.is_controlled
        if self._giving_up is not None and not is_away:
            self._giving_up.cancel()
            self._giving_up = None
        elif self._giving_up is None and is_away:
            loop = asyncio.get_running_loop()
            stop = Stop(f"nobody was connected for {self._away_minutes:g} minutes")
            self._giving_up = loop.call_later(60.0 * self._away_minutes, self._queue.put, stop)

    async def _watch_devices(self) -> None:
        async for snapshot in self._watching.snapshots():
            self._audience.send_latest(snapshot)


def failure_message(error: HexacellError) -> messages.HostFailed:
    """An error that ends a run, as a message."""
    return messages.HostFailed(
        problem=error.cause,
        action=error.action or "",
        exit_code=int(error.exit_code),
        evidence_lost=is_evidence_lost(error),
    )
