"""A whole cell on fake devices: the simulated robot's own truth, without protocols."""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from drivers.simulated.physics import RobotPhysics
from drivers.simulated.robot import SimulatedMachine
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, dump, load_cell
from hexacell.cell.recovery import Escalations
from hexacell.errors import DeviceError, FileError, HexacellError
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose
from hexacell.results.result import AcceptedResult
from hexacell.robot.model import robot_of
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import run_started
from procedures.calibration.calibration import Calibration, Mode
from procedures.engine.commands import QuestionBroker
from procedures.engine.engine import Engine, Listener
from procedures.engine.recovery import GIVE_UP
from procedures.journal.journal import Journal
from procedures.steps import events
from procedures.workflow.next_step import StepExecutor
from tests.native_config import NATIVE
from tests.procedures.fakes import Approver, Bench
from tests.recorded_events import record
from tests.small_cell import FEW_CHOICES, SMALL, changed, history_until


@dataclass
class Rig:
    """A run of a cell on fake devices."""

    cell: Cell
    folder: RunFolder
    mode: Mode = Mode.OPTIMISE
    operator: Any = field(default_factory=Approver)
    engine: Any = None
    accepted: AcceptedResult | None = None
    length_check: bool = False

    def __post_init__(self) -> None:
        simulation = self.cell.settings.simulation
        assert simulation is not None
        bench = self.bench = Bench()
        self.clock, self.gauges, self.controller = bench.clock, bench.gauges, bench.controller
        home, config = Pose(*self.cell.settings.identification.points[0]), self.cell.config_path
        self.physics: RobotPhysics = RobotPhysics(
            Hexaglide(), simulation, self.clock, NATIVE.read(config), home, self.cell.settings.length_check
        )
        self.machine = SimulatedMachine(
            Hexaglide(), NATIVE, (config,), self.physics, self.clock, home, simulation.soft_limits
        )
        for gauge in bench.gauges:
            gauge.shown = partial(self.physics.gauge_displacement, gauge.name)
        bench.encoders.shown = lambda: list(self.physics.encoder_positions())
        bench.controller.machine = self.machine
        self.calibration = Calibration(
            self.cell.settings,
            robot_of(self.cell),
            self.mode,
            accepted=self.accepted,
            length_check=self.length_check,
            effort=FEW_CHOICES,
        )
        self.performer = StepExecutor(
            self.cell, self.calibration, bench.devices, self.clock, self.operator, self.folder
        )

    @property
    def config(self) -> bytes:
        return self.cell.config_path.read_bytes()

    def started(self) -> events.RunStarted:
        return run_started(self.cell, self.calibration, ())

    async def run(self, *listeners: Listener, policy: Escalations = GIVE_UP) -> events.Ended:
        """Begin, or go on where the folder's journal ends; ``engine`` is the one that does."""
        self.folder.path.mkdir(exist_ok=True)
        broker = QuestionBroker(self.performer.operator)
        with Journal(self.folder.journal) as journal:
            evidence, began_s = journal.require_read_back, self.clock.now() - journal.lasted_s
            performer = replace(self.performer, operator=broker, require_evidence=evidence, began_s=began_s)
            engine = self.engine = Engine(performer, journal, listeners, broker=broker, policy=policy)
            if engine.state.started is None:
                engine.record(self.started())
            engine.reopen_sets()
            return await engine.run()

    def write(self, history: Sequence[events.Event]) -> None:
        """A journal in which all this has happened already."""
        self.folder.path.mkdir(exist_ok=True)
        record(self.folder.journal, history)


MakeRig = Callable[..., Rig]


def new_rig(
    folder: Path,
    mode: Mode = Mode.OPTIMISE,
    operator: Any = None,
    accepted: AcceptedResult | None = None,
    *,
    length_check: bool = False,
    **changes: Any,
) -> Rig:
    source = load_cell(bundled_config("simulated-hexaglide"))
    changes = (
        SMALL
        | {"timing.interval_s": 0.15, "simulation.seed": 7}  # few records, whose error is clearly seen
        | {key.replace("__", "."): value for key, value in changes.items()}
    )
    path = folder / "cell.toml"
    path.write_text(dump(changed(source.settings, changes)))
    shutil.copy(source.config_path, folder)
    run, person = RunFolder(folder / "run"), operator or Approver()
    return Rig(load_cell(path), run, mode, person, accepted=accepted, length_check=length_check)


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
        return history_until(self.history, *kinds, count=count)


async def failure_without_record(
    rig: Rig, patch: pytest.MonkeyPatch, kind: type[Any], *, reload_works: bool
) -> str:
    """The error of a run that cannot journal an event of this kind."""
    append = Journal.append

    def full(self: Journal, event: events.Event) -> None:
        if isinstance(event, kind):
            if not reload_works:
                rig.controller.failures["reload"] = DeviceError("does not answer", subject="controller")
            raise FileError("the disk is full", subject=self.path)
        append(self, event)

    with patch.context() as patched:
        patched.setattr(Journal, "append", full)
        with pytest.raises(HexacellError, match="the disk is full") as failure:
            await rig.run()
    return str(failure.value)
