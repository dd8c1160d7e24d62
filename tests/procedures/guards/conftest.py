"""A cell in slow motion: time passes only when nobody has anything left to do in it.

Devices take as long to answer as real ones, moves last, and every task that sleeps is woken at its
own moment, in order; so how long something took is exact, and none of it on the wall.
"""

import asyncio
import heapq
import itertools
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from drivers.errors import GaugeSilent, MotionInterrupted, WrongSetting
from drivers.interfaces import ControllerStatus, EncoderSample, GaugeReading, StartupActions
from hexacell.cell.measuring import GuardSettings
from hexacell.errors import DeviceError
from procedures.run.questions import Question
from procedures.run.state import RunState, apply
from procedures.steps import events
from procedures.steps.events import Step

QUIET = 12
"""So many turns of the event loop without a new sleeper: everybody waits for time to pass."""

GAUGE_S, ENCODERS_S, STATUS_S = 0.043, 0.002, 0.001
"""What an answer takes: 4800 baud with 20 ms in the instrument; six PDOs; a line over TCP."""

TIMEOUT_S = 0.5


class SlowMotion:
    """Takes a clock over: sleepers wake in order, and time jumps from one to the next."""

    def __init__(self, clock: Any) -> None:
        self.clock = clock
        self._sleepers: list[tuple[float, int, asyncio.Future[None]]] = []
        self._numbers = itertools.count()
        self._waking: asyncio.Task[None] | None = None
        clock.sleep = self.sleep
        clock.wait = lambda seconds, until=None: False

    async def sleep(self, seconds: float) -> None:
        awake: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        heapq.heappush(self._sleepers, (self.clock.time_s + seconds, next(self._numbers), awake))
        if self._waking is None or self._waking.done():
            self._waking = asyncio.ensure_future(self._wake())
        await awake

    async def _wake(self) -> None:
        while self._sleepers:
            await self._until_everybody_waits()
            due, _, awake = heapq.heappop(self._sleepers)
            if not awake.done():
                self.clock.time_s = max(self.clock.time_s, due)
                awake.set_result(None)

    async def _until_everybody_waits(self) -> None:
        quiet, known = 0, 0
        while quiet < QUIET:
            await asyncio.sleep(0)
            quiet = quiet + 1 if len(self._sleepers) == known else 0
            known = len(self._sleepers)


@dataclass
class Scene:
    """A rig in slow motion, a state that grows with what is done, and what can go wrong in it."""

    rig: Any
    state: RunState = field(default_factory=RunState)
    silent: set[str] = field(default_factory=set)
    at_end: set[str] = field(default_factory=set)
    inch: set[str] = field(default_factory=set)
    shift: dict[str, float] = field(default_factory=dict)
    frozen: dict[str, float] = field(default_factory=dict)
    encoder_alarm: bool = False
    slip_mm: float = 0.0
    forbidden: str | None = None

    def __post_init__(self) -> None:
        SlowMotion(self.rig.clock)
        self.stops = 0
        self.controller = self.rig.controller
        self.controller.move, self.controller.stop = self.move, self.stop
        self.controller.status, self.controller.prepare = self.status, self.prepare
        self.controller.reload, self.rig.operator.ask = self.reload, self.ask
        self.rig.bench.encoders.read = self.round
        for gauge in self.rig.gauges:
            gauge.shown = self._shown(gauge.name, gauge.shown)
            gauge.read_once = self._asked(gauge.name, gauge.read_once)
            gauge.read = self._asked(gauge.name, gauge.read)
        object.__setattr__(self.rig.bench.devices, "stop_input", self)

    @property
    def now(self) -> float:
        time_s: float = self.rig.clock.time_s
        return time_s

    async def move(self, pose: Any, duration_s: float) -> None:
        self.controller._do("move", str(pose))
        stops = self.stops
        self.rig.machine.move(pose, duration_s)
        while self.now < self.rig.physics._motion.end_s:
            await self.rig.clock.sleep(0.005)
        if self.stops != stops or not self.controller.now.may_move:
            raise MotionInterrupted("stopped on the way", subject="controller")

    async def stop(self) -> None:
        self.stops += 1
        self.controller._do("stop")
        self.rig.machine.stop()

    async def prepare(self, permitted: StartupActions) -> None:
        del permitted
        self.controller._do("prepare")
        await self.rig.clock.sleep(0.5)

    async def reload(self, permitted: StartupActions) -> None:
        del permitted
        self.controller._do("reload")
        await self.rig.clock.sleep(1.0)
        self.rig.machine.switch_on()

    async def ask(self, question: Question) -> str | None:
        await self.rig.clock.sleep(2.0)
        return question.default

    async def status(self) -> ControllerStatus:
        await self._answer("controller", STATUS_S)
        return self.controller.now  # type: ignore[no-any-return]

    async def round(self) -> EncoderSample:
        await self._answer("encoders", ENCODERS_S)
        if self.encoder_alarm:
            raise DeviceError("reports no magnet", subject="encoder 3", action="Look at it")
        positions = tuple(float(value) + self.slip_mm for value in self.rig.physics.encoder_positions())
        return EncoderSample(tuple(round(1000 * value) for value in positions), positions)

    async def active_reason(self) -> str | None:
        return self.forbidden

    async def open(self) -> None:
        """There is nothing to open."""

    async def close(self) -> None:
        """There is nothing to close."""

    def switch_off(self, *complaints: str, estop: bool = False) -> None:
        """The drives are switched off, and stop where they are."""
        self.controller.now = ControllerStatus(estop, False, complaints)
        self.rig.machine.stop()

    async def do(self, step: Step) -> events.Event:
        """One step, and what follows from it."""
        event: events.Event = await self.rig.performer.perform(step, self.state)
        self.state = apply(self.state, event)
        return event

    async def _answer(self, device: str, seconds: float) -> None:
        if device in self.silent:
            await self.rig.clock.sleep(TIMEOUT_S)
            raise GaugeSilent("does not answer", subject=device)
        await self.rig.clock.sleep(seconds)

    def _shown(self, name: str, real: Callable[[], float]) -> Callable[[], float]:
        def shown() -> float:
            if name in self.at_end:
                return 99.0
            return self.frozen.get(name, real() + self.shift.get(name, 0.0))

        return shown

    def _asked(self, name: str, real: Callable[[], Awaitable[GaugeReading]]) -> Any:
        async def answer() -> GaugeReading:
            await self._answer(f"gauge {name}", GAUGE_S)
            if name in self.inch:
                raise WrongSetting("answers in inch", subject=f"gauge {name}", action="Press its in/mm key")
            return await real()

        return answer


@pytest.fixture
def scene(make_rig: Any) -> Callable[..., Scene]:
    def make(rig: Any = None, **changes: Any) -> Scene:
        slow = {"simulation__motion__minimum_s": 1.0, "guards__stale_s": GuardSettings().stale_s}
        slow |= {"speed__joint_at_gauges": 100.0, "speed__edge_at_gauges_mm_s": 100.0}
        return Scene(rig or make_rig(**slow | changes))

    return make
