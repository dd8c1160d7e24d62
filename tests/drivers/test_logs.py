"""What drivers log: connections, refusals and time-outs by device, and all bytes at DEBUG."""

from __future__ import annotations

import logging

import pytest

from drivers.conformance import served_encoder_twin, served_twin
from drivers.encoders.cia406 import Cia406Bank
from drivers.errors import GaugeSilent, SilentNodeError
from drivers.gauges.sylvac import SylvacGauge
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings, LinearEncoderSettings


def logged(caplog: pytest.LogCaptureFixture, name: str) -> list[tuple[str, str]]:
    return [(one.levelname, one.getMessage()) for one in caplog.records if one.name == name]


async def test_a_gauge_logs_under_its_name_and_its_bytes_at_debug(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, "drivers")
    ports = SharedSerialPorts(worst_latency_s=0.1)
    with served_twin(GaugeSettings(name="y", axis="y", protocol="sylvac")) as twin:
        gauge = SylvacGauge(twin.settings, ports)
        await gauge.open()
        twin.inject("silent", on=True)
        with pytest.raises(GaugeSilent):
            await gauge.read_once()
        await gauge.close()
    assert logged(caplog, "drivers.gauges.y") == [
        ("INFO", f"opened on port {twin.settings.port}: SY276"),
        ("WARNING", r"no answer to b'?\r' within 0.5 s"),
    ]
    [first, *_] = logged(caplog, "drivers.wire")
    assert first[0] == "DEBUG"
    assert first[1].endswith("> 55 4e 49 3f 0d  UNI?.")


async def test_encoders_log_openings_and_missing_samples(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "drivers")
    settings = LinearEncoderSettings(bus={}, timeout_s=0.2, heartbeat_ms=0)
    with served_encoder_twin(settings) as twin:
        bank = Cia406Bank(twin.settings)
        await bank.open()
        twin.inject("silent", on=True)
        with pytest.raises(SilentNodeError):
            await bank.read()
        await bank.close()
    levels = [(level, text.split(":")[0]) for level, text in logged(caplog, "drivers.encoders")]
    assert levels == [("INFO", "opened"), ("WARNING", "no sample")]
    assert logged(caplog, "drivers.wire") == []
