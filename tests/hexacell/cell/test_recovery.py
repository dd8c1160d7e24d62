"""The [recovery] section: escalations that a cell may state, and those that it may not."""

import pytest

from hexacell.cell.recovery import Action, AttendedRecovery, FailureKind, UnattendedRecovery
from hexacell.errors import FileError


def test_a_cell_states_its_own_escalations(load_with) -> None:
    cell = load_with('[recovery]\nagreement_mm = 0.02\n[recovery.unattended]\ndrift = ["abort"]\n')
    recovery = cell.settings.recovery
    assert recovery.agreement_mm == 0.02
    assert recovery.unattended.action(FailureKind.DRIFT, 1) is Action.ABORT
    assert recovery.unattended.action(FailureKind.ZERO_VOID, 1) is Action.REDO_SET


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[recovery.unattended]\ndrift = ["redo-set"]\n', "drift must end with ask or abort"),
        ('[recovery.unattended]\ndrift = ["ask"]\n', "drift asks, but the run is unattended"),
        ("[recovery.attended]\ndrift = []\n", "drift must end with ask or abort"),
        ('[recovery.attended]\ndrift = ["pray"]\n', "retry"),
        ('[recovery.attended]\ndrifft = ["ask"]\n', "drift"),
    ],
)
def test_invalid_escalations_are_refused(load_with, text: str, words: str) -> None:
    with pytest.raises(FileError, match=words):
        load_with(text)


@pytest.mark.parametrize("escalations", [AttendedRecovery(), UnattendedRecovery()])
def test_there_is_an_escalation_for_every_kind_but_the_final_ones(escalations: AttendedRecovery) -> None:
    named = set(type(escalations).model_fields)
    assert named == {kind.value for kind in FailureKind} - {FailureKind.FINAL.value}
    assert escalations.action(FailureKind.FINAL, 1) is Action.ABORT
