"""Encoders on a virtual bus, and a DBC file that describes them."""

import uuid
from pathlib import Path
from typing import Any

import can
import pytest

from drivers.encoders.dbc import DbcBank
from drivers.simulated.encoders.bank import SimulatedDbcBank
from hexacell.cell.devices import LinearEncoderSettings

TIMEOUT_S = 0.4
FIRST_ID = 0x201
HEAD = 'VERSION ""\nBU_: ENC PC\n'
MESSAGE = (
    'BO_ {id} ENC{leg}: 6 ENC\n SG_ Position : 0|32@1- (0.0005,0) [-2000|2000] "{unit}" PC\n'
    ' SG_ Error : 32|8@1+ (1,0) [0|255] "" PC\n'
)
SIGNALS = tuple(f"ENC{leg}.Position" for leg in range(1, 7))


def dbc_text(unit: str = "mm") -> str:
    return HEAD + "".join(MESSAGE.format(id=FIRST_ID + leg, leg=leg + 1, unit=unit) for leg in range(6))


@pytest.fixture
def dbc_file(tmp_path: Path) -> Path:
    path = tmp_path / "encoders.dbc"
    path.write_text(dbc_text())
    return path


@pytest.fixture
def settings(dbc_file: Path):
    """Settings of the bank, with other keys of its section ``dbc``."""

    def make(bus: dict[str, Any] | None = None, **changes: Any) -> LinearEncoderSettings:
        dbc = {"file": str(dbc_file), "signals": SIGNALS, "delay_s": 0.0, **changes}
        return LinearEncoderSettings.model_validate(
            {"protocol": "dbc", "timeout_s": TIMEOUT_S, "measuring_step_nm": 500, "bus": bus, "dbc": dbc}
        )

    return make


class Simulated:
    """Six simulated encoders and their driver."""

    def __init__(self, settings: LinearEncoderSettings) -> None:
        self.positions = [10.0 * leg for leg in range(1, 7)]
        assert settings.dbc is not None
        self.bank = SimulatedDbcBank(settings, settings.dbc, lambda: self.positions)
        bus = {"bus": self.bank.bus_settings, "largest_speed": 1.0}
        self.driver = DbcBank(settings.model_copy(update=bus))


@pytest.fixture
async def simulated(settings):
    """Makes simulated encoders with a driver, by changes of the section ``dbc``."""
    made = []

    def make(**changes: Any) -> Simulated:
        made.append(Simulated(settings(**changes)))
        return made[-1]

    yield make
    for one in made:
        await one.driver.close()
        one.bank.close()


class Wire:
    """The other end of the bus: sends what a test says."""

    def __init__(self) -> None:
        channel = f"dbc-{uuid.uuid4().hex}"
        self.settings: dict[str, Any] = {"interface": "virtual", "channel": channel}
        self._bus = can.Bus(**self.settings)

    def send(self, frame_id: int, data: bytes, *, extended: bool = False) -> None:
        self._bus.send(can.Message(arbitration_id=frame_id, data=data, is_extended_id=extended))

    def send_all(self, positions: tuple[float, ...], *, without: int = 0, length: int = 6) -> None:
        for leg, position in enumerate(positions, 1):
            if leg != without:
                data = round(position / 0.0005).to_bytes(4, "little", signed=True) + b"\0\0"
                self.send(FIRST_ID + leg - 1, data[:length])

    def received(self, timeout_s: float) -> can.Message | None:
        return self._bus.recv(timeout_s)

    def close(self) -> None:
        self._bus.shutdown()


@pytest.fixture
def wire():
    wire = Wire()
    yield wire
    wire.close()
