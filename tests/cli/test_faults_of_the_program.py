"""What a person sees where the program fails, or its output cannot be written."""

import errno
import json
import os
import re
import stat
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from hexacell import __main__
from hexacell.cli import app
from hexacell.cli.commands import cell as commands
from hexacell.cli.console import Console, lost_output, unhindered_output
from tests.signals import terminal_signals


@pytest.fixture
def failing(monkeypatch, tmp_path):
    """A command that fails in an unforeseen way; its reports are in a folder of their own."""

    def fail(*_):
        raise ValueError("first line\nsecond line")

    monkeypatch.setattr(commands, "schema", fail)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return ["cell", "schema"]


def test_a_fault_is_one_line_with_a_report_and_a_code_of_its_own(failing, capsys):
    assert app.main(failing) == 70
    captured = capsys.readouterr()
    told = re.fullmatch(
        r"hexacell: this is a fault of the program: ValueError: first line second line\. "
        r"Please report it with (\S+)\n",
        captured.err,
    )
    assert told, captured.err
    report = Path(told[1])
    assert "hexacell cell schema\n" in report.read_text()
    assert 'raise ValueError("first line' in report.read_text()
    assert stat.S_IMODE(report.stat().st_mode) == 0o600
    assert captured.out == ""


def test_a_fault_gives_a_document_too_and_says_where_no_report_could_be_written(
    failing, monkeypatch, capsys
):
    monkeypatch.setattr("tempfile.tempdir", "/nonexistent")
    assert app.main([*failing, "--json"]) == 70
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert document["exit_code"] == 70
    assert "this is a fault of the program" in document["error"]
    assert "No report could be written: No such file" in captured.err


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (
            OSError(errno.EMFILE, "Too many open files", "run.lock"),
            "run.lock: this process may open no more",
        ),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "the memory is used up. End other"),
        (FileNotFoundError(errno.ENOENT, "No usable temporary directory found"), "name another folder"),
    ],
)
def test_what_the_computer_lacks_is_no_fault_of_the_program(failing, monkeypatch, capsys, error, told):
    monkeypatch.setattr(commands, "schema", Mock(side_effect=error))
    assert app.main(failing) == 2
    assert told in capsys.readouterr().err


def hexacell(*arguments, stdout, **environment):
    with terminal_signals():
        return subprocess.run(
            [sys.executable, "-m", "hexacell", *map(str, arguments)],
            stdout=stdout,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, **environment},
            check=False,
        )


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
def test_output_to_a_full_disk_is_an_error_and_no_traceback():
    with Path("/dev/full").open("w") as full:
        ended = hexacell("cell", "schema", "--json", stdout=full)
    assert ended.returncode == 2
    assert ended.stderr == "hexacell: the output could not be written: No space left on device\n"


@pytest.mark.parametrize("blocks", [True, False])
def test_a_reader_that_pauses_holds_up_nothing_and_gets_all(monkeypatch, blocks):
    """As after Ctrl-S, or in a pager: a run watches its robot meanwhile."""
    reader, writer = os.pipe()
    os.set_blocking(writer, blocks)
    said = "word\n" * 100_000
    with os.fdopen(reader) as read, os.fdopen(writer, "w") as pipe, monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", pipe)
        with unhindered_output():
            Console().print(said)
            Console().error("later")
            for rest in [said] if blocks else [said[:99], said[99:]]:
                assert read.read(len(rest)) == rest
    assert lost_output() is None


def test_letters_that_the_locale_does_not_know_are_escaped(cell_folder):
    cell_folder.edit(('name = "simulated-hexaglide"', 'name = "Prüfstand"'))
    shown = hexacell("cell", "show", cell_folder.cell, stdout=subprocess.PIPE, PYTHONIOENCODING="ascii")
    assert shown.returncode == 0, shown.stderr
    assert r"Pr\xfcfstand" in shown.stdout


def test_a_warning_of_numpy_reaches_no_user(monkeypatch, capsys):
    monkeypatch.setattr(app, "main", lambda: int(np.sqrt(np.array(-1.0)) > 0))
    monkeypatch.setattr(sys, "warnoptions", [])
    with pytest.warns(RuntimeWarning):
        app.main()
    assert __main__.main() == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "command",
    [["replay"], ["cell", "validate"], ["run", "cell.toml", "--resume"], ["demo", "--folder"]],
    ids=" ".join,
)
def test_an_argument_that_can_name_no_file_is_refused(capsys, command):
    for argument in ("x" * 5000, "a/" * 3000, "x" * 300, "\0", "\ud800"):
        assert app.main([*command, argument]) == 2
        assert "is not a valid file name" in capsys.readouterr().err
