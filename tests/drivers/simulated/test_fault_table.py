"""Every fault of every device, what becomes of it, and what is told: ``fault_table.md``, which docs show.

``HEXACELL_UPDATE_TABLES=1`` writes the table anew; a difference is then to be looked at before it is kept.
"""

import asyncio
import math
import os
import re
from collections.abc import Awaitable, Callable, Coroutine
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.conformance import served_encoder_twin
from drivers.encoders.bank import ThreadedBank
from drivers.encoders.cia406 import Cia406Bank, EncoderSession
from drivers.encoders.dbc import DbcBank
from drivers.encoders.modbus import ModbusBank
from drivers.encoders.node_monitor import AlarmTiming
from drivers.simulated.gauges.bank import SimulatedGaugeBank
from drivers.simulated.gauges.server import LineFault
from hexacell.cell.devices import LinearEncoderSettings
from hexacell.cell.simulation import FaultKind
from hexacell.errors import HexacellError
from procedures.devices.settling import trimmed_mean
from tests.drivers.encoders.dbc.conftest import SIGNALS, dbc_text
from tests.drivers.simulated.gauges.served.cell import DESCRIBED, DISPLAYS, PROTOCOLS, Cell

TABLE = Path(__file__).with_name("fault_table.md")
GAUGES, EVERY_GAUGE = (*PROTOCOLS, *DISPLAYS, *DESCRIBED), "every gauge"
BEFORE_MM, AFTER_MM = 1.0, 1.5
ENCODER_BEFORE_MM, ENCODER_AFTER_MM = 30.0, 30.5
SLOW = {"timeout_s": 1.0, "largest_speed_mm_s": 1e-3}
"""What is a jump must not depend on how fast this machine takes two samples."""
READINGS = 5
ENCODER_READINGS = 50
AT_ONCE = 8
DBC_FAULTS: tuple[FaultKind, ...] = ("silent", "alarm", "frozen", "jumped")
SETTINGS = {"at its end", "in inches", "in peak mode", "low battery", "on hold", "reversed"}
MODBUS_DEVICE_FAULTS = ("unplugged", "silent", "alarm", "frozen", "jumped", "reversed", "zeroed")
INVALID = 0x7FFFFFFF
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
    words = re.sub(r"b'[^']*' came last", "FRAME came last", words)
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
        return row(protocol, fault, error, is_right=abs(shown - AFTER_MM) < RIGHT_MM)
    finally:
        await cell.links.close()
        cell.rack.close()


BANKS: dict[str, Callable[..., ThreadedBank[Any]]] = {
    "cia406": Cia406Bank,
    "dbc": DbcBank,
    "modbus": ModbusBank,
}


def encoder_settings(protocol: str, folder: Path) -> LinearEncoderSettings:
    (folder / "encoders.dbc").write_text(dbc_text())
    dbc = {
        "file": str(folder / "encoders.dbc"),
        "signals": SIGNALS,
        "delay_s": 0.0,
        "must_be": {"Error": 0},
    }
    described: dict[str, dict[str, Any]] = {
        "cia406": {"heartbeat_ms": 5000},
        "dbc": {"measuring_step_nm": 500, "dbc": dbc},
        "modbus": {"modbus": {"registers": (0, 2, 4, 6, 8, 10), "invalid": (INVALID,)}},
    }
    return LinearEncoderSettings.model_validate({**SLOW, "protocol": protocol, **described[protocol]})


async def encoder_row(protocol: str, fault: FaultKind, folder: Path) -> Row:
    with served_encoder_twin(encoder_settings(protocol, folder)) as twin:
        bank = BANKS[protocol](twin.settings)
        twin.stand_at([ENCODER_BEFORE_MM] * 6)
        try:
            await bank.open()
            await bank.read()
            twin.inject(fault, on=True)
            twin.stand_at([ENCODER_AFTER_MM] * 6)
            found: list[float] = []

            async def read_often() -> None:
                while len(found) < (ENCODER_READINGS if protocol == "cia406" else READINGS):
                    found.append((await bank.read()).positions[2])

            error = await told(read_often) or await told(bank.open)
            is_right = bool(found) and abs(found[-1] - ENCODER_AFTER_MM) < RIGHT_MM
            return row(f"{protocol} encoders", fault, error, is_right=is_right)
        finally:
            await bank.close()


