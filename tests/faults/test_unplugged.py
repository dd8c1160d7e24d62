"""Every device unplugged at every kind of step, and plugged in again at once or before resuming."""

from typing import Any

import pytest

from procedures.steps import events
from tests.faults import promises
from tests.faults.cell import Site
from tests.faults.steps import DEVICES, STEPS

TIMEOUT_S = 1.0
PULLED = tuple(step for step in STEPS if step not in {"beginning", "ending"})
"""Before the first step nothing is plugged in, and after the last one nothing is needed."""


class Puller:
    """Pulls a plug out of a run and looks at what became of it."""

    def __init__(self, program: Any, new_site: Any, whole_with: Any) -> None:
        self._program, self._new_site = program, new_site
        self._whole_with = whole_with

    def pull(self, device: str, step: str, *, back: bool) -> None:
        whole = self._whole_with(step)
        site = self._new_site(*whole.changes, timeout_s=TIMEOUT_S)
        pulled = {"device": device, "step": step, "back": "failed" if back else ""}
        ended = self._begun(site, step, whole)(site, pull=pulled)
        is_over = self._is_over(site, ended, whole)
        assert step in promises.places(promises.history_of(site)), "nothing was pulled out"
        if not is_over:
            promises.finish(self._program, site, code=whole.ended.code)
        promises.require_valid(site.run())
        promises.require_identical(site, whole.site)

    def _begun(self, site: Site, step: str, whole: Any) -> Any:
        """What comes to the step: the run, or where only a resumed one does, its resumption."""
        if step in promises.places(whole.history):
            return self._program.run
        assert (
            self._program.run(site, **promises.after(promises.places(whole.history)["closing"])).code
            == promises.KILLED
        )
        return self._program.resume

    def _is_over(self, site: Site, ended: Any, whole: Any) -> bool:
        """Whether nothing is left to be resumed; a config that is not the old one was journalled."""
        history = promises.history_of(site)
        if isinstance(history[-1], events.Ended):
            return True
        assert isinstance(history[-1], events.Interrupted), ended.words
        assert ended.code in {3, 6}, ended.words
        found = whole.name_of(site.config.read_bytes())
        noted = {"new": "committed", "lent": "lent"}.get(found)
        assert not noted or any(event.kind == noted for event in history), ended.words
        return False


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("back", [True, False], ids=["put back", "left out"])
@pytest.mark.parametrize("device", DEVICES)
def test_any_device_unplugged_at_any_kind_of_step_is_handled(device, back, program, new_site, whole_with):
    puller = Puller(program, new_site, whole_with)
    for step in PULLED:
        puller.pull(device, step, back=back)
