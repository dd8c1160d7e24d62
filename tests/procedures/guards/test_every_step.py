"""Every guard, tripped at every kind of step: the robot stops in time, and the config is unchanged.

Time is simulated, so figures are exact; the benchmark measures them with real drivers in real time.
"""

import asyncio
import shutil
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from hexacell.errors import ExitCode, HexacellError
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.state import fold
from procedures.run.trips import Guard, GuardTripped
from procedures.steps import events
from procedures.steps.close import CloseSet
from procedures.steps.commit import Commit
from procedures.steps.move import Move
from procedures.steps.place import Place
from procedures.steps.sample import Sample

MUST_S = 0.2
STRIKES_S = 0.3
"""After so long in a step: a move is then on its way, readings are being taken."""

P1 = SetKey(phase=Phase.IDENTIFY, point=1)
V1 = SetKey(phase=Phase.AFTER, point=1)
Step = Callable[[], Awaitable[Any]]


def move(at: SetKey, orientation: int) -> Move:
    x, y, z = (100.0, -100.0, 500.0) if at is P1 else (-100.0, -50.0, 450.0)
    return Move(at=at, orientation=orientation, pose=(x, y, z, orientation - 1.0, 0.0, 0.0))


def sample(at: SetKey, orientation: int) -> Sample:
    return Sample(at=at, orientation=orientation, pose=move(at, orientation).pose)


def zeroed(at: SetKey) -> tuple[Any, ...]:
    return move(at, 1), sample(at, 1)


STEPS: dict[str, tuple[Any, ...]] = {
    "prepare": (),
    "move to a reference": (move(P1, 2), move(V1, 1)),
    "place": (move(P1, 1), Place(at=P1, pose=move(P1, 1).pose)),
    "move in a set": (*zeroed(P1), move(P1, 2)),
    "way back": (*zeroed(P1), move(P1, 2), sample(P1, 2), move(P1, 1)),
    "move afterwards": (*zeroed(V1), move(V1, 2)),
    "sample of the reference": zeroed(P1),
    "sample in a set": (*zeroed(P1), move(P1, 2), sample(P1, 2)),
    "close": (*zeroed(P1), CloseSet(at=P1)),
    "sample afterwards": (*zeroed(V1), move(V1, 2), sample(V1, 2)),
    "reload": (Commit(),),
}
"""Kinds of steps: the last one after those before it; to prepare is none of a run's steps."""

OUTSIDE = ("move to a reference",)
WITHIN = ("move in a set", "way back", "move afterwards")
READING = ("sample of the reference", "sample in a set", "close", "sample afterwards")


async def come_to(scene: Any, step: str) -> Step:
    """Do what comes before a step, which is given to be done."""
    if step == "prepare":
        return lambda: scene.rig.performer.prepare(scene.state)
    *before, last = STEPS[step]
    for one in before:
        await scene.do(one)
    return lambda: scene.do(last)


@dataclass(frozen=True)
class Fault:
    """Something that happens, the guard that trips on it, and at which steps it does."""

    name: str
    guard: Guard
    strike: Callable[[Any], Any]
    steps: tuple[str, ...]


STANDING_ON = (*OUTSIDE, *WITHIN, "place", *READING)
MOVING = ("prepare", *OUTSIDE, *WITHIN, "place", "reload")
LAGS = "joint 3 following error"
FAULTS = (
    Fault("stop line", Guard.STOP_LINE, lambda s: setattr(s, "forbidden", "stop exists"), tuple(STEPS)),
    Fault("estop", Guard.EMERGENCY_STOP, lambda s: s.switch_off(estop=True), STANDING_ON),
    Fault("switched off", Guard.CONTROLLER, lambda s: s.switch_off(), STANDING_ON),
    Fault("following error", Guard.FOLLOWING, lambda s: s.switch_off(LAGS), STANDING_ON),
    Fault("silent controller", Guard.STALE, lambda s: s.silent.add("controller"), STANDING_ON),
    Fault("gauge at its end", Guard.GAUGE_END, lambda s: s.at_end.add("y"), WITHIN),
    Fault("ball off its plate", Guard.PLATE, lambda s: s.shift.update(z=5.7), WITHIN),
    Fault("silent gauge", Guard.STALE, lambda s: s.silent.add("gauge x"), WITHIN),
    Fault("gauge in inches", Guard.DEVICE, lambda s: s.inch.add("x"), WITHIN),
    Fault("encoder alarm", Guard.ENCODERS, lambda s: setattr(s, "encoder_alarm", True), MOVING),
    Fault("silent encoders", Guard.STALE, lambda s: s.silent.add("encoders"), MOVING),
)


