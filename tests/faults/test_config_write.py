"""SIGKILL before each call that writes the config or reverts it, without any cleaning up.

The same for every call in this process, and failures instead of deaths, are in
``tests/hexacell/config``; a power cut, which also loses what was written, in
``test_power_cut``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from tests.faults.interception import Call
from tests.faults.killing import KILLED, finish
from tests.faults.promises import require_identical

CONFIG = "simulated-hexaglide.controller.toml"
AFTERWARDS = 6
"""Calls after a replacement that are cut too: the folder's fsync, the note in the journal, ..."""


def writes_of_the_config(calls: Sequence[Call]) -> list[range]:
    """The numbers of the calls of each replacement of the config; the backup belongs to the first."""
    replaced = [number for number, call in enumerate(calls) if call.other.endswith(CONFIG)]
    backup = next(number for number, call in enumerate(calls) if call.other.endswith("config-before"))
    begun = [_begun(calls, number) for number in (backup, *replaced[1:])]
    return [range(first, last + AFTERWARDS) for first, last in zip(begun, replaced, strict=True)]


def _begun(calls: Sequence[Call], replaced: int) -> int:
    """The call that opened the temporary file that a later call moved to its place."""
    return next(n for n, call in enumerate(calls) if call.path == calls[replaced].path)


class Cutter:
    """Ends the process at a call, looks at the config, and goes on."""

    def __init__(self, program: Any, new_site: Any, whole: Any) -> None:
        self._program, self._new_site = program, new_site
        self._whole = whole
        self._after = whole.config_lent or whole.config_after

    def cut(self, number: int, step: str) -> str:
        """What the config is afterwards: old or new, and whether a temporary was left."""
        site = self._new_site(*self._whole.changes)
        assert self._program.run(site, failing={"at": number}).code == KILLED
        config = site.config.read_bytes()
        assert config in {self._whole.config_before, self._after}
        found = "new config" if config == self._after else "old config"
        left = bool(site.beside_the_config())
        finish(self._program, site, code=self._whole.ended.code)
        require_identical(site, self._whole.site)
        return f"{found}, leftover" if left else found


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_kill_at_any_call_of_a_write_back_or_rollback_leaves_a_valid_config(
    program: Any, new_site: Any, rolled_back: Any
) -> None:
    cutter = Cutter(program, new_site, rolled_back)
    committing, rolling_back = writes_of_the_config(rolled_back.ended.calls)
    require_cut_everywhere(cutter, committing, "committing", rolling_back, "rolling back")


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_kill_at_any_call_of_a_provisional_write_or_its_reversal_leaves_a_valid_config(
    program: Any, new_site: Any, lent: Any
) -> None:
    cutter = Cutter(program, new_site, lent)
    lending, taking_back, _ = writes_of_the_config(lent.ended.calls)
    require_cut_everywhere(cutter, lending, "lending", taking_back, "taking back")


def require_cut_everywhere(cutter: Cutter, there: range, to: str, back_again: range, back: str) -> None:
    found = [cutter.cut(number, to) for number in there]
    assert found == sorted(found, key=["old config", "old config, leftover", "new config"].index)
    assert {"old config", "old config, leftover", "new config"} == set(found)
    found = [cutter.cut(number, back) for number in back_again]
    assert {"new config", "new config, leftover", "old config"} == set(found)
