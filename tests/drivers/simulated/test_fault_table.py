"""Every fault of every device, what becomes of it, and what is told: the table in docs/device-faults.md.

``HEXACELL_UPDATE_TABLES=1`` writes the table anew; a difference is then to be looked at before it is kept.
"""

from __future__ import annotations

import asyncio
import math
import os
import re
from collections.abc import Awaitable, Callable, Coroutine
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.encoders.cia406 import Cia406Bank
from drivers.encoders.dbc import DbcBank
from drivers.encoders.modbus import ModbusBank
from drivers.encoders.node_monitor import AlarmTiming
from drivers.simulated.encoders.bank import SimulatedEncoderBank
from drivers.simulated.encoders.dbc_bank import SimulatedDbcBank
from drivers.simulated.encoders.modbus_bank import SimulatedModbusBank
from drivers.simulated.gauges.bank import SimulatedGaugeBank
from hexacell.cell.described_devices import DbcSettings, ModbusEncoderSettings
from hexacell.cell.devices import LinearEncoderSettings
from hexacell.cell.simulation import FaultKind
from hexacell.clock import CellClock
from hexacell.errors import HexacellError
from procedures.devices.settling import trimmed_mean
from tests.drivers.encoders.dbc.conftest import SIGNALS, dbc_text
from tests.drivers.simulated.gauges.served.cell import MORE_DRIVERS, PROTOCOLS, Cell

TABLE = Path(__file__).parents[3] / "docs" / "device-faults.md"
BEGIN = "<!-- made by tests/drivers/simulated/test_fault_table.py -->\n"
BEFORE_MM, AFTER_MM = 1.0, 1.5
ENCODER_BEFORE_MM, ENCODER_AFTER_MM = 30.0, 30.5
SLOW = {"timeout_s": 1.0, "largest_speed_mm_s": 1e-3}
"""What is a jump must not depend on how fast this machine takes two samples."""
READINGS = 5
ENCODER_READINGS = 50
AT_ONCE = 4
DBC_FAULTS: tuple[FaultKind, ...] = ("silent", "alarm", "frozen", "jumped")
MODBUS_FAULTS: tuple[FaultKind, ...] = (
    "unplugged",
    "silent",
    "alarm",
    "frozen",
    "jumped",
    "reversed",
    "zeroed",
    "damaged",
    "cut short",
    "repeated",
    "unasked",
    "late",
    "echoing",
    "NUL bytes",
)
INVALID = 0x7FFFFFFF
FAST = 100.0
NOT_DUE = {("uwave", "late"), ("stream", "late")}
"""What comes unasked is due at no time: such a line pauses once, and what is told depends on when."""

TIMEOUTS_S = {"uwave": 4.0, "stream": 4.0}
"""Longer than a busy machine keeps the thread waiting that sends unasked; an answer is waited for 1 s."""

RIGHT_MM = 0.0051
"""Five readings whose neighbours agree within 0.005 mm cannot err by more, where damage is seldom."""

BEYOND_ONE_DEVICE = {
    "exchanged": "the gauge trial",
    "reversed": "the gauge trial",
    "frozen": "the gauge trial; encoders: the guard `following`",
    "off its plate": "the guard `ball off the plate`",
    "off its middle": "the room that is left, before anything is measured",
    "zeroed": "the reference, when it is measured again",
    "on hold": "the gauge trial",
    "in peak mode": "the gauge trial",
    "jumped": "the guard `following`, and the driver where it was quick",
    "switched on again": "the reference, when it is measured again",
}
"""What sees a fault that one device alone does not show."""

WHERE_THE_UNIT_IS_UNTOLD = {"in inches": "the gauge trial"}
"""Of a gauge that does not tell its unit, and shows as many decimals in inches."""

Row = tuple[str, str, str, str]


def plain(error: HexacellError) -> str:
    """A message without what differs from run to run."""
    words = re.sub(r"ASRL\S+::INSTR", "PORT", str(error))
    words = re.sub(r"b'[^']*\\x[^']*'", "BYTES", words)
    words = re.sub(r"(?<!\w)/[\w/.-]*\w", "PORT", words)
    words = re.sub(r" in \S+ s;", " in # s;", words)
    return re.sub(r"[+-]?\d+\.\d+", "#", words)


async def told(call: Callable[[], Awaitable[Any]]) -> HexacellError | None:
    try:
        await call()
    except HexacellError as error:
        return error
    return None


def row(device: str, fault: str, error: HexacellError | None, *, is_right: bool) -> Row:
    if error is not None:
        return device, fault, f"`{type(error).__name__}`", plain(error)
    if is_right and fault not in BEYOND_ONE_DEVICE:
        return device, fault, "reads right", ""
    seen_by = (BEYOND_ONE_DEVICE | WHERE_THE_UNIT_IS_UNTOLD)[fault]
    return device, fault, "not by itself", f"seen by {seen_by}"


async def gauge_row(protocol: str, fault: FaultKind) -> Row:
    cell = Cell([protocol] * 3, timeout_s=TIMEOUTS_S.get(protocol, 1.0), flicker_mm=0.0)
    gauge = cell.gauges["x"]
    gauge._history.agreement_mm = 0.005
    cell.balls["x"] = BEFORE_MM
    try:
        await gauge.open()
        await gauge.read()
        cell.rack.faults("x")[fault](on=True)
        cell.balls["x"] = AFTER_MM
        values: list[float] = []

        async def read_often() -> None:
            for _ in range(READINGS):
                values.append((await gauge.read()).value_mm)

        error = await told(read_often) or await told(gauge.check)
        shown = float(trimmed_mean(np.array([values]).T)[0]) if len(values) == READINGS else np.nan
        return row(f"gauge, {protocol}", fault, error, is_right=abs(shown - AFTER_MM) < RIGHT_MM)
    finally:
        await cell.links.close()
        cell.rack.close()


