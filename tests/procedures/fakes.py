"""Devices without wires, on a clock that jumps, and a person who answers as told."""

import asyncio
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from drivers import interfaces
from drivers.controllers.linuxcnc.gcode import parse_pose_refusal
from drivers.errors import GaugeAtEnd, PoseRefused, StartupNotPermitted
from drivers.simulated.linuxcnc.state import MotionRefused
from drivers.simulated.robot import SimulatedMachine
from hexacell.cell.devices import GaugeAxis
from hexacell.cell.recovery import Action
from hexacell.clock import CellClock
from hexacell.errors import HexacellError
from hexacell.kinematics.pose import Pose
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.devices.device_set import Devices, MountedGauge
from procedures.run import questions

HALF_TRAVEL_MM = 6.25


class ManualClock(CellClock):
    """A clock on which waiting is what lets time pass, and takes none on the wall."""

    def __init__(self) -> None:
        super().__init__()
        self.time_s = 0.0

    def now(self) -> float:
        return self.time_s

    async def sleep(self, seconds: float) -> None:
        self.time_s += seconds
        await asyncio.sleep(0)

    def wait(self, seconds: float, until: threading.Event) -> None:
        if not until.is_set():
            self.time_s += seconds


class Fake:
    """What all fake devices can do: be dead, and be let go."""

    dead: HexacellError | None = None
    closed = 0

    def _answering(self, *names: str) -> tuple[interfaces.DeviceIdentity, ...]:
        if self.dead:
            raise self.dead
        return tuple(interfaces.DeviceIdentity(name, "fake", "a device") for name in names)

    async def close(self) -> None:
        self.closed += 1


class FakeGauge(Fake):
    """A gauge that shows what a function says, unless it has a failure to report first."""

    def __init__(self, name: str, shown: Callable[[], float]) -> None:
        self.name = name
        self.shown = shown
        self.failures: list[HexacellError] = []
        self.void: HexacellError | None = None
        self.reads = 0

    async def open(self) -> interfaces.DeviceIdentity:
        return self._answering(self.name)[0]

    async def read(self) -> interfaces.GaugeReading:
        self.reads += 1
        if self.failures:
            raise self.failures.pop(0)
        return self._reading()

    async def read_once(self) -> interfaces.GaugeReading:
        return self._reading()

    def _reading(self) -> interfaces.GaugeReading:
        value = self.shown()
        if abs(value) > HALF_TRAVEL_MM:
            raise GaugeAtEnd("is at an end of its travel", subject=f"gauge {self.name}")
        return interfaces.GaugeReading(value, f"{value:+.3f}")

    async def check(self) -> None:
        if self.void:
            raise self.void


class FakeThermometer(Fake):
    """One that shows what stands in a list, the last of it for ever."""

    def __init__(self, name: str, *shown: float | Exception) -> None:
        self.name = name
        self.shown = list(shown)

    async def open(self) -> interfaces.DeviceIdentity:
        await self.read()
        return interfaces.DeviceIdentity(f"thermometer {self.name}", "fake", "a thermometer")

    async def read(self) -> interfaces.TemperatureReading:
        shown = self.shown.pop(0) if len(self.shown) > 1 else self.shown[0]
        if isinstance(shown, Exception):
            raise shown
        return interfaces.TemperatureReading(shown, f"{1000 * shown:.0f}")


class FakeEncoders(Fake):
    """Six encoders that show what a function says."""

    def __init__(self, shown: Callable[[], Sequence[float]]) -> None:
        self.shown = shown
        self.failure: HexacellError | None = None

    async def open(self) -> tuple[interfaces.DeviceIdentity, ...]:
        return self._answering(*(f"encoder {leg}" for leg in range(1, 7)))

    async def read(self) -> interfaces.EncoderSample:
        if self.failure:
            raise self.failure
        positions = tuple(float(value) for value in self.shown())
        return interfaces.EncoderSample(tuple(round(1000 * value) for value in positions), positions)


