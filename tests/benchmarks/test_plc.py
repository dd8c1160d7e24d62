"""Faults of a PLC at random moments, and how much longer than by linuxcncrsh a move takes by OPC UA."""

import asyncio
import re
import time
from collections import Counter
from collections.abc import Iterator
from random import Random
from statistics import median

import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.controllers.opcua.controller import OpcUaController
from drivers.interfaces import Controller
from drivers.simulated.linuxcnc.server import SimulatedController
from hexacell.cell.robot import ControllerSettings
from tests.benchmarks.figures import at_most
from tests.benchmarks.samples import sample
from tests.drivers.conformance.test_controllers import MachineInTime
from tests.drivers.controllers.opcua.faults import FAULTS, moved_in_spite_of, repair
from tests.drivers.controllers.opcua.plc import PlcServer
from tests.drivers.controllers.opcua.test_controller import ALL, PlcTwin, settings_of

FAULTY, MOVES = sample(__name__, "FAULTY"), sample(__name__, "MOVES")
MOVE_S = 0.05


@pytest.fixture
def plc() -> Iterator[PlcServer]:
    with PlcServer(MachineInTime()) as server:
        yield server


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_no_fault_is_silent_or_unsafe(plc: PlcServer, figure) -> None:
    random, told, failures = Random(41), Counter[str](), 0
    for _ in range(FAULTY):
        fault = random.choice(FAULTS)
        plc.restart(MachineInTime())
        duration_s = random.uniform(0.02, 0.3)
        try:
            words = moved_in_spite_of(plc, fault, duration_s, random.uniform(0.0, 1.2 * duration_s))
        except Exception as error:  # whatever it is, it is no answer
            failures, words = failures + 1, repr(error)
            repair(plc)
        told[f"{fault.name}: {re.sub(r'-?[0-9]+', '#', words)[:60] or 'done before'}"] += 1
    for words, count in sorted(told.items()):
        print(f"{count:5} {words}")
    figure("faults of a PLC that are silent, unsafe or no answer", failures, f"of {FAULTY}", at_most(0))


async def _beyond_ms(controller: Controller) -> float:
    """How much longer a move takes than it was told to, ms."""
    await controller.open()
    await controller.prepare(ALL)
    found = await controller.position()
    assert found is not None
    taken = []
    for number in range(MOVES):
        begun_s = time.monotonic()
        await controller.move(found.pose if number % 2 else PlcTwin.target, MOVE_S)
        taken.append(time.monotonic() - begun_s - MOVE_S)
    await controller.close()
    return 1e3 * median(taken)


def test_a_move_takes_hardly_longer_than_by_linuxcncrsh(plc: PlcServer, figure) -> None:
    by_plc = asyncio.run(_beyond_ms(OpcUaController(settings_of(plc.options))))
    settings = ControllerSettings(config="machine.ini")
    with SimulatedController(MachineInTime(), settings) as linuxcnc:
        addressed = settings.model_copy(update={"port": linuxcnc.port})
        by_linuxcnc = asyncio.run(_beyond_ms(LinuxcncrshController(addressed)))
    figure("a move by OPC UA, beyond one by linuxcncrsh", by_plc - by_linuxcnc, "ms", at_most(50.0))
    figure("a move by OPC UA, beyond its duration", by_plc, "ms")