async def encoder_row(fault: FaultKind) -> Row:
    settings = LinearEncoderSettings.model_validate({**SLOW, "heartbeat_ms": 5000})
    at = [ENCODER_BEFORE_MM]
    simulated = SimulatedEncoderBank(settings, lambda: at * 6, CellClock(1.0))
    bank = Cia406Bank(settings.model_copy(update={"bus": simulated.bus_settings}))
    try:
        await bank.open()
        await bank.read()
        simulated.faults(3)[fault](on=True)
        at[0] = ENCODER_AFTER_MM
        found: list[float] = []

        async def read_often() -> None:
            while len(found) < ENCODER_READINGS:
                found.append((await bank.read()).positions[2])

        error = await told(read_often)
        is_right = bool(found) and abs(found[-1] - ENCODER_AFTER_MM) < RIGHT_MM
        return row("encoders, cia406", fault, error or await told(bank.open), is_right=is_right)
    finally:
        await bank.close()
        simulated.close()


async def dbc_row(fault: FaultKind, folder: Path) -> Row:
    file = folder / "encoders.dbc"
    file.write_text(dbc_text())
    described = DbcSettings(file=str(file), signals=SIGNALS, delay_s=0.0, must_be={"Error": 0})
    settings = LinearEncoderSettings.model_validate(
        {**SLOW, "protocol": "dbc", "measuring_step_nm": 500, "dbc": described}
    )
    at = [0.0]
    simulated = SimulatedDbcBank(settings, described, lambda: at * 6)
    bank = DbcBank(settings.model_copy(update={"bus": simulated.bus_settings}))
    try:
        await bank.open()
        await bank.read()
        simulated.faults(3)[fault](on=True)
        at[0] = 0.5
        error = await told(bank.read)
        return row("encoders, dbc", fault, error, is_right=False)
    finally:
        await bank.close()
        simulated.close()


async def modbus_row(fault: FaultKind) -> Row:
    described = ModbusEncoderSettings(registers=(0, 2, 4, 6, 8, 10), invalid=(INVALID,))
    settings = LinearEncoderSettings.model_validate({**SLOW, "protocol": "modbus", "modbus": described})
    at = [ENCODER_BEFORE_MM]
    simulated = SimulatedModbusBank(settings, described, lambda: at * 6, CellClock(FAST))
    bank = ModbusBank(settings.model_copy(update={"modbus": simulated.described}))
    try:
        await bank.open()
        await bank.read()
        simulated.faults(3)[fault](on=True)
        at[0] = ENCODER_AFTER_MM
        found: list[float] = []

        async def read_often() -> None:
            while len(found) < READINGS:
                found.append((await bank.read()).positions[2])

        error = await told(read_often)
        is_right = bool(found) and abs(found[-1] - ENCODER_AFTER_MM) < RIGHT_MM
        return row("encoders, modbus", fault, error, is_right=is_right)
    finally:
        await bank.close()
        simulated.close()


async def rows(folder: Path) -> list[Row]:
    gauges = _kinds(lambda: Cell(["sylvac"] * 3).rack, "x")
    encoders = list(SimulatedEncoderBank.faults(_a_bank(), 1))
    devices = (*PROTOCOLS, *MORE_DRIVERS)
    pairs = [(protocol, fault) for fault in gauges for protocol in devices]
    found = await _a_few_at_once([gauge_row(*pair) for pair in pairs if pair not in NOT_DUE])
    found += [await encoder_row(fault) for fault in encoders]
    found += [await dbc_row(fault, folder) for fault in DBC_FAULTS]
    return found + await _a_few_at_once([modbus_row(fault) for fault in MODBUS_FAULTS])


async def _a_few_at_once(rows: list[Coroutine[Any, Any, Row]]) -> list[Row]:
    """Most of their time they wait for what does not come."""
    room = asyncio.Semaphore(AT_ONCE)

    async def one(row: Coroutine[Any, Any, Row]) -> Row:
        async with room:
            return await row

    return await asyncio.gather(*map(one, rows))


def _kinds(make: Callable[[], SimulatedGaugeBank], name: str) -> list[FaultKind]:
    bank = make()
    bank.close()
    return sorted(bank.faults(name))


def _a_bank() -> SimulatedEncoderBank:
    bank = SimulatedEncoderBank(LinearEncoderSettings(), lambda: [0.0] * 6, CellClock(1.0))
    bank.close()
    return bank


def table(found: list[Row]) -> str:
    lines = ["| device | fault | seen by its driver as | what is told |", "|---|---|---|---|"]
    return "\n".join([*lines, *(f"| {' | '.join(one)} |" for one in found), ""])


@pytest.mark.timeout(300)
async def test_every_fault_is_seen_or_harmless_as_the_table_says(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(Cia406Bank, "alarm_timing", AlarmTiming(0.0, math.inf, 1))
    made = table(await rows(tmp_path))
    with capsys.disabled():
        print(f"\n{made}")
    head, _, stated = TABLE.read_text().partition(BEGIN)
    if os.environ.get("HEXACELL_UPDATE_TABLES"):
        TABLE.write_text(head + BEGIN + made)
        return
    assert made == stated
