"""The whole job at the real LinuxCNC; gauges and encoders follow its motors, under a hidden geometry."""

import json
import subprocess
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.config.layout import ConfigLayout
from hexacell.config.linuxcnc_ini import limits_of_ini
from tests.linuxcnc.conftest import LinuxCNC
from tests.waiting import wait_until

pytestmark = pytest.mark.timeout(1200)

RUN = ("run", "cell.toml", "--mode", "optimise", "--unattended", "--json")
STOPPED = 3
"""The exit status of a run that a device ended."""

Fault = Callable[[LinuxCNC], None]


@pytest.fixture(params=["linuxcnc", "hexapod"])
def machine(request: pytest.FixtureRequest) -> LinuxCNC:
    """Both, one after the other; they are running."""
    found: LinuxCNC = request.getfixturevalue(request.param)
    return found


def kill(machine: LinuxCNC) -> None:
    """As in a crash."""
    machine.kill()


def freeze_server(machine: LinuxCNC) -> None:
    """It answers no more; the motion goes on."""
    machine.signal("STOP", "linuxcncrsh")


def freeze_task(machine: LinuxCNC) -> None:
    """What is behind the server does nothing any more."""
    machine.signal("STOP", "milltask")


def press_emergency_stop(machine: LinuxCNC) -> None:
    """As another client does."""
    with machine.connect() as client:
        client.send("set estop on")


def fault_joint(machine: LinuxCNC) -> None:
    """Its drive says so."""
    machine.set_pin("joint.2.amp-fault-in", "1")


def go_on(machine: LinuxCNC) -> None:
    """What a person does at LinuxCNC after any of these."""
    if not machine.is_running:
        machine.start()
        return
    for name in ("linuxcncrsh", "milltask"):
        machine.signal("CONT", name)
    machine.set_pin("joint.2.amp-fault-in", "0")
    with machine.connect() as client:
        client.send("set estop off")


def test_a_hexaglide_is_calibrated_and_its_geometry_runs(linuxcnc: LinuxCNC) -> None:
    before = written(linuxcnc)
    require_passed(linuxcnc, linuxcnc.hexacell(*RUN))
    after = written(linuxcnc)
    assert after != before
    assert pins_of_hexaglide(linuxcnc) == pytest.approx(after, rel=1e-6)
    shown = linuxcnc.hexacell("rollback", "cell.toml", "--json")
    assert shown.returncode == 0, shown.stderr
    assert written(linuxcnc) == before


@pytest.mark.parametrize("is_short", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_stock_hexapod_is_calibrated_through_a_crash_of_linuxcnc(hexapod, is_short):
    if is_short:
        shorten(hexapod)
    before = written(hexapod)
    require_stopped_and_resumed(hexapod, kill)
    after = written(hexapod)
    assert after != before
    assert pins_of_hexapod(hexapod) == pytest.approx(after[:36], rel=1e-6)
    with hexapod.connect() as client:
        lengths = client.get("joint_pos")
    motors = [float(hexapod.pin(f"joint.{leg}.motor-pos-fb")) for leg in range(6)]
    zeros = [length - motor for length, motor in zip(lengths, motors, strict=True)]
    assert zeros == pytest.approx(after[36:], abs=1e-3)


@pytest.mark.slow
def test_a_stock_hexapod_is_calibrated_whose_encoders_only_linuxcnc_reads(hexapod: LinuxCNC) -> None:
    cell = hexapod.folder / "cell.toml"
    text = cell.read_text()
    for old, new in (('"cia406"', '"controller"'), ("measuring_step_nm = 1000", "measuring_step_nm = 1")):
        assert text.count(old) == 1
        text = text.replace(old, new)
    cell.write_text(text)
    before = written(hexapod)
    require_passed(hexapod, hexapod.hexacell(*RUN))
    assert written(hexapod) != before


@pytest.mark.slow
@pytest.mark.parametrize("fault", [kill, freeze_server, freeze_task, press_emergency_stop, fault_joint])
def test_a_run_stops_at_a_fault_and_ends_the_same_once_resumed(machine: LinuxCNC, fault: Fault) -> None:
    shorten(machine)
    require_stopped_and_resumed(machine, fault)


def require_stopped_and_resumed(machine: LinuxCNC, fault: Fault) -> None:
    """A fault in the middle of a run ends it; nothing moves until it is resumed, and then it passes."""
    with subprocess.Popen(
        ["hexacell", *RUN],
        cwd=machine.folder,
        env=machine.environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as running:
        wait_until(lambda: sampled(machine) >= 14 or running.poll() is not None)
        fault(machine)
        said = running.communicate()
    assert running.returncode == STOPPED, said
    at_the_fault = sampled(machine)
    go_on(machine)
    assert sampled(machine) == at_the_fault
    require_passed(machine, machine.hexacell(*RUN, "--resume"))


def require_passed(machine: LinuxCNC, done: subprocess.CompletedProcess[str]) -> None:
    """Verdict pass: the error at the task poses with its uncertainty is within the limit.

    No pose was commanded beyond the limits of LinuxCNC's axes.
    """
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] == "pass"
    steps = [event["step"] for event in journal(machine) if event["kind"] == "begun"]
    commanded = np.array([step["pose"] for step in steps if step["kind"] == "move"])
    axes = limits_of_ini(machine.ini).axes
    assert axes is not None
    lowest, highest = np.transpose([axis for axis in axes if axis is not None])
    assert len(commanded) > 50
    assert ((commanded >= lowest) & (commanded <= highest)).all()


def shorten(machine: LinuxCNC) -> None:
    """Fewer orientations, and a limit that they reach."""
    cell = machine.folder / "cell.toml"
    text = cell.read_text()
    for old, new in (
        ("orientations = 11", "orientations = 7"),
        ("orientations = 6", "orientations = 3"),
        ("position_mm = 0.3 ", "position_mm = 0.5 "),
        ("orientation_deg = 0.08", "orientation_deg = 0.2"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    cell.write_text(text)


def pins_of_hexaglide(machine: LinuxCNC) -> list[float]:
    """The geometry that runs."""
    names = [f"{part}.{leg}.{axis}" for part in "sb" for leg in range(6) for axis in "xyz"]
    names += [f"l.{leg}" for leg in range(6)]
    return [float(machine.pin(f"hexaglidekins.{name}")) for name in names]


def pins_of_hexapod(machine: LinuxCNC) -> list[float]:
    """The same of a hexapod, but for its zeros."""
    names = [f"{part}.{leg}.{axis}" for part in ("base", "platform") for leg in range(6) for axis in "xyz"]
    return [float(machine.pin(f"genhexkins.{name}")) for name in names]


def written(machine: LinuxCNC) -> list[float]:
    """The geometry of the config."""
    cell = load_cell(machine.folder / "cell.toml")
    vector: list[float] = ConfigLayout.of(cell.settings).read(cell.config_path).geometry.vector.tolist()
    return vector


def sampled(machine: LinuxCNC) -> int:
    """Records so far."""
    return sum(event["kind"] == "sampled" for event in journal(machine))


def journal(machine: LinuxCNC) -> list[dict[str, Any]]:
    """The events of its run so far."""
    return [
        json.loads(line)["event"]
        for path in machine.folder.glob("runs/*/*/journal.jsonl")
        for line in path.read_text().split("\n")[:-1]
    ]
