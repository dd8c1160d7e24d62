"""Text for a run: how to resume it is a command that can be typed."""

import shlex

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cli.parser import make_parser
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import RunRequest
from hexacell.text.documents import run_document
from hexacell.text.run import closing_lines, resume_command, resume_hint
from hexacell.text.verdict import teaching_line, teaching_sentence
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator
from procedures.run.state import RunState
from procedures.steps import events


@pytest.fixture
def request_of(tmp_path):
    def make(mode: Mode) -> RunRequest:
        cell = load_cell(bundled_config("simulated-hexaglide"))
        return RunRequest(cell, RunFolder(tmp_path / "a run"), mode, UnattendedOperator())

    return make


@pytest.mark.parametrize("mode", Mode)
def test_the_resume_command_parses_to_the_same_request(request_of, mode):
    request = request_of(mode)
    program, *arguments = shlex.split(resume_command(request))
    options = make_parser().parse_args(arguments)
    assert program == "hexacell"
    assert (options.cell, options.resume) == (request.cell.path, str(request.folder.path))
    assert options.target == ("run.length" if mode is Mode.LENGTH else "run.main")
    named = mode.value if mode in {Mode.CHECK, Mode.QUICK} else None
    assert getattr(options, "mode", None) == named
    assert resume_hint(request).splitlines()[1].strip() == resume_command(request)


def test_one_line_before_the_result_says_what_must_be_taught_anew(request_of):
    moved = TaskDisplacement(position_mm=8.25, orientation_deg=3.0, poses=6, is_within_limits=False)
    ended = events.Ended(exit_code=0, line="all well", displacement=moved)
    request = request_of(Mode.OPTIMISE)
    where, teaching, line = closing_lines(request, ended)
    assert where.endswith(str(request.folder.path))
    assert (teaching, line) == (teaching_line(moved), "all well")
    document = run_document(request, ended, RunState())
    assert document["displacement"] == moved
    assert document["teaching"] == teaching_sentence(moved)
    untouched = run_document(request, events.Ended(exit_code=0, line="all well"), RunState())
    assert untouched["displacement"] is untouched["teaching"] is untouched["measured_noise"] is None