@pytest.fixture
def stage(scene: Any, recording: Any, replayed: Any) -> Callable[..., Any]:
    """A scene that has come as far as a step needs."""

    def make(step: str) -> Any:
        if step != "reload":
            return scene(stations__placement="by-hand")
        staged = scene(replayed(recording.until(events.Proposed), guards__stale_s=0.12))
        staged.state = fold(read_journal(staged.rig.folder.journal))
        return staged

    return make


async def struck(scene: Any, fault: Fault, doing: Step) -> tuple[float, Any]:
    """When it struck, on the cell's clock, and how the step ended."""
    action = asyncio.ensure_future(doing())
    while scene.state.proposed and "reload" not in scene.controller.log:  # noqa: ASYNC110 - a thread writes
        await asyncio.sleep(0)  # the config is being written, for which no time passes here
    await scene.rig.clock.sleep(STRIKES_S)
    assert not action.done(), "it must strike in the middle"
    at_s = scene.now
    fault.strike(scene)
    ended: Any = (await asyncio.gather(action, return_exceptions=True))[0]
    if isinstance(ended, BaseException) and not isinstance(ended, HexacellError):
        raise ended
    return at_s, ended


def root(error: BaseException) -> GuardTripped:
    """The trip that an error comes from."""
    while not isinstance(error, GuardTripped):
        assert error.__cause__ is not None, error
        error = error.__cause__
    return error


MORE = (
    *("gauge at its end-move to a reference", "ball off its plate-move afterwards"),
    *("encoder alarm-reload", "silent gauge-close"),
)


@pytest.mark.sample("*-move in a set", "stop line-*", *MORE)
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
async def test_the_robot_stops_within_the_limit_for_each_guard_and_step(stage, step, fault):
    scene = stage(step)
    config = scene.rig.config
    doing = await come_to(scene, step)
    at_s, ended = await struck(scene, fault, doing)
    goes_on = step == "reload" and step not in fault.steps
    assert (scene.rig.config == config) is not goes_on
    assert scene.rig.physics._motion.end_s <= at_s + MUST_S or (step in OUTSIDE and step not in fault.steps)
    if step == "move afterwards" and fault.guard in {Guard.GAUGE_END, Guard.PLATE}:
        assert isinstance(ended, events.RecordRejected), "a verdict on the new geometry"
        assert scene.rig.performer.guards.supervisor.latched is None
    elif step in fault.steps:
        tripped = root(ended)
        assert tripped.trip.guard is fault.guard
        assert tripped.exit_code is ExitCode.HARDWARE
        assert tripped.action
        assert scene.rig.performer.guards.supervisor.latched == tripped.trip
        assert scene.stops
        with pytest.raises(GuardTripped):
            await scene.do(move(P1, 3))
    elif step not in READING:
        assert not isinstance(ended, BaseException), "nothing that concerns this step"
    if step in {*OUTSIDE, *WITHIN} and step in fault.steps:
        assert scene.rig.physics.progress() < 1.0, "stopped on the way"


@pytest.mark.parametrize("step", STEPS)
async def test_no_step_begins_without_free_disk_space(stage: Any, step: str, monkeypatch: Any) -> None:
    scene = stage(step)
    config = scene.rig.config
    doing = await come_to(scene, step)
    orders, still_since_s = len(scene.controller.log), scene.rig.physics._motion.end_s
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=49_900_000))
    with pytest.raises(HexacellError) as refusal:
        await doing()
    assert root(refusal.value).trip.guard is Guard.DISK
    assert "only 50 MB are free" in str(root(refusal.value))
    assert scene.rig.config == config
    if step != "reload":
        assert len(scene.controller.log) == orders
    assert scene.rig.physics._motion.end_s == still_since_s
