"""A whole cell without wires: the simulated robot, on a clock that jumps, behind devices that obey.

What moves and what is measured is the simulation's own truth; only the protocols are left out, so
that a whole run takes as long as its mathematics and nothing depends on the machine's clock.
"""

from __future__ import annotations

import asyncio
import shutil
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.gauges.errors import GaugeAtEnd
from drivers.ports import ControllerStatus, DeviceIdentity, EncoderRound, GaugeReading
from drivers.simulated import machine as machine_module
from drivers.simulated.cell import _world
from drivers.simulated.machine import SimulatedMachine
from drivers.simulated.world import World
from hexacell.archive import RunFolder
from hexacell.bundled import bundled_config
from hexacell.cell.file import Cell, dump, load_cell
from hexacell.cell.recovery import Action
from hexacell.clock import CellClock
from hexacell.composition.calibration import _beginning
from hexacell.controller_config.native_toml import NativeToml
from hexacell.controller_config.proposal import Proposal
from hexacell.controller_config.write_back import commit
from hexacell.errors import HexacellError
from hexacell.mechanisms.hexaglide import Hexaglide
from hexacell.pose import Pose
from hexacell.robot import robot_of
from procedures import calibration as calibration_module
from procedures import events
from procedures.calibration import Calibration, Mode
from procedures.desk import Desk
from procedures.devices import Devices, MountedGauge
from procedures.engine import Engine, Listener
from procedures.journal import Journal
from procedures.performing import Performer
from procedures.recovery import GIVE_UP, Policy
from procedures.steps import Phase, SetKey, SixNumbers, ThreeNumbers

HALF_TRAVEL_MM = 6.25
NOTHING_IS_ZERO = (0.0, 0.0, 0.0)


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

    def wait(self, seconds: float, until: threading.Event | None = None) -> bool:
        if until is not None and until.is_set():
            return True
        self.time_s += seconds
        return False


class Fake:
    """What all fake devices can do: be dead, and be let go."""

    dead: HexacellError | None = None
    closed = 0

    def _answering(self, *names: str) -> tuple[DeviceIdentity, ...]:
        if self.dead:
            raise self.dead
        return tuple(DeviceIdentity(name, "fake", "a device") for name in names)

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

    async def open(self) -> DeviceIdentity:
        return self._answering(self.name)[0]

    async def read(self) -> GaugeReading:
        self.reads += 1
        if self.failures:
            raise self.failures.pop(0)
        value = self.shown()
        if abs(value) > HALF_TRAVEL_MM:
            raise GaugeAtEnd("is at an end of its travel", subject=f"gauge {self.name}")
        return GaugeReading(value, f"{value:+.3f}")

    async def glance(self) -> GaugeReading:
        value = self.shown()
        if abs(value) > HALF_TRAVEL_MM:
            raise GaugeAtEnd("is at an end of its travel", subject=f"gauge {self.name}")
        return GaugeReading(value, f"{value:+.3f}")

    async def check(self) -> None:
        if self.void:
            raise self.void


class FakeEncoders(Fake):
    """Six encoders that show what a function says."""

    def __init__(self, shown: Callable[[], Sequence[float]]) -> None:
        self.shown = shown
        self.failure: HexacellError | None = None

    async def open(self) -> tuple[DeviceIdentity, ...]:
        return self._answering(*(f"encoder {leg}" for leg in range(1, 7)))

    async def read(self) -> EncoderRound:
        if self.failure:
            raise self.failure
        positions = tuple(float(value) for value in self.shown())
        return EncoderRound(tuple(round(1000 * value) for value in positions), positions)


class FakeController(Fake):
    """A controller that writes down what it is asked and, given a machine, does it."""

    def __init__(self) -> None:
        self.machine: SimulatedMachine | None = None
        self.log: list[str] = []
        self.failures: dict[str, BaseException] = {}
        self.now = ControllerStatus(estop=False, enabled=True)

    def _do(self, order: str, target: str = "") -> None:
        self.log.append(f"{order} {target}".strip())
        if error := self.failures.pop(order, None):
            raise error

    async def open(self) -> DeviceIdentity:
        return self._answering("controller")[0]

    async def prepare(self) -> None:
        self._do("prepare")

    async def move(self, pose: Pose) -> None:
        self._do("move", str(pose))
        if self.machine:
            self.machine.move(pose)

    async def pose(self) -> Pose:
        self._do("pose")
        return self.machine.pose() if self.machine else Pose(0.0, 0.0, 0.0)

    async def status(self) -> ControllerStatus:
        return self.now

    async def stop(self) -> None:
        self._do("stop")

    async def reload(self) -> None:
        self._do("reload")
        if self.machine:
            self.machine.switch_on()


