"""Who uses an instrument whose certificate has expired is told before anything is measured."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize(("due", "is_told"), [("2020-01-01", True), ("9999-12-31", False)])
def test_an_expired_certificate_is_warned_about(typed_here, cell_folder, due, is_told) -> None:
    gauge = 'name = "x"\naxis = "x"\n'
    cell_folder.edit((gauge, f'{gauge}certificate = {{ number = "D-K 17", due = "{due}" }}\n'))
    outcome = typed_here("cell", "validate", cell_folder.cell)
    assert outcome.code == 0
    assert (f"the certificate of gauge x expired on {due}: a person must approve" in outcome.err) == is_told
