"""A million answers of each protocol over lines that damage one byte in a hundred: what gets through?

Three gauges are read as a run reads them, until their readings settle, each time at another place.
"""

from collections import Counter
from random import Random

import numpy as np
import pytest

from drivers.interfaces import EncoderSample
from hexacell.cell.described_devices import RequestSettings
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.measuring import NoiseSettings, TimingSettings
from hexacell.clock import CellClock
from hexacell.errors import DeviceError, HexacellError, flatten_errors
from hexacell.services.devices.device_setup import gauge_with_agreement
from procedures.devices.device_set import Devices
from procedures.devices.settling import settle, trimmed_mean
from tests.benchmarks.figures import at_most
from tests.benchmarks.line_in_process import Damage, GaugesOnLines, LineTime
from tests.benchmarks.samples import sample

FRAMES = sample(__name__, "FRAMES")
SHARE = 0.01
CHECKED_EVERY = 20
"""After so many records the settings are compared, as a run does at every reference."""

QUICKER = 1e6
FARTHEST_MM = 5.0
NOISE = NoiseSettings()
ONE_IN = 100_000

ID_H = RequestSettings(
    ask="GA01\r\n", answer=r"GN01,([+-]\d{4}\.\d{4})", example="GN01,+0016.2345\r\n", at_end=r"GA01,ER\d"
)
PROTOCOLS = (
    "sylvac",
    "mux10",
    "cdi",
    "request",
    "digimatic-usb",
    "heidenhain-nd",
    "keyence-dl-rs1a",
    "mitutoyo-id-h",
)
"""Whose gauges are asked; what streams or has checksums is left out."""


def gauges(protocol: str) -> list[GaugeSettings]:
    """Three of one protocol; those of a multiplexer share its line."""
    return [
        gauge_with_agreement(
            GaugeSettings(
                name=axis,
                axis=axis,
                protocol=protocol,
                port="mux10" if protocol == "mux10" else axis,
                channel=place if protocol == "mux10" else 1,
                request=ID_H if protocol == "request" else None,
            ),
            NOISE,
        )
        for place, axis in enumerate(("x", "y", "z"), 1)
    ]


class NoEncoders:
    """Encoders that stand still."""

    async def read(self) -> EncoderSample:
        return EncoderSample((0,) * 6, (0.0,) * 6)


async def open_again(cell: GaugesOnLines, damage: Damage) -> None:
    """On lines without damage: what is opened on a bad line is another matter."""
    damage.share = 0.0
    await cell.open()
    damage.share = SHARE


@pytest.mark.parametrize("protocol", PROTOCOLS)
async def test_no_damage_becomes_a_record(protocol: str, figure, monkeypatch) -> None:
    random, truth, refused = Random(protocol), [0.0, 0.0, 0.0], Counter[str]()
    damage, records, wrong = Damage(0.0, random), 0, 0
    cell = GaugesOnLines(monkeypatch, gauges(protocol), truth, damage, LineTime())
    devices = Devices(cell.mounted, NoEncoders(), None)  # type: ignore[arg-type]
    await open_again(cell, damage)
    while damage.answers < FRAMES:
        truth[:] = [round(random.uniform(-FARTHEST_MM, FARTHEST_MM), 3) for _ in truth]
        try:
            settled = await settle(devices, TimingSettings(), CellClock(QUICKER))
            records += 3
            wrong += int(np.sum(np.abs(trimmed_mean(settled.gauges) - truth) > NOISE.gauge_mm))
            if records // 3 % CHECKED_EVERY == 0:
                for one in cell.mounted:
                    await one.gauge.check()
        except HexacellError as error:
            causes = flatten_errors(error)
            assert all(isinstance(one, DeviceError) for one in causes), causes
            refused.update(type(one).__name__ for one in causes)
            await open_again(cell, damage)
    await cell.close()
    figure(f"{protocol}: answers", damage.answers)
    figure("  damaged", damage.damaged)
    figure("  records", records)
    figure("  wrong records", wrong, "", at_most(records / ONE_IN))
    figure("  refused", ", ".join(f"{n} {name}" for name, n in refused.items()) or "none")
