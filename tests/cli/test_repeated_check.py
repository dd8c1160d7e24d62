"""An unattended check that raised an alarm is made once more, and that one is the outcome."""

from pathlib import Path
from typing import Any

import pytest

from hexacell.checks.change_alarm import ChangeAlarm
from hexacell.checks.check_result import CheckResult
from hexacell.cli.commands.run import NOT_REPEATED_ALARM, REPEATED, REPEATED_ALARM
from hexacell.errors import ExitCode
from hexacell.services.run.calibration_run import RunRequest
from hexacell.verdict.decision import Verdict
from procedures.journal.journal import Journal
from procedures.steps import events

ALARM: dict[str, Any] = {
    "records": 8, "limit": 3.5, "leg": 4, "parameter": "l4", "unit": "mm", "change": 0.05, "sigma": 0.01,
}  # fmt: skip


def judged(score: float, verdict: Verdict) -> events.ResultValidated:
    check = CheckResult(verdict=verdict, records=16, points=2, alarm=ChangeAlarm(score=score, **ALARM))
    return events.ResultValidated(verdict=verdict, line=verdict.value, check=check)


@pytest.fixture
def checks(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, Verdict]]:
    """The scores and verdicts of the checks that will be made, in their order; those made are removed."""
    coming: list[tuple[float, Verdict]] = []

    def execute(request: RunRequest, *_: object) -> events.Ended:
        score, verdict = coming.pop(0)
        code = ExitCode.DONE if verdict is Verdict.PASS else ExitCode.OUT_OF_LIMITS
        ended = events.Ended(exit_code=code, line=verdict.value)
        request.folder.create(request.cell)
        with Journal(request.folder.journal) as journal:
            journal.append(judged(score, verdict))
            journal.append(ended)
        return ended

    monkeypatch.setattr("hexacell.cli.commands.run.execute_run", execute)
    return coming


def folders(cell: Path) -> list[Path]:
    return sorted((cell.parent / "runs" / "simulated-hexaglide").iterdir())


@pytest.mark.parametrize(
    ("second", "verdict", "words"),
    [(5.0, Verdict.PASS, REPEATED_ALARM), (1.0, Verdict.PASS, NOT_REPEATED_ALARM), (5.0, Verdict.FAIL, "")],
)
def test_the_second_check_is_the_outcome(cell_folder, typed_here, checks, second, verdict, words) -> None:
    checks += [(5.0, Verdict.PASS), (second, verdict), (9.0, Verdict.PASS)]
    ran = typed_here("run", cell_folder.cell, "--unattended", "--json")
    assert (REPEATED in ran.err, words in ran.err) == (True, True)
    first, again = folders(cell_folder.cell)
    assert ran.document["run"] == str(again)
    assert ran.document["verdict"] == verdict.value
    assert ran.code == (0 if verdict is Verdict.PASS else 1)
    assert len(checks) == 1
    assert first != again


@pytest.mark.parametrize(
    ("score", "verdict", "is_attended"),
    [(1.0, Verdict.PASS, False), (5.0, Verdict.FAIL, False), (5.0, Verdict.PASS, True)],
    ids=["no alarm", "a failure", "a person decides"],
)
def test_otherwise_there_is_one_check(
    cell_folder, typed_here, checks, monkeypatch, score, verdict, is_attended
) -> None:
    monkeypatch.setattr("hexacell.cli.commands.run.is_interactive", lambda: is_attended)
    checks += [(score, verdict), (5.0, Verdict.PASS)]
    options = ("--mode", "check") if is_attended else ("--unattended",)
    assert REPEATED not in typed_here("run", cell_folder.cell, *options).out
    assert len(folders(cell_folder.cell)) == 1
