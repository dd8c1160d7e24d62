"""The tests that every driver of encoders passes, against a twin of six encoders."""

import asyncio
import threading
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol

from drivers.conformance.suite import FAULTS, TWIN_SPEED, Suite, against_twin, failure, require_named
from drivers.encoders.bank import joint_variables
from drivers.interfaces import EncoderBank
from drivers.simulated.cell import encoder_bank
from drivers.simulated.served_device import Closeable
from hexacell.cell.devices import EncoderSettings
from hexacell.cell.simulation import FaultKind
from hexacell.clock import CellClock

POSITIONS = ((0.0,) * 6, (1.5, -2.25, 4.0, -0.5, 0.25, 3.0), (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0))
STEPS, STEP, PAUSE_S = 40, 0.05, 2e-4
FAULTY_LEG = 3


class EncoderTwin(Protocol):
    """Six simulated encoders: their address, where they stand, and their faults."""

    @property
    def settings(self) -> EncoderSettings:
        """The settings of the encoders, with the address at which the twin answers."""

    def stand_at(self, joints: Sequence[float]) -> None:
        """Move all joints at once, in the unit of the joint variables; from any thread."""

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        """Switch ``unplugged`` or ``silent`` of the encoder of leg 3, or of all, on or off."""


class EncoderConformance(Suite[EncoderBank, EncoderTwin]):
    """Subclass it in a test file, name it ``Test...``, and say what is tested.

    Attributes:
        tolerance: by how much a position may differ from where the twin stands: half a count.
        name: what the subject of every error names.
    """

    tolerance: float = 0.00051
    name: str = "encoder"

    @abstractmethod
    def driver(self, twin: EncoderTwin) -> EncoderBank:
        """The driver under test."""

    def _driver_of(self, twin: EncoderTwin) -> EncoderBank:
        return self.driver(twin)

    @against_twin
    async def test_they_read_where_the_joints_are(self, bank: EncoderBank, twin: EncoderTwin) -> None:
        assert len({identity.name for identity in await bank.open()}) == 6
        for joints in POSITIONS:
            twin.stand_at(joints)
            await self._require_at(bank, twin, joints)

    @against_twin
    async def test_raw_counts_give_the_positions(self, bank: EncoderBank, twin: EncoderTwin) -> None:
        twin.stand_at(POSITIONS[1])
        await bank.open()
        sample = await bank.read()
        assert all(isinstance(count, int) for count in sample.counts)
        assert sample.positions == joint_variables(sample.counts, twin.settings)

    @against_twin
    async def test_a_sample_is_of_one_instant(self, bank: EncoderBank, twin: EncoderTwin) -> None:
        """All joints move together: a sample of two instants differs in itself."""
        twin.stand_at((0.0,) * 6)
        await bank.open()
        with _moving(twin):
            for _ in range(STEPS):
                found = (await bank.read()).positions
                assert max(found) - min(found) <= 2 * self.tolerance, found

    @against_twin
    async def test_closing_twice_is_harmless(self, bank: EncoderBank, twin: EncoderTwin) -> None:
        await bank.close()
        await bank.open()
        await bank.close()
        await bank.close()
        require_named(await failure(bank.read), self.name)

    @against_twin
    async def test_they_reopen_after_a_fault_of_one(self, bank: EncoderBank, twin: EncoderTwin) -> None:
        for fault in FAULTS:
            await bank.open()
            twin.inject(fault, on=True)
            require_named(await failure(bank.read), self.name)
            twin.inject(fault, on=False)
            twin.stand_at(POSITIONS[1])
            await bank.close()
            await bank.open()
            await self._require_at(bank, twin, POSITIONS[1])

    @against_twin
    async def test_a_cancelled_read_leaves_them_in_step(self, bank: EncoderBank, twin: EncoderTwin) -> None:
        await bank.open()
        for joints in POSITIONS:
            given_up = asyncio.create_task(bank.read())
            await asyncio.sleep(0)
            given_up.cancel()
            await asyncio.gather(given_up, return_exceptions=True)
            twin.stand_at(joints)
            await self._require_at(bank, twin, joints)

    async def _require_at(self, bank: EncoderBank, twin: EncoderTwin, joints: Sequence[float]) -> None:
        sample = await bank.read()
        assert sample.unit == twin.settings.unit
        for found, joint in zip(sample.positions, joints, strict=True):
            assert abs(found - joint) <= self.tolerance, sample


@contextmanager
def _moving(twin: EncoderTwin) -> Iterator[None]:
    """All joints go to and fro together, in small steps, as long as the context lasts."""
    ended = threading.Event()

    def move() -> None:
        step = 0
        while not ended.wait(PAUSE_S):
            step = (step + 1) % STEPS
            twin.stand_at((STEP * min(step, STEPS - step),) * 6)

    mover = threading.Thread(target=move)
    mover.start()
    try:
        yield
    finally:
        ended.set()
        mover.join()


class served_encoder_twin(Closeable):  # noqa: N801
    """Six simulated encoders in this process, CiA 406 or what the settings describe.

    They stand where they are put.
    """

    def __init__(self, settings: EncoderSettings) -> None:
        self._joints: Sequence[float] = (0.0,) * 6
        self._bank = encoder_bank(settings, lambda: self._joints, CellClock(TWIN_SPEED))
        self.settings = settings.model_copy(update=self._bank.address)

    def stand_at(self, joints: Sequence[float]) -> None:
        """Move all joints at once, in the unit of the joint variables."""
        self._joints = tuple(joints)

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        """Switch a fault of leg 3 on or off."""
        self._bank.faults(FAULTY_LEG)[fault](on=on)

    def close(self) -> None:
        self._bank.close()
