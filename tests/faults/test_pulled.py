"""Every device pulled out at every kind of step: put back at once, or left out and put back later."""

from __future__ import annotations

from typing import Any

import pytest

from procedures import events
from tests.faults.cell import NEVER_GOOD_ENOUGH, Site
from tests.faults.killing import finish, history_of
from tests.faults.promises import require_identical, require_valid
from tests.faults.pulling import DEVICES

TIMEOUT_S = 1.0
STEPS = (
    "locating",
    "to reference",
    "placing",
    "zeroing",
    "to orientation",
    "sampling",
    "closing",
    "identifying",
    "held-out",
    "proposing",
    "committing",
    "after",
    "judging",
)


class Puller:
    """Pulls a plug out of a run and says what became of it."""

    def __init__(self, program: Any, new_site: Any, undisturbed: Any, rolled_back: Any, case: Any) -> None:
        self._program, self._new_site, self._case = program, new_site, case
        self._good, self._bad = undisturbed, rolled_back

    def pull(self, device: str, step: str, *, back: bool) -> str:
        bad = step == "rolling back"
        whole = self._bad if bad else self._good
        site = self._new_site(NEVER_GOOD_ENOUGH if bad else {}, timeout_s=TIMEOUT_S)
        pulled = {"device": device, "step": step, "back": "failed" if back else ""}
        ended = self._program.run(site, pull=pulled)
        outcome = self._outcome(site, ended, whole)
        if not outcome.startswith("done"):
            finish(self._program, site, code=int(bad))
        require_valid(site.run())
        require_identical(site, whole.site)
        self._case(f"{device} out{' and back' if back else ''}", step, outcome)
        return outcome

    def _outcome(self, site: Site, ended: Any, whole: Any) -> str:
        history = history_of(site)
        config = site.config.read_bytes()
        if isinstance(history[-1], events.Ended):
            failures = [event for event in history if isinstance(event, events.Failed)]
            return "done, recovered" if failures else "done, not needed"
        assert isinstance(history[-1], events.Interrupted), ended.words
        assert ended.code in {3, 6}, ended.words
        if config == whole.config_before:
            return f"exit {ended.code}, old config, resumed"
        assert any(isinstance(event, events.Committed) for event in history), ended.words
        return f"exit {ended.code}, new config, resumed"


@pytest.fixture
def puller(program: Any, new_site: Any, undisturbed: Any, rolled_back: Any, case: Any) -> Puller:
    return Puller(program, new_site, undisturbed, rolled_back, case)


def test_a_gauge_that_comes_back_while_measuring(puller: Puller) -> None:
    assert puller.pull("gauge y", "sampling", back=True) == "done, recovered"


def test_a_controller_that_does_not_come_back(puller: Puller) -> None:
    assert puller.pull("controller", "to orientation", back=False) == "exit 3, old config, resumed"


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("back", [True, False], ids=["put back", "left out"])
@pytest.mark.parametrize("device", DEVICES)
def test_at_every_kind_of_step(device: str, back: bool, puller: Puller) -> None:
    for step in (*STEPS, "rolling back"):
        puller.pull(device, step, back=back)
