"""Our own encoders and controller pass what every driver of such a device must."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from drivers import conformance
from drivers.controllers.adapter.controller import AdapterController
from drivers.controllers.adapter.link import Timeouts as AdapterTimeouts
from drivers.controllers.adapter.options import AdapterOptions
from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.encoders.cia406 import Cia406Bank
from drivers.encoders.dbc import DbcBank
from drivers.encoders.modbus import ModbusBank
from drivers.encoders.of_controller import ControllerScales
from drivers.interfaces import Controller, DeviceIdentity, EncoderBank, EncoderSample, StartupAction
from drivers.simulated.adapter import SimulatedAdapter
from drivers.simulated.linuxcnc.server import SimulatedController
from drivers.simulated.served_device import setting
from hexacell.cell.devices import EncoderSettings, LinearEncoderSettings
from hexacell.cell.robot import ControllerSettings
from hexacell.cell.simulation import FaultKind
from hexacell.kinematics.pose import Pose
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


LEAST_S = 0.01
HASTY = replace(QUICK, answer=0.5)


class MachineInTime(FakeMachine):
    """Its moves last as long as they are told to."""

    def move(self, pose: Pose, duration_s: float | None) -> None:
        self.duration_s = duration_s or LEAST_S
        super().move(pose, duration_s)

    def home(self) -> None:
        self.duration_s = LEAST_S
        super().home()


class LinuxcncTwin:
    """The simulated LinuxCNC."""

    target = Pose(100.0, -200.0, 550.0, 12.5, -3.0, 8.0)
    out_of_reach = Pose(0.0, 0.0, 2000.0)

    def __init__(self, server: SimulatedController) -> None:
        self.settings = ControllerSettings(config="machine.ini", port=server.port)
        self._server = server

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        match fault:
            case "unplugged":
                self._server.set_unplugged(on=on)
            case "silent":
                self._server.is_silent = on
            case _:
                self._server.state.set_estop(on=on)


class AdapterTwin(LinuxcncTwin):
    """The simulated controller behind the adapter protocol."""

    def __init__(self, server: SimulatedAdapter) -> None:
        super().__init__(server)
        options = AdapterOptions(address=f"127.0.0.1:{server.port}")
        self.settings = ControllerSettings(config="machine.toml", protocol="adapter", options=options)


class TestAdapter(conformance.ControllerConformance):
    def driver(self, settings: ControllerSettings) -> Controller:
        return AdapterController(settings, timeouts=AdapterTimeouts(connect=0.5, answer=0.5))

    @contextmanager
    def twin(self) -> Iterator[conformance.ControllerTwin]:
        with SimulatedAdapter(MachineInTime(), ControllerSettings(config="machine.toml")) as server:
            yield AdapterTwin(server)


class TestLinuxcncrsh(conformance.ControllerConformance):
    def driver(self, settings: ControllerSettings) -> Controller:
        return LinuxcncrshController(settings, timeouts=HASTY)

    @contextmanager
    def twin(self) -> Iterator[conformance.ControllerTwin]:
        with SimulatedController(MachineInTime(), ControllerSettings(config="machine.ini")) as server:
            yield LinuxcncTwin(server)
