"""Sound cells and runs, from which mutated ones are made."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.devices import ThermometerSettings
from hexacell.cell.fields import CertificateSettings
from hexacell.cell.loader import dump, load_cell
from hexacell.cell.model import CellSettings
from hexacell.cell.operation import NotificationSettings, OpcUaSettings, ReportSettings, UnattendedSettings
from hexacell.cli.app import main
from procedures.journal.journal import encode, read_entries
from procedures.steps import events
from tests.mutations.trials import CELL, CONFIG, RECORDS, RUN, Templates
from tests.small_cell import SMALL, changed, choose_among_few

QUICK: dict[str, Any] = {
    "timing.clock_factor": 500.0,
    "timing.give_up_s": 500.0,
    "encoders.timeout_s": 10.0,
    "encoders.heartbeat_ms": 10_000,
    "simulation.motion.ringing_mm": 0.05,
}
CERTIFICATE = {"number": "D-K 4711", "due": "2027-03-31", "expanded_um": 1.2}
REPORT = {"machine": "HX 3", "serial_number": "0017", "laboratory": "Hall 4", "country": "DE"}
TOLD = (
    {"name": "night shift", "url": "https://127.0.0.1:9/path", "on": ("no-pass", "alarm")},
    {"name": "broker", "url": "mqtts://127.0.0.1:9", "topic": "cells/one", "ca_file": "ca.pem"},
    {"name": "office", "url": "mailto://127.0.0.1:9?from=a@b.example&to=c@d.example"},
)
LATE = ("propose", "commit", "judge")


@contextmanager
def few_choices() -> Iterator[None]:
    """Choose among few poses, without a terminal: what is chosen is not under test."""
    with pytest.MonkeyPatch.context() as patch:
        choose_among_few(patch)
        patch.setattr("hexacell.cli.commands.run.is_interactive", lambda: False)
        yield


def make_templates(folder: Path) -> Templates:
    """Sound cells in a folder: one is calibrated for it, among few poses."""
    small = _small(folder / "small")
    assert main(["run", str(small / CELL), "--unattended", "--mode", "optimise"]) in {0, 1}
    [run] = (small / RUN).parent.glob("2*")
    run.rename(small / RUN)
    shutil.copy(small / RUN / "measurements.csv", small / RECORDS)
    plain = folder / "plain"
    plain.mkdir()
    source = bundled_config("simulated-hexaglide")
    shutil.copy(source, plain / CELL)
    shutil.copy(source.with_name(CONFIG), plain / CONFIG)
    shutil.copy(small / RECORDS, plain / RECORDS)
    furnished = folder / "furnished"
    shutil.copytree(plain, furnished)
    settings = load_cell(furnished / CELL).settings
    (furnished / CELL).write_text(dump(changed(settings, _every_section(settings))))
    return Templates(
        plain, small, furnished, tuple(_interrupted(small, folder / step, step) for step in LATE)
    )


def _every_section(settings: CellSettings) -> dict[str, Any]:
    """What a cell file may have beside the bundled one's sections, by dotted keys."""
    certificate = CertificateSettings.model_validate(CERTIFICATE)
    gauges = tuple(gauge.model_copy(update={"certificate": certificate}) for gauge in settings.gauges)
    return {
        "gauges": gauges,
        "thermometers": (ThermometerSettings(name="room", path="/sys/class/hwmon/none", legs=(4,)),),
        "unattended": UnattendedSettings(quiet_hours=("05:30-22:00",), longest_minutes=90.0),
        "notifications": tuple(NotificationSettings.model_validate(one) for one in TOLD),
        "opcua": OpcUaSettings(anonymous=True),
        "report": ReportSettings.model_validate(REPORT),
        "acceptance.valid_days": 90.0,
    }


def _small(folder: Path) -> Path:
    folder.mkdir()
    source = load_cell(bundled_config("simulated-hexaglide"))
    patient = tuple(gauge.model_copy(update={"timeout_s": 10.0}) for gauge in source.settings.gauges)
    (folder / CELL).write_text(dump(changed(source.settings, {"gauges": patient} | SMALL | QUICK)))
    shutil.copy(source.config_path, folder / CONFIG)
    return folder


def _interrupted(small: Path, folder: Path, step: str) -> Path:
    """The run as it was when a step was begun, and the config of then."""
    shutil.copytree(small, folder)
    entries = read_entries(folder / RUN / "journal.jsonl")
    begun = [entry.event.step.key if isinstance(entry.event, events.StepBegun) else "" for entry in entries]
    kept = entries[: begun.index(step)]
    (folder / RUN / "journal.jsonl").write_bytes(b"".join(map(encode, kept)))
    is_written = any(isinstance(entry.event, events.Committed) for entry in kept)
    name = "config-after" if is_written else "config-before"
    shutil.copy(folder / RUN / name, folder / CONFIG)
    if not is_written:
        for left in ("config-after", "config-before", "write-back.json"):
            (folder / RUN / left).unlink()
    return folder
