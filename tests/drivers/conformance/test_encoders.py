"""Our own encoders pass what every driver of encoders must."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from drivers import conformance
from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.encoders.cia406 import Cia406Bank
from drivers.encoders.dbc import DbcBank
from drivers.encoders.modbus import ModbusBank
from drivers.encoders.of_controller import ControllerScales
from drivers.interfaces import DeviceIdentity, EncoderBank, EncoderSample, StartupAction
from drivers.simulated.linuxcnc.server import SimulatedController
from drivers.simulated.served_device import setting
from hexacell.cell.devices import EncoderSettings, LinearEncoderSettings
from hexacell.cell.robot import ControllerSettings
from hexacell.cell.simulation import FaultKind
from tests.drivers.encoders.dbc.conftest import SIGNALS, dbc_text
from tests.drivers.simulated.linuxcnc.conftest import QUICK, FakeMachine

TIMEOUT_S = 3.0
CAN_TIMEOUT_S = 1.5


class Cia406(conformance.EncoderConformance):
    settings: EncoderSettings

    def driver(self, twin: conformance.EncoderTwin) -> EncoderBank:
        return Cia406Bank(twin.settings)

    def twin(self) -> AbstractContextManager[conformance.EncoderTwin]:
        return conformance.served_encoder_twin(self.settings)


class TestLinear(Cia406):
    settings = LinearEncoderSettings(timeout_s=CAN_TIMEOUT_S, heartbeat_ms=5000)


class MachineThatStands(FakeMachine):
    """Its joints are where they are put."""

    def stand_at(self, joints: Sequence[float]) -> None:
        with self._lock:
            self._joints = tuple(joints)


class ScalesTwin:
    """The scales of a simulated LinuxCNC."""

    def __init__(self, machine: MachineThatStands, server: SimulatedController) -> None:
        self.stand_at = machine.stand_at
        self.port = server.port
        self.settings = LinearEncoderSettings(protocol="controller", measuring_step_nm=1000)
        self._server = server

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        switch = {"unplugged": self._server.set_unplugged, "silent": setting(self._server, "is_silent")}
        switch[fault](on=on)


class WithItsController:
    """Encoders that are opened and closed with the controller that has their scales."""

    def __init__(self, twin: ScalesTwin) -> None:
        settings = ControllerSettings(config="machine.ini", port=twin.port)
        self._controller = LinuxcncrshController(settings, timeouts=replace(QUICK, answer=0.5))
        self._scales = ControllerScales(twin.settings, self._controller)

    async def open(self) -> tuple[DeviceIdentity, ...]:
        await self._controller.open()
        await self._controller.prepare(frozenset(StartupAction))
        return await self._scales.open()

    async def read(self) -> EncoderSample:
        return await self._scales.read()

    async def close(self) -> None:
        await self._scales.close()
        await self._controller.close()


class TestScalesOfAController(conformance.EncoderConformance):
    name = "controller"

    def driver(self, twin: conformance.EncoderTwin) -> EncoderBank:
        assert isinstance(twin, ScalesTwin)
        return WithItsController(twin)

    @contextmanager
    def twin(self) -> Iterator[conformance.EncoderTwin]:
        machine = MachineThatStands()
        with SimulatedController(machine, ControllerSettings(config="machine.ini")) as server:
            yield ScalesTwin(machine, server)


class TestByDbcFile(conformance.EncoderConformance):
    def driver(self, twin: conformance.EncoderTwin) -> EncoderBank:
        return DbcBank(twin.settings)

    @contextmanager
    def twin(self) -> Iterator[conformance.EncoderTwin]:
        with TemporaryDirectory() as folder:
            (Path(folder) / "encoders.dbc").write_text(dbc_text())
            described = {"file": f"{folder}/encoders.dbc", "signals": SIGNALS, "request": "080#"}
            with conformance.served_encoder_twin(
                LinearEncoderSettings.model_validate(
                    {"protocol": "dbc", "timeout_s": TIMEOUT_S, "measuring_step_nm": 500, "dbc": described}
                )
            ) as twin:
                yield twin


class TestModbusOfOneDevice(conformance.EncoderConformance):
    modbus: Mapping[str, object] = {"registers": (0, 2, 4, 6, 8, 10)}

    def driver(self, twin: conformance.EncoderTwin) -> EncoderBank:
        return ModbusBank(twin.settings)

    def twin(self) -> AbstractContextManager[conformance.EncoderTwin]:
        stated = {"protocol": "modbus", "timeout_s": TIMEOUT_S, "modbus": self.modbus}
        return conformance.served_encoder_twin(LinearEncoderSettings.model_validate(stated))


class TestModbusOfSixDevicesThatLatch(TestModbusOfOneDevice):
    modbus: Mapping[str, object] = {
        "registers": (0,) * 6,
        "devices": (1, 2, 3, 4, 5, 6),
        "latch": {"register": 9, "delay_s": 0.0},
    }


def test_samples_of_two_instants_are_found() -> None:
    """A driver that reads one encoder after the other fails, although each of its positions is right."""

    class OneAfterTheOther(Cia406Bank):
        async def read(self) -> EncoderSample:
            first, then = await super().read(), await super().read()
            return EncoderSample(
                (*first.counts[:3], *then.counts[3:]), (*first.positions[:3], *then.positions[3:])
            )

    class Conformance(TestLinear):
        def driver(self, twin: conformance.EncoderTwin) -> EncoderBank:
            return OneAfterTheOther(twin.settings)

    with pytest.raises(AssertionError):
        Conformance().test_a_sample_is_of_one_instant()
