"""The program before LinuxCNC's module, with what the real one does not show at will."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.controllers.adapter.served_robot import FailedError
from drivers.controllers.linuxcnc import machine as orders
from drivers.controllers.linuxcnc import module_program as program
from tests.drivers.controllers.linuxcnc.fake_linuxcnc import FakeLinuxcnc

INCH = 1.0 / 25.4
THERE, BACK = (10.0, -20.0, 560.0, 5.0, -4.0, 10.0), (0.0, 0.0, 550.0, 0.0, 0.0, 0.0)
RESTORING = "G20 G94 G0 F12.5"


@pytest.fixture
def task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[subprocess.Popen[bytes]]:
    """A process of the task's name, which is none but this test's."""
    monkeypatch.setattr(program, "TASK", f"task{os.getpid()}")
    sleep = shutil.which("sleep")
    assert sleep is not None
    with subprocess.Popen([shutil.copy(sleep, tmp_path / program.TASK), "infinity"]) as process:
        yield process
        process.kill()


@pytest.fixture
def fake(task: object, monkeypatch: pytest.MonkeyPatch) -> FakeLinuxcnc:
    """LinuxCNC's module of a machine that counts in inches; the program ends by ``SystemExit``."""
    made = FakeLinuxcnc(INCH)
    monkeypatch.setattr(program, "linuxcnc", made)
    monkeypatch.setattr(os, "_exit", lambda status: (_ for _ in ()).throw(SystemExit(status)))
    return made


@pytest.fixture
def machine(fake: FakeLinuxcnc) -> orders.Machine:
    made = orders.Machine(program.ModuleAccess())
    assert made.hello({}) == {"name": "LinuxCNC 2.9", "description": "hexa.ini"}
    return made


def moved(machine: orders.Machine, pose: tuple[float, ...]) -> None:
    machine.move(pose, 1.0, lambda at: None)


def test_inches_are_mm_here_and_modes_are_restored(fake, machine) -> None:
    moved(machine, THERE)
    assert machine.position()["pose"] == pytest.approx(THERE)
    assert machine.position()["joints"] == pytest.approx([50.8] * 6)
    assert fake.blocks[1:] == [RESTORING]


def test_modes_that_could_not_be_restored_are_restored_after_the_next_move(fake, machine) -> None:
    fake.breaks_off = fake.MODE_MANUAL
    with pytest.raises(FailedError, match="another client has put it into manual mode") as caught:
        moved(machine, THERE)
    assert caught.value.answer["kind"] == "interrupted"
    fake.now.gcodes = (0, 10, 210, 900, 930, 540)
    moved(machine, BACK)
    assert fake.blocks[2:] == [RESTORING]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"g92_offset": (0.0, 0.0, 0.1, *[0.0] * 6)}, "an offset of 0 0 0.1 0"),
        ({"gcodes": (0, 910)}, "relative"),
        ({"tool_offset": (0.0, 0.0, 1.0, *[0.0] * 6)}, "tool length"),
        ({"feedrate": 1.2}, "moves 120 % as fast"),
        ({"task_state": FakeLinuxcnc().STATE_OFF}, "switched off"),
    ],
)
def test_what_would_make_another_move_of_it_is_refused(fake, machine, changes, said) -> None:
    vars(fake.now).update(changes)
    with pytest.raises(FailedError, match=said) as caught:
        moved(machine, THERE)
    assert caught.value.answer["kind"] == "refused"
    assert not fake.blocks


def test_a_task_that_receives_nothing_is_told(fake, machine) -> None:
    moved(machine, THERE)
    fake.is_frozen = True
    for call in (machine.stop, lambda: moved(machine, BACK)):
        with pytest.raises(FailedError, match="its task is frozen"):
            call()


def test_a_program_that_somebody_runs_takes_it_away(fake, machine) -> None:
    assert machine.status()["remote"] is True
    fake.now.task_mode, fake.now.interp_state = fake.MODE_AUTO, fake.INTERP_READING
    said = machine.status()
    assert (said["remote"], said["moving"]) == (False, True)


def test_messages_without_end_are_a_few(fake, machine) -> None:
    fake.now.task_state = fake.STATE_OFF
    fake.flood("joint 3 following error")
    assert machine.status()["errors"] == ["joint 3 following error"] * orders.MOST_SHOWN
    fake.now.task_state = fake.STATE_ON
    fake.breaks_off = fake.MODE_MDI
    with pytest.raises(FailedError, match=r"^joint 3 following error$"):
        moved(machine, THERE)


@pytest.mark.parametrize("end", ["fails", "task", "starts"])
def test_without_linuxcnc_it_ends_and_says_so(fake, machine, task, capsys, end) -> None:
    call, said = machine.status, "LinuxCNC does not answer: emcStatusBuffer invalid"
    if end == "fails":
        fake.fails = True
    elif end == "task":
        task.kill()
        task.wait()
        said = "LinuxCNC has ended"
    else:
        fake.now.linear_units = 0.0
        call, said = (lambda: machine.hello({})), "LinuxCNC is still starting"
    with pytest.raises(SystemExit):
        call()
    assert said in capsys.readouterr().err


def test_without_the_module_it_says_which_python_is_needed(monkeypatch) -> None:
    monkeypatch.setattr(program, "linuxcnc", None)
    with pytest.raises(FailedError, match="no module linuxcnc") as caught:
        orders.Machine(program.ModuleAccess()).hello({})
    assert "controller.options.python" in caught.value.answer["action"]