def refused(pose: Pose, message: str) -> PoseRefused:
    """What the real driver makes of a message."""
    reason = parse_pose_refusal(message)
    assert reason is not None
    axis, is_highest = reason
    return PoseRefused(
        f"to move to {pose}", message, subject="controller", axis=axis, is_highest=is_highest
    )


class FakeController(Fake):
    """A controller that writes down what it is asked and, given a machine, does it."""

    def __init__(self) -> None:
        self.machine: SimulatedMachine | None = None
        self.log: list[str] = []
        self.failures: dict[str, BaseException] = {}
        self.now = interfaces.ControllerStatus(estop=False, enabled=True)
        self.needed: list[interfaces.StartupAction] = []
        self.durations_s: list[float] = []

    def _do(self, order: str, target: str = "") -> None:
        self.log.append(f"{order} {target}".strip())
        if error := self.failures.pop(order, None):
            raise error

    async def open(self) -> interfaces.DeviceIdentity:
        return self._answering("controller")[0]

    async def prepare(self, permitted: interfaces.StartupActions) -> None:
        self._do("prepare")
        self._start_up(permitted)

    def _start_up(self, permitted: interfaces.StartupActions) -> None:
        for needed in [action for action in self.needed if action not in permitted]:
            raise StartupNotPermitted(needed, "controller")
        self.log += [action.value for action in self.needed]
        self.needed = []

    async def move(self, pose: Pose, duration_s: float) -> None:
        self._do("move", str(pose))
        self.durations_s.append(duration_s)
        if self.machine:
            try:
                self.machine.move(pose, duration_s)
            except MotionRefused as refusal:
                raise refused(pose, str(refusal)) from refusal

    async def position(self) -> interfaces.ReportedPosition | None:
        return (
            interfaces.ReportedPosition(self.machine.pose(), self.machine.joints())
            if self.machine
            else None
        )

    async def status(self) -> interfaces.ControllerStatus:
        return self.now

    async def stop(self) -> None:
        self._do("stop")

    async def reload(self, permitted: interfaces.StartupActions) -> None:
        self._do("reload")
        self._start_up(permitted)
        if self.machine:
            self.machine.switch_on()


class Approver:
    """A person who puts gauges where they belong and answers as told."""

    def __init__(self, name: str | None = "a tester", startup: Sequence[str] = ()) -> None:
        self.name = name
        self.placed: list[int] = []
        self.asked: list[tuple[Sequence[AcceptanceGate], str]] = []
        self.problems: list[str] = []
        self.decisions: list[Action] = []
        self.startup = list(startup)
        self.results: list[str] = []

    async def ask(self, question: questions.Question) -> str | None:
        match question.subject:
            case questions.GaugePlacement(point=point):
                self.placed.append(point)
                return question.default
            case questions.PendingChange(gates=gates, diff=diff):
                self.asked.append((gates, diff))
                return self.name
            case questions.WrittenResult(line=line):
                self.results.append(line)
                return self.name
            case questions.StepFailure(problem=problem):
                self.problems.append(problem)
                return self.decisions.pop(0) if self.decisions else Action.ABORT
            case questions.UnreadyController(problem=problem, request=request):
                self.problems.append(f"{problem}. {request}")
                return self.startup.pop(0)


class SilentOperator:
    """An operator who never answers, so that a command has to."""

    async def ask(self, question: questions.Question) -> str | None:
        await asyncio.Event().wait()
        return question.default


@dataclass
class Bench:
    """Three gauges, encoders and a controller on a manual clock, to be told what to show."""

    clock: ManualClock = field(default_factory=ManualClock)

    def __post_init__(self) -> None:
        self.gauges = tuple(FakeGauge(name, lambda: 0.0) for name in "xyz")
        self.encoders = FakeEncoders(lambda: (0.0,) * 6)
        self.controller = FakeController()
        mounted = tuple(MountedGauge(gauge, GaugeAxis(axis, 1)) for axis, gauge in enumerate(self.gauges))
        self.devices = Devices(mounted, self.encoders, self.controller)
