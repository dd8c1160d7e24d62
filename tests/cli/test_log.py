"""The log of a command: where it is asked for, and only there."""

import re

LINE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z (DEBUG|INFO|WARNING|ERROR) [\w.]+: .+")


def test_a_file_gets_a_line_for_what_was_done(typed_here, quick_cell, tmp_path) -> None:
    file = tmp_path / "hexacell.log"
    for _ in range(2):
        assert typed_here("status", quick_cell.cell, "--log-file", file).err == ""
    lines = file.read_text().splitlines()
    assert all(LINE.fullmatch(line) for line in lines)
    assert len([line for line in lines if "INFO hexacell.cell.loader: read the cell file" in line]) == 2
    assert lines[-1].endswith("INFO hexacell.cli.app: exit code 0")
    assert "DEBUG" not in file.read_text()


def test_verbose_logs_on_stderr_and_twice_in_detail(typed_here, quick_cell) -> None:
    once = typed_here("cell", "validate", quick_cell.cell, "-v").err
    twice = typed_here("cell", "validate", quick_cell.cell, "-vv").err
    assert ("INFO hexacell.cell.loader" in once, "DEBUG" in once) == (True, False)
    assert "DEBUG hexacell.plugins: encoder protocol 'cia406' is" in twice


def test_a_failure_and_a_fault_are_logged(typed_here, quick_cell, tmp_path, monkeypatch) -> None:
    file = tmp_path / "hexacell.log"
    assert typed_here("status", tmp_path / "no.toml", "--log-file", file).code == 2
    assert "ERROR hexacell.cli.app: exit code 2: " in file.read_text()
    monkeypatch.setattr("hexacell.services.history.cell_status.cell_status", None)
    assert typed_here("status", quick_cell.cell, "--log-file", file).code == 70
    assert "TypeError: 'NoneType' object is not callable" in file.read_text()


def test_a_log_that_cannot_be_written_is_refused(typed_here, quick_cell, tmp_path) -> None:
    outcome = typed_here("status", quick_cell.cell, "--log-file", tmp_path)
    assert (outcome.code, outcome.out) == (2, "")
    assert "the log cannot be written: Is a directory" in outcome.err
    assert typed_here("status", quick_cell.cell, "--log-file", "/dev/full").code == 0
    outcome = typed_here("tui", quick_cell.cell, "-v")
    assert (outcome.code, "Name a file: --log-file FILE" in outcome.err) == (2, True)


def test_the_file_may_be_named_in_the_environment(typed_here, quick_cell, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("HEXACELL_LOG_FILE", str(tmp_path / "hexacell.log"))
    typed_here("status", quick_cell.cell)
    assert "exit code 0" in (tmp_path / "hexacell.log").read_text()
