"""The whole job at the real LinuxCNC; gauges and encoders follow its joints, under a hidden geometry."""

from __future__ import annotations

import json
import subprocess

import pytest

from hexacell.cell.loader import load_cell
from hexacell.robot_model import config_format
from tests.waiting import wait_until

pytestmark = pytest.mark.timeout(1200)

RUN = ("run", "cell.toml", "--mode", "optimise", "--unattended", "--json")


def pins(linuxcnc) -> list[float]:
    """The geometry that runs."""
    names = [f"{part}.{leg}.{axis}" for part in "sb" for leg in range(6) for axis in "xyz"]
    names += [f"l.{leg}" for leg in range(6)]
    return [float(linuxcnc.pin(f"hexaglidekins.{name}")) for name in names]


def written(linuxcnc) -> list[float]:
    """The geometry of the config."""
    cell = load_cell(linuxcnc.folder / "cell.toml")
    vector: list[float] = config_format(cell.settings).read(cell.config_path).geometry.vector.tolist()
    return vector


def test_a_calibration_passes_and_its_geometry_runs(linuxcnc) -> None:
    before = written(linuxcnc)
    done = linuxcnc.hexacell(*RUN)
    result = json.loads(done.stdout)
    assert (done.returncode, result["verdict"]) == (0, "pass"), done.stderr
    after = written(linuxcnc)
    assert after != before
    assert pins(linuxcnc) == pytest.approx(after, rel=1e-6)


def test_a_calibration_goes_on_where_linuxcnc_was_killed(linuxcnc) -> None:
    running = subprocess.Popen(
        ["hexacell", *RUN],
        cwd=linuxcnc.folder,
        env=linuxcnc.environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_until(lambda: sampled(linuxcnc) >= 14 or running.poll() is not None)
    linuxcnc.kill()
    said = running.communicate()
    assert running.returncode == 3, said
    linuxcnc.start()
    done = linuxcnc.hexacell(*RUN, "--resume")
    assert (done.returncode, json.loads(done.stdout)["verdict"]) == (0, "pass"), done.stderr
    assert pins(linuxcnc) == pytest.approx(written(linuxcnc), rel=1e-6)


def sampled(linuxcnc) -> int:
    """Records so far."""
    return sum(
        json.loads(line)["event"]["kind"] == "sampled"
        for path in linuxcnc.folder.glob("runs/*/*/journal.jsonl")
        for line in path.read_text().split("\n")[:-1]
    )
