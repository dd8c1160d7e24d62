"""A whole cell on fake devices: the simulated robot's own truth, without protocols."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from drivers.simulated import robot as machine_module
from drivers.simulated.cell import _physics
from drivers.simulated.physics import RobotPhysics
from drivers.simulated.robot import SimulatedMachine
from hexacell.application.calibration_run import run_started
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, dump, load_cell
from hexacell.controller_config.toml_format import NativeToml
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS, Hexaglide
from hexacell.kinematics.pose import Pose
from hexacell.robot_model import robot_of
from hexacell.runs.run_folder import RunFolder
from procedures.calibration import workflow as calibration_module
from procedures.calibration.workflow import Calibration, Mode
from procedures.engine.engine import Engine, Listener
from procedures.engine.recovery import GIVE_UP, RecoveryPolicy
from procedures.engine.step_executor import StepExecutor
from procedures.journal.journal import Journal
from procedures.run import events
from procedures.run.questions import QuestionBroker
from tests.procedures.fakes import Approver, Bench


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
        self.physics: RobotPhysics = _physics(
            Hexaglide(), simulation, self.clock, NativeToml(HEXAGLIDE_PARAMETERS), config, home
        )
        self.machine = SimulatedMachine(
            Hexaglide(), NativeToml(HEXAGLIDE_PARAMETERS), config, self.physics, self.clock, home
        )
        for gauge in bench.gauges:
            gauge.shown = partial(self.physics.gauge_displacement, gauge.name)
        bench.encoders.shown = lambda: list(self.physics.encoder_positions())
        bench.controller.machine = self.machine
        self.calibration = Calibration(self.cell.settings, robot_of(self.cell), self.mode)
        self.performer = StepExecutor(
            self.cell, self.calibration, bench.devices, self.clock, self.operator, self.folder
        )

    @property
    def config(self) -> bytes:
        return self.cell.config_path.read_bytes()

    def started(self) -> events.RunStarted:
        return run_started(self.cell, self.calibration, ())

    async def run(self, *listeners: Listener, policy: RecoveryPolicy = GIVE_UP) -> events.Ended:
        """Begin, or go on where the folder's journal ends; ``engine`` is the one that does."""
        self.folder.path.mkdir(exist_ok=True)
        broker = QuestionBroker(self.performer.operator)
        performer = replace(self.performer, operator=broker)
        with Journal(self.folder.journal) as journal:
            engine = self.engine = Engine(performer, journal, listeners, broker=broker, policy=policy)
            if engine.state.started is None:
                engine.record(self.started())
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


def hurry(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(calibration_module, "CANDIDATES", 64)
    patch.setattr(calibration_module, "HELD_OUT_CANDIDATES", 128)
    patch.setattr(machine_module, "LINE_STEPS", 8)


def new_rig(folder: Path, mode: Mode = Mode.OPTIMISE, operator: Any = None, **changes: Any) -> Rig:
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
