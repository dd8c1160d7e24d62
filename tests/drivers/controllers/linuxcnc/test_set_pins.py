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
        if word != "setp" or pin not in pins or pin.endswith("fail"):
            sys.exit(f"<stdin>:1: pin '{{pin}}' not found, or not writable")
        pins[pin] = value
        kept.write_text(json.dumps(pins))
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
        ("[KINS]\nL1 = \\\n591.0\nL2 = 582.5\n", FileError, r"\.ini:2: \[KINS\]L1 is '\\\\'"),
        (
            "[KINS]\nL1 = 591,0\nL2 = 582.5\n",
            FileError,
            r"\.ini:2: \[KINS\]L1 is '591,0', which is no number",
        ),
        (INI + "#INCLUDE tuned/more.inc\n", FileError, r"\.ini:4: tuned/more\.inc is included here"),
    ],
)
def test_one_number_that_cannot_be_set_leaves_all_as_they_were(pins, files, ini, error, words) -> None:
    with pytest.raises(error, match=words):
        set_pins(files(ini=ini))
    assert pins()["kins.l.1"] == "580"


@pytest.mark.parametrize(
    "line",
    [
        "setp kins.l.1 [KINS](L2)",
        "setp kins.l.1 \\\n   [KINS]L2 # goes on",
        "kins.l.1 = [KINS]L2\r",
        "setp kins.l.1 [KINS](L2)e0",
        "# no more \\\n# than a remark\nsetp kins.l.1 [KINS]L2",
        "\tsetp\tkins.l.1\t[KINS](L2)\t# tabs\nloadusr -W hal_input\nsetp kins.mode TRUE",
    ],
)
def test_every_form_in_which_halcmd_takes_a_variable_is_set(pins, files, line) -> None:
    assert set_pins(files(hal=f"setp kins.l.0 [KINS]L1\n{line}\n")) == 2
    assert float(pins()["kins.l.1"]) == 582.5


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("setp kins.l.1 \\\r\n [KINS]L2", "does not set one pin to one value"),
        ("setp kins.l.1 [KINS]\\\nL2", "does not set one pin to one value"),
        ("# of leg 2 \\\nsetp kins.l.1 [KINS]L2", "the comment before it ends with a backslash"),
        ("setp kins.l.1 [KINS", "no number and no variable"),
        ("setp kins.l.1 $L2", "no number and no variable"),
        ('setp kins.l.1 "582.5"', "no number and no variable"),
        ("setp kins.l.1 [KINS]L2[OTHER]GAIN", "no number and no variable"),
        ("kins.l.1=[KINS]L2", "'kins.l.1=.KINS.L2' is no command of halcmd"),
        ("SETP kins.l.1 [KINS]L2", "'SETP' is no command of halcmd"),
        ("setp kins.l.1 [KINS]L2$SUFFIX", "no number and no variable"),
        ("setp kins.l.1 [KINS]L2\nsetp kins.l.1 5", "set a second time"),
        ("setp kins.l.1 5\nkins.l.1 = [KINS](L2)", "set a second time"),
        ("source legs.hal", "source legs.hal may set pins too"),
        ("net second => kins.l.1\nsets second [KINS]L2", "may set pins too"),
    ],
)
def test_a_line_that_may_set_a_pin_otherwise_is_named_and_nothing_is_set(pins, files, line, words) -> None:
    with pytest.raises(FileError, match=words) as caught:
        set_pins(files(hal=f"setp kins.l.0 [KINS]L1\n{line}\n"))
    assert caught.value.line in {2, 3}
    assert pins()["kins.l.0"] == "590"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("setp kins.l.1 582,5", "no number and no variable"),
        ("setp kins.l.1 nan", "no number and no variable"),
        ("net second => kins.l.1\nsets second 582.5", "sets second 582.5 may set pins too"),
        ("linkps kins.l.1 second\nsets second 582.5", "sets second 582.5 may set pins too"),
    ],
)
def test_without_an_ini_file_every_number_counts(pins, files, line, words) -> None:
    with pytest.raises(FileError, match=words) as caught:
        set_pins(files(hal=f"net limits => joint.0.in\nsets limits 1\nsetp kins.l.0 585.5\n{line}\n")[:1])
    assert caught.value.line in {4, 5}
    assert pins()["kins.l.0"] == "590"


def test_a_section_that_two_files_have_is_named(pins, files, tmp_path) -> None:
    """LinuxCNC, which has one file that includes the other, looks into the first of them alone."""
    (tmp_path / "more.ini").write_text("[KINS]\nL2 = 5.0\n")
    with pytest.raises(FileError, match=r"more\.ini: it has a section \[KINS\], as .*kins\.ini has"):
        set_pins([*files(), tmp_path / "more.ini"])


def test_a_file_of_which_no_pin_gets_a_number_is_named(pins, files, tmp_path) -> None:
    (tmp_path / "more.tcl").write_text("[MORE]\nL2 = 5.0\n")
    with pytest.raises(FileError, match=r"more\.tcl: no line sets a pin"):
        set_pins([*files(), tmp_path / "more.tcl"])
    assert pins()["kins.l.0"] == "590"


def test_pins_before_one_that_halcmd_cannot_set_get_their_old_numbers_again(pins, files) -> None:
    with pytest.raises(UsageError, match="halcmd failed"):
        set_pins(files(hal="setp kins.l.0 [KINS]L1\nsetp kins.fwd-kins-fail [KINS]L2\n"))
    assert pins()["kins.l.0"] == "590"


def test_a_call_that_would_set_nothing_fails(pins, files) -> None:
    """A file with the geometry was forgotten: the controller would go on with its old one."""
    hal, ini = files(hal="setp kins.l.0 [KINS]L1\n")
    for named, words in (([hal], "set no pin to a number"), ([ini], "no HAL file is named")):
        with pytest.raises(UsageError, match=words):
            set_pins(named)


def test_without_linuxcnc_the_command_fails_in_one_line(files, monkeypatch, capsys) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sys, "argv", ["hexacell-set-pins", *map(str, files())])
    assert command.main() == 1
    said = capsys.readouterr().err
    assert said.startswith("hexacell-set-pins: halcmd cannot be run")
    assert said.count("\n") == 1
