"""``hexacell-set-pins`` against a ``halcmd`` that keeps pins in a file."""

import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from drivers.controllers.linuxcnc import set_pins as command
from hexacell.errors import FileError, UsageError

HALCMD = """#!{python}
import json, sys
from pathlib import Path

kept = Path({pins!r})
pins = json.loads(kept.read_text())
if sys.argv[1:] == ["-f"]:
    for line in sys.stdin:
        word, pin, value = line.split()
        if word != "setp" or pin not in pins:
            sys.exit(f"<stdin>:1: pin '{{pin}}' not found")
        pins[pin] = value
    pins["kins.fwd-kins-fail"] = "TRUE" if float(pins["kins.l.0"]) > 900.0 else "FALSE"
    kept.write_text(json.dumps(pins))
else:
    for pin, value in pins.items():
        if sys.argv[-1] == "*" or pin.endswith(sys.argv[-1].lstrip("*")):
            print("kins", "bit" if value in ("TRUE", "FALSE") else "float", "IN", value, pin)
"""

HAL = """
loadrt kins
setp kins.l.0 [KINS]L1   # of leg 1
setp kins.l.1 [KINS]L2
setp kins.criterion 1e-9
setp kins.gain [OTHER]GAIN
net x kins.out => joint.0.in
"""
INI = "[KINS]\nL1 = 591.123456789\nL2 = 582.5\n"
TUNED = "1e-07"


set_pins = partial(command.set_pins, settle_s=0.0)


@pytest.fixture
def pins(tmp_path, monkeypatch) -> Callable[[], dict[str, str]]:
    """What the running LinuxCNC has."""
    kept = tmp_path / "pins.json"
    values = {"kins.l.0": "590", "kins.l.1": "580", "kins.criterion": TUNED, "kins.fwd-kins-fail": "FALSE"}
    kept.write_text(json.dumps(values))
    folder = tmp_path / "bin"
    folder.mkdir()
    program = folder / "halcmd"
    program.write_text(HALCMD.format(python=sys.executable, pins=str(kept)))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))
    return lambda: json.loads(kept.read_text())


@pytest.fixture
def files(tmp_path) -> Callable[..., list[Path]]:
    def write(hal: str = HAL, ini: str = INI) -> list[Path]:
        (tmp_path / "kins.hal").write_text(hal)
        (tmp_path / "kins.ini").write_text(ini)
        return [tmp_path / "kins.hal", tmp_path / "kins.ini"]

    return write


def test_pins_get_the_numbers_of_the_ini_file_and_others_stay_as_they_were_tuned(pins, files) -> None:
    assert set_pins(files()) == 2
    assert pins()["kins.l.0"] == "591.123456789", "not rounded"
    assert pins()["kins.l.1"] == "582.5"
    assert pins()["kins.criterion"] == TUNED


def test_without_an_ini_file_pins_get_the_numbers_of_the_hal_file(pins, files) -> None:
    assert set_pins(files(hal="setp kins.l.0 585.5\nsetp kins.l.1 [KINS]L2\n")[:1]) == 1
    assert (pins()["kins.l.0"], pins()["kins.l.1"]) == ("585.5", "580")


def test_where_the_forward_kinematics_fails_the_old_numbers_are_set_again(pins, files) -> None:
    with pytest.raises(UsageError, match=r"no pose with these numbers \(kins.fwd-kins-fail\)"):
        set_pins(files(ini="[KINS]\nL1 = 950.0\nL2 = 582.5\n"))
    assert (pins()["kins.l.0"], pins()["kins.l.1"]) == ("590", "580")
    assert pins()["kins.fwd-kins-fail"] == "FALSE"


@pytest.mark.parametrize(
    ("ini", "error", "words"),
    [
        (INI + "[OTHER]\nGAIN = 2\n", UsageError, r"no pin kins\.gain"),
        ("[KINS]\nL1 = 591.0 # mm\n", FileError, "behind L1 stands"),
        ("[KINS]\nL2 = 591.0\n", FileError, r"no L1 in a section \[KINS\]"),
    ],
)
def test_one_number_that_cannot_be_set_leaves_all_as_they_were(pins, files, ini, error, words) -> None:
    with pytest.raises(error, match=words):
        set_pins(files(ini=ini))
    assert pins()["kins.l.1"] == "580"


def test_a_call_that_would_set_nothing_fails(pins, files) -> None:
    """The file with the geometry was forgotten: the controller would go on with its old one."""
    with pytest.raises(UsageError, match="set no pin to a number"):
        set_pins(files(hal="setp kins.l.0 [KINS]L1\n")[:1])


def test_without_a_hal_file_it_says_how_it_is_called(pins, files) -> None:
    with pytest.raises(UsageError, match="no HAL file is named"):
        set_pins(files()[1:])


def test_without_linuxcnc_the_command_fails_in_one_line(files, monkeypatch, capsys) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sys, "argv", ["hexacell-set-pins", *map(str, files())])
    assert command.main() == 1
    said = capsys.readouterr().err
    assert said.startswith("hexacell-set-pins: halcmd cannot be run")
    assert said.count("\n") == 1