class Approver:
    """A person who puts gauges where they belong and answers as told."""

    def __init__(self, name: str | None = "a tester") -> None:
        self.name = name
        self.placed: list[int] = []
        self.asked: list[tuple[Sequence[events.Gate], str]] = []
        self.problems: list[str] = []
        self.decisions: list[Action] = []

    async def place_gauges(self, point: int, pose: Pose) -> None:
        self.placed.append(point)

    async def approve(self, gates: Sequence[events.Gate], change: str) -> str | None:
        self.asked.append((gates, change))
        return self.name

    async def decide(self, problem: str, choices: Sequence[Action]) -> Action:
        self.problems.append(problem)
        return self.decisions.pop(0) if self.decisions else Action.ABORT


@dataclass
class Bench:
    """Three gauges, encoders and a controller on a manual clock, to be told what to show."""

    clock: ManualClock = field(default_factory=ManualClock)

    def __post_init__(self) -> None:
        self.gauges = tuple(FakeGauge(name, lambda: 0.0) for name in "xyz")
        self.encoders = FakeEncoders(lambda: (0.0,) * 6)
        self.controller = FakeController()
        mounted = tuple(MountedGauge(gauge, axis, 1) for axis, gauge in enumerate(self.gauges))
        self.devices = Devices(mounted, self.encoders, self.controller)


@dataclass
class Rig:
    """A run of a cell on fake devices."""

    cell: Cell
    folder: RunFolder
    mode: Mode = Mode.OPTIMISE
    operator: Any = field(default_factory=Approver)
    engine: Any = None

    def __post_init__(self) -> None:
        simulation = self.cell.settings.simulation
        assert simulation is not None
        bench = self.bench = Bench()
        self.clock, self.gauges, self.controller = bench.clock, bench.gauges, bench.controller
        home, config = Pose(*self.cell.settings.identification.points[0]), self.cell.config_path
        self.world: World = _world(Hexaglide(), simulation, self.clock, NativeToml(), config, home)
        self.machine = SimulatedMachine(Hexaglide(), NativeToml(), config, self.world, self.clock, home)
        for gauge in bench.gauges:
            gauge.shown = partial(self.world.displacement, gauge.name)
        bench.encoders.shown = lambda: list(self.world.sliders())
        bench.controller.machine = self.machine
        self.calibration = Calibration(self.cell.settings, robot_of(self.cell), self.mode)
        self.performer = Performer(
            self.cell, self.calibration, bench.devices, self.clock, self.operator, self.folder
        )

    @property
    def config(self) -> bytes:
        return self.cell.config_path.read_bytes()

    def started(self) -> events.RunStarted:
        nobody: Any = SimpleNamespace(identities=())
        return _beginning(self.cell, self.calibration, nobody)

    async def run(self, *listeners: Listener, policy: Policy = GIVE_UP) -> events.Ended:
        """Begin, or go on where the folder's journal ends; ``engine`` is the one that does."""
        self.folder.path.mkdir(exist_ok=True)
        desk = Desk(self.performer.operator)
        performer = replace(self.performer, operator=desk)
        with Journal(self.folder.journal) as journal:
            engine = self.engine = Engine(performer, journal, listeners, desk=desk, policy=policy)
            if engine.state.started is None:
                engine.tell(self.started())
            engine.reopen_sets()
            return await engine.run()

    def write(self, history: Sequence[events.Event]) -> None:
        """A journal in which all this has happened already."""
        self.folder.path.mkdir(exist_ok=True)
        with Journal(self.folder.journal) as journal:
            for event in history:
                journal.append(event)


MakeRig = Callable[..., Rig]


SMALL: dict[str, Any] = {
    "identification.points": ((100.0, -100.0, 500.0), (-100.0, 100.0, 500.0)),
    "identification.orientations": 9,
    "verification.orientations": 3,
    "noise.encoder_mm": 0.001,
    "noise.gauge_mm": 0.001,
    "acceptance.mean_deviation_mm": 0.2,
    "acceptance.max_deviation_mm": 0.4,
    "timing.interval_s": 0.15,
    "simulation.gauges.noise_mm": 0.001,
    "simulation.gauges.flicker_mm": 0.0002,
    "simulation.encoders.noise_mm": 0.001,
    "simulation.encoders.flicker_mm": 0.0002,
}
"""A cell that is measured quickly and precisely: as few poses as identify it."""


def changed(section: Any, changes: dict[str, Any]) -> Any:
    """A section of the cell file with other values at some dotted keys."""
    for key, value in changes.items():
        head, _, rest = key.partition(".")
        inner = changed(getattr(section, head), {rest: value}) if rest else value
        section = section.model_copy(update={head: inner})
    return section


