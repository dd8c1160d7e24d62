"""A controller by the adapter protocol: what no fault leads to, and what a move costs over linuxcncrsh."""

import asyncio
import random
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

from drivers.controllers.adapter.controller import AdapterController
from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.interfaces import Controller, StartupAction
from drivers.simulated.linuxcnc.server import SimulatedController
from hexacell.cell.robot import ControllerSettings
from hexacell.kinematics.pose import Pose
from tests.benchmarks.figures import NEVER, Figures, at_most
from tests.benchmarks.samples import sample
from tests.drivers.conformance.test_controllers import MachineInTime
from tests.drivers.controllers.adapter.faulty import EVERY, driver, whole_job
from tests.drivers.controllers.adapter.test_conformance import EXAMPLES, settings_of

FAULTS = sample(__name__, "FAULTS")
AT_ONCE = 4
MOVES, MOVE_S = 50, 0.05


def test_random_faults(tmp_path: Path, figure: Figures) -> None:
    """Each is either without an effect, or named, with the robot at rest until it is prepared again."""
    unsafe: list[str] = []
    named = 0

    async def one(seed: int, free: asyncio.Semaphore) -> None:
        nonlocal named
        drawn = random.Random(seed)
        (fault, at), nth, log = drawn.choice(EVERY), drawn.choice([1, 1, 2, 3]), tmp_path / str(seed)
        async with free:
            try:
                found = await whole_job(driver(log, fault, at, nth), log)
                named += found is not None
            except Exception as error:  # whatever it is, it is no error of a device
                unsafe.append(f"{fault} at {at} {nth}: {error!r}")

    async def every() -> None:
        free = asyncio.Semaphore(AT_ONCE)
        await asyncio.gather(*(one(seed, free) for seed in range(FAULTS)))

    asyncio.run(every())
    print("\n".join(unsafe))
    figure(
        f"random faults of the program, {FAULTS}: unsafe, not named, or no error of a device",
        len(unsafe),
        "",
        NEVER,
    )
    figure("of these end the job, with the fault named", named)


def test_what_a_move_costs(figure: Figures) -> None:
    """Over linuxcncrsh, by the example program, before the same simulated LinuxCNC."""

    async def taken_s(made: Callable[[], Controller]) -> float:
        controller = made()
        await controller.open()
        await controller.prepare(frozenset(StartupAction))
        taken = []
        for number in range(MOVES):
            begun = time.perf_counter()
            await controller.move(Pose(100.0 * (number % 2), -200.0, 550.0), MOVE_S)
            taken.append(time.perf_counter() - begun)
        await controller.close()
        return median(taken)

    with SimulatedController(MachineInTime(), ControllerSettings(config="machine.ini")) as server:
        at = {"port": server.port}
        command = (sys.executable, str(EXAMPLES / "robot.py"))
        by_adapter = settings_of(command=command).model_copy(update=at)
        by_shell = ControllerSettings(config="machine.ini", port=server.port)
        shell = asyncio.run(taken_s(lambda: LinuxcncrshController(by_shell)))
        adapter = asyncio.run(taken_s(lambda: AdapterController(by_adapter)))
    figure("a move by the adapter, over linuxcncrsh's", 1e3 * (adapter - shell), "ms", at_most(20.0))
