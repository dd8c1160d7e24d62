"""A day of polling with random faults, in simulated time: is each told, a record wrong, does anything leak?

Every half second three gauges and six encoders are read; five readings and a comparison of the gauges'
settings are a record. Faults begin in the middle of a record, last for some records and end; devices that
failed are opened again, as a run does. Faults that no driver can see by itself (docs/device-faults.md) are
left out.
"""

from __future__ import annotations

import gc
import logging
import os
import threading
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import numpy as np

from hexacell.errors import DeviceError, HexacellError, flatten_errors
from procedures.devices.device_set import gather_errors
from procedures.devices.settling import trimmed_mean
from tests.benchmarks.faulty_cell import Fault, FaultyCell
from tests.benchmarks.figures import NEVER, at_most
from tests.benchmarks.samples import sample

HOURS = sample(__name__, "HOURS")
POLL_S = 0.5
READINGS = 5
QUIET_RECORDS = 60
"""At most so many records between two faults."""

FAULTY_RECORDS = 6
"""So many records a fault lasts: warnings of encoders are read at each tenth sample only."""

WRONG_MM = 0.01
LOOP_THREADS = "asyncio_"
"""The event loop's own, of which it keeps up to a handful."""

MEMORY_MIB = 8.0


@dataclass
class Outcome:
    """What came of it; faults by name."""

    records: int = 0
    wrong: int = 0
    injected: int = 0
    untold: Counter[str] = field(default_factory=Counter)
    false_alarms: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True)
class Resources:
    """What a leak would use up."""

    memory_mib: float
    threads: int
    descriptors: int

    @classmethod
    def now(cls) -> Resources:
        gc.collect()
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        memory = pages * os.sysconf("SC_PAGE_SIZE") / 2**20
        threads = [one for one in threading.enumerate() if not one.name.startswith(LOOP_THREADS)]
        return cls(memory, len(threads), len(list(Path("/proc/self/fd").iterdir())))


class Day:
    """Records one after the other, and faults in between."""

    def __init__(self, cell: FaultyCell, random: Random) -> None:
        self.outcome = Outcome()
        self._cell = cell
        self._random = random
        self._faults = cell.faults()
        self._joints = [0.0] * 6

    async def go_on(self) -> None:
        """Some records without a fault, and some with one."""
        outcome, fault = self.outcome, self._random.choice(self._faults)
        for _ in range(self._random.randint(1, QUIET_RECORDS)):
            if (error := await self._record()) is not None:
                outcome.false_alarms[error] += 1
        outcome.injected += 1
        told = [await self._record(fault)]
        while len(told) < FAULTY_RECORDS and not (fault.ends_when_told and any(told)):
            told.append(await self._record())
        fault.switch(False)
        if fault.is_seen and not any(told):
            outcome.untold[fault.name] += 1
        await self._cell.open()

    async def _record(self, fault: Fault | None = None) -> str | None:
        """Take one, during which ``fault`` begins; the kinds of errors it ended with, if any."""
        self._move()
        begins_after = self._random.randrange(READINGS)
        try:
            values, joints, devices = [], [], self._cell.devices
            for number in range(READINGS):
                self._cell.pass_by(POLL_S)
                gauges = [devices.read_gauge(one.gauge) for one in devices.gauges]
                shown = await gather_errors("gauges cannot be read", gauges)
                values.append([one.value_mm for one in shown])
                joints.append((await devices.read_encoders()).positions)
                if fault is not None and number == begins_after:
                    fault.switch(True)
            for mounted in devices.gauges:
                await mounted.gauge.check()
        except HexacellError as error:
            return await self._refused(error)
        self._compare(np.array(values), np.array(joints))
        return None

    async def _refused(self, error: HexacellError) -> str:
        """Open again what failed, which a fault may prevent; all errors are those of devices."""
        kinds = [type(one).__name__ for one in flatten_errors(error) if isinstance(one, DeviceError)]
        assert len(kinds) == len(flatten_errors(error)), error
        try:
            await self._cell.open()
        except DeviceError as again:
            kinds.append(type(again).__name__)
        return ", ".join(sorted(set(kinds)))

    def _compare(self, values: np.ndarray, joints: np.ndarray) -> None:
        self.outcome.records += 1
        errors = np.abs(trimmed_mean(values) - self._cell.plungers_mm)
        of_joints = np.abs(trimmed_mean(joints) - self._cell.joints_mm)
        if max(errors.max(), of_joints.max()) > WRONG_MM:
            self.outcome.wrong += 1
            print(f"wrong: {errors.round(3)} {of_joints.round(3)}")

    def _move(self) -> None:
        """To another place, at the speed of joints."""
        random = self._random
        plungers = [round(random.uniform(1.0, 4.0) * random.choice((1, -1)), 3) for _ in range(3)]
        self._joints = [round(joint + random.uniform(-0.4, 0.4), 3) for joint in self._joints]
        self._cell.stand_at(plungers, self._joints)


async def test_a_day_of_polling_with_random_faults(figure, monkeypatch, caplog) -> None:
    caplog.set_level(logging.CRITICAL, logger="drivers")  # pytest keeps all that is logged
    cell = FaultyCell(monkeypatch)
    day = Day(cell, Random(24))
    await cell.open()
    before, told = None, 0
    while (hours := cell.elapsed_s / 3600) < HOURS:
        await day.go_on()
        if hours >= told + 1:
            told = int(hours)
            print(f"\n{told} h: {day.outcome}", flush=True)
        if before is None and hours > HOURS / 4:
            before = Resources.now()
    after, outcome = Resources.now(), day.outcome
    await cell.close()
    assert before is not None
    figure("simulated hours", hours)
    figure("records", outcome.records)
    figure("  wrong", outcome.wrong, "", NEVER)
    figure("faults", outcome.injected)
    figure("  not told", sum(outcome.untold.values()), "", NEVER)
    figure("errors without a fault", sum(outcome.false_alarms.values()), "", NEVER)
    grown = after.memory_mib - before.memory_mib
    figure("memory grown in the last three quarters", grown, "MiB", at_most(MEMORY_MIB))
    figure("threads more", after.threads - before.threads, "", at_most(0))
    figure("descriptors more", after.descriptors - before.descriptors, "", at_most(0))
    assert not outcome.untold
    assert not outcome.false_alarms