def gauge_pairs() -> list[tuple[str, FaultKind]]:
    """Protocols with faults, in the order of the table."""
    faults = _kinds(lambda: Cell(["sylvac"] * 3).rack, "x")
    pairs = [(protocol, fault) for fault in faults for protocol in GAUGES]
    return [pair for pair in pairs if pair not in NOT_DUE]


def encoder_pairs(folder: Path) -> list[tuple[str, FaultKind]]:
    with served_encoder_twin(encoder_settings("cia406", folder)) as twin:
        found: list[tuple[str, Any]] = [("cia406", fault) for fault in twin._bank.faults(1)]
    found += [("dbc", fault) for fault in DBC_FAULTS]
    return found + [("modbus", fault) for fault in (*MODBUS_DEVICE_FAULTS, *LineFault)]


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


def table_of(found: list[Row]) -> str:
    """Devices that behave alike are in one row."""
    alike: dict[tuple[str, ...], list[str]] = {}
    for device, *rest in found:
        alike.setdefault(tuple(rest), []).append(device)
    lines = ["| fault | device | seen by its driver as | what is told |", "|---|---|---|---|"]
    for (fault, *rest), devices in sorted(alike.items(), key=lambda pair: pair[0][0].lower()):
        others = [device for device in devices if device not in GAUGES]
        names = [EVERY_GAUGE, *others] if {*GAUGES} <= {*devices} else devices
        lines.append(f"| {' | '.join([fault, ', '.join(names), *rest])} |")
    return "\n".join([*lines, ""])


def rows_of(table: str) -> set[Row]:
    """What a table says, a row a device."""
    found = set()
    for line in table.splitlines()[2:]:
        fault, names, seen, told = (cell.strip() for cell in line.strip("|").split(" |"))
        devices = names.replace(EVERY_GAUGE, ", ".join(GAUGES)).split(", ")
        found |= {(device, fault, seen, told) for device in devices}
    return found


@pytest.fixture(autouse=True)
def alarms_are_read_with_every_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(EncoderSession, "alarm_timing", AlarmTiming(0.0, math.inf, 1))


@pytest.mark.slow
async def test_every_fault_is_seen_or_harmless_as_the_table_says(capsys, tmp_path) -> None:
    found = await _a_few_at_once([gauge_row(*pair) for pair in gauge_pairs()])
    found += [await encoder_row(*pair, tmp_path) for pair in encoder_pairs(tmp_path)]
    made = table_of(found)
    with capsys.disabled():
        print(f"\n{made}")
    if os.environ.get("HEXACELL_UPDATE_TABLES"):
        TABLE.write_text(made)
        return
    assert rows_of(made) == rows_of(TABLE.read_text())
    assert made == TABLE.read_text()


async def test_some_faults_of_every_device_are_seen_as_the_table_says(tmp_path: Path) -> None:
    """Other faults with other protocols; the whole table is slow."""
    of_settings = [pair for pair in gauge_pairs() if pair[0] in PROTOCOLS and pair[1] in SETTINGS]
    pairs = {*gauge_pairs()[::19], *of_settings}
    found = await _a_few_at_once([gauge_row(*pair) for pair in pairs])
    sample: list[tuple[str, FaultKind]] = [("cia406", "alarm"), ("modbus", "frozen")]
    sample += [("dbc", fault) for fault in DBC_FAULTS]
    found += [await encoder_row(*pair, tmp_path) for pair in sample]
    assert set(found) <= rows_of(TABLE.read_text())