@pytest.fixture
def few_candidates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Choose among few poses, go there in few pieces: what is chosen is not under test here."""
    _hurry(monkeypatch)


def _hurry(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(calibration_module, "CANDIDATES", 64)
    patch.setattr(calibration_module, "HELD_OUT_CANDIDATES", 128)
    patch.setattr(machine_module, "STEPS", 8)


@pytest.fixture
def make_rig(few_candidates: None, tmp_path: Path) -> MakeRig:
    return partial(_rig, tmp_path)


def _rig(folder: Path, mode: Mode = Mode.OPTIMISE, operator: Any = None, **changes: Any) -> Rig:
    source = load_cell(bundled_config("simulated-hexaglide"))
    changes = SMALL | {key.replace("__", "."): value for key, value in changes.items()}
    path = folder / "cell.toml"
    path.write_text(dump(changed(source.settings, changes)))
    shutil.copy(source.config_path, folder)
    return Rig(load_cell(path), RunFolder(folder / "run"), mode, operator or Approver())


@dataclass(frozen=True)
class Recording:
    """A whole run as it should go, told event by event."""

    history: tuple[events.Event, ...]
    controller_log: tuple[str, ...]
    config_before: bytes
    config_after: bytes
    folder: RunFolder

    def until(self, *kinds: type[Any], count: int = 1) -> tuple[events.Event, ...]:
        """The history up to and with the ``count``-th event of these kinds."""
        places = [place for place, event in enumerate(self.history) if isinstance(event, kinds)]
        return self.history[: places[count - 1] + 1]


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    with pytest.MonkeyPatch.context() as patch:
        _hurry(patch)
        rig = _rig(tmp_path_factory.mktemp("recording"))
        before = rig.config
        told: list[events.Event] = []
        asyncio.run(rig.run(lambda event, _: told.append(event)))
    return Recording(tuple(told), tuple(rig.controller.log), before, rig.config, rig.folder)


@pytest.fixture
def replayed(recording: Recording, make_rig: MakeRig) -> Callable[..., Rig]:
    """A rig of the recorded cell in whose folder a part of the recorded run has happened already."""

    def make(history: Sequence[events.Event], **changes: Any) -> Rig:
        rig = make_rig(**changes)
        started = rig.started()
        rig.write([started if isinstance(event, events.RunStarted) else event for event in history])
        kinds = {type(event) for event in history}
        if events.Proposed in kinds:
            moved = str(recording.folder.path.parent), str(rig.folder.path.parent)
            rig.folder.proposal.write_text(recording.folder.proposal.read_text().replace(*moved))
        if events.Committed in kinds:
            commit(Proposal.load(rig.folder.proposal), rig.folder.path)
            rig.machine.switch_on()
        return rig

    return make


@dataclass(frozen=True)
class Story:
    """Events as they would happen, short to write."""

    key: SetKey

    def arrived(self, orientation: int = 1, pose: SixNumbers | None = None) -> events.Event:
        pose = pose or (100.0, -100.0, 500.0, float(orientation - 1), 0.0, 0.0)
        return events.Arrived(at=self.key, orientation=orientation, pose=pose)

    def placed(self) -> events.Event:
        return events.Placed(at=self.key)

    def sampled(
        self,
        orientation: int = 1,
        deviation: ThreeNumbers = NOTHING_IS_ZERO,
        pose: SixNumbers | None = None,
    ) -> events.Event:
        reading = events.Reading(
            gauges_mm=deviation, spread_mm=NOTHING_IS_ZERO, joints_mm=(0.0,) * 6, answers=(), counts=()
        )
        where = self.arrived(orientation, pose).model_dump(exclude={"kind"})
        return events.Sampled(**where, reading=reading, deviation_mm=deviation)

    def refused(self, orientation: int = 2) -> events.Event:
        return events.Refused(at=self.key, orientation=orientation, reason="the ball left the travel")

    def closed(self) -> events.Event:
        return events.SetClosed(at=self.key, drift_mm=NOTHING_IS_ZERO)

    def undone(self, orientation: int) -> events.Event:
        return events.Undone(at=self.key, orientation=orientation)

    def confirmed(self) -> events.Event:
        return events.Confirmed(at=self.key, change_mm=NOTHING_IS_ZERO)

    def voided(self) -> events.Event:
        return events.SetVoided(at=self.key, reason="interrupted")

    def whole(self, orientations: int) -> list[events.Event]:
        """A set measured from its first move to its closing."""
        told = [self.arrived(), self.placed(), self.sampled()]
        for orientation in range(2, orientations + 1):
            told += [self.arrived(orientation), self.sampled(orientation)]
        return [*told, self.arrived(), self.closed()]


@pytest.fixture
def story() -> Callable[..., Story]:
    def make(phase: Phase = Phase.IDENTIFY, point: int = 1) -> Story:
        return Story(SetKey(phase=phase, point=point))

    return make


@pytest.fixture
def bench() -> Bench:
    return Bench()
