"""SIGKILL after and within records, at random instants, while a run resumes, beside a living cell.

Also before each call that writes the config or reverts it, without any cleaning up. The same for every call
in this process, and failures instead of deaths, are in ``tests/hexacell/config``; a power cut, which also
loses what was written, in ``test_power_cut``.
"""

import random
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import pytest

from procedures.steps import events
from tests.faults.cell import Site
from tests.faults.conftest import ROOT
from tests.faults.interception import Call
from tests.faults.promises import KILLED, after, finish, history_of, places, require_identical, within
from tests.faults.steps import STEPS
from tests.signals import terminal_signals

Break = Callable[..., None]


@pytest.fixture
def kill(program: Any, new_site: Any, undisturbed: Any) -> Break:
    """Kill a run, and its resumptions as often as more ways to die are given; then finish it."""

    def broken(*deaths: dict[str, Any]) -> None:
        site = new_site()
        for number, death in enumerate(deaths):
            begun = number > 0 and history_of(site)
            ended = program.resume(site, **death) if begun else program.run(site, **death)
            assert ended.code == KILLED or (number and ended.code in {0, 2}), ended.words
        finish(program, site)
        require_identical(site, undisturbed.site)

    return broken


def test_a_run_killed_within_a_record_and_again_after_resuming_is_resumed(undisturbed, kill):
    kill(within(places(undisturbed.history)["committing"]), after(1))


@pytest.mark.slow
@pytest.mark.timeout(3600)
class TestAllKills:
    def test_a_run_killed_after_any_record_is_resumed(self, undisturbed: Any, kill: Break) -> None:
        for records in range(1, len(undisturbed.history) + 1):
            kill(after(records))

    def test_a_run_killed_within_a_record_of_any_kind_of_step_is_resumed(self, undisturbed, kill):
        for record in places(undisturbed.history).values():
            kill(within(record))
            kill(within(record + 1))

    def test_a_run_killed_again_while_it_resumes_is_resumed(self, undisturbed: Any, kill: Break) -> None:
        for records in places(undisturbed.history).values():
            for more in (1, 2, 3, 5, 8):
                kill(after(records), after(more))

    def test_a_run_killed_six_times_is_resumed(self, undisturbed: Any, kill: Break) -> None:
        for records in (5, 40, 90, 120):
            kill(*[after(records), within(2), after(7), after(1), within(4), after(9)])


def own_records(step: str, history: Sequence[events.Event]) -> range:
    """The records of a run at which it does what other runs do not."""
    first = places(history)["committing" if step == "rolling back" else step]
    if step == "rolling back":
        return range(first, len(history) + 1)
    if step != "measuring noise":
        return range(first - 1, first + 4)
    [last] = (n for n, event in enumerate(history, start=1) if isinstance(event, events.NoiseMeasured))
    return range(first - 1, last + 1)


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("step", ["rolling back", "lending", "taking back", "measuring noise"])
def test_a_run_killed_at_any_record_that_other_runs_do_not_have_is_resumed(
    step: str, program: Any, new_site: Any, whole_with: Any
) -> None:
    whole = whole_with(step)
    for records in own_records(step, whole.history):
        site = new_site(*whole.changes)
        assert program.run(site, **after(records)).code == KILLED
        finish(program, site, code=whole.ended.code)
        require_identical(site, whole.site)


INSTANTS = 200

SOONER = 0.95


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_run_killed_at_a_random_instant_is_resumed(program: Any, new_site: Any, undisturbed: Any) -> None:
    duration_s = undisturbed.ended.seconds
    for share in instants(INSTANTS):
        site, duration_s = killed(program, new_site, share, duration_s)
        finish(program, site)
        require_identical(site, undisturbed.site)


def instants(number: int) -> list[float]:
    """Evenly over the time that a run takes, as shares of it, each moved at random."""
    chance = random.Random(number)
    return [(place + chance.random()) / number for place in range(number)]


def killed(program: Any, new_site: Any, share: float, duration_s: float) -> tuple[Any, float]:
    """A run killed at an instant of it; and how long a run takes, less if it was over already then."""
    while True:
        site = new_site()
        ended = program.run(site, die_after_s=share * duration_s)
        if ended.code == KILLED:
            return site, duration_s
        assert ended.code == 0, ended.words
        duration_s = SOONER * min(duration_s, ended.seconds)


STEPS_OF_A_RUN = [step for step in STEPS if step not in {"beginning", "revisiting", "ending"}]
"""Those that begin in a run that nothing has disturbed yet."""


@contextmanager
def served(site: Site) -> Iterator[None]:
    """Have another process serve the site's cell; its cell file leads there."""
    own = site.folder / "own.toml"
    site.cell_path.rename(own)
    with terminal_signals():
        simulating = subprocess.Popen(
            [sys.executable, "-m", "hexacell", "simulate", own, "--output", site.cell_path],
            cwd=ROOT,
            stderr=subprocess.PIPE,
            text=True,
        )
    with simulating as process:
        try:
            assert process.stderr is not None
            assert "serving" in process.stderr.readline()
            own.unlink()
            yield
        finally:
            process.terminate()


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("step", STEPS_OF_A_RUN)
def test_a_run_killed_at_any_kind_of_step_is_resumed(step, program, new_site, whole_with):
    whole = whole_with(step)
    site = new_site(*whole.changes)
    with served(site):
        assert program.run(site, **after(places(whole.history)[step])).code == KILLED
        finish(program, site, code=whole.ended.code)
        require_identical(site, whole.site)


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
@pytest.mark.parametrize(("to", "back"), [("committing", "rolling back"), ("lending", "taking back")])
def test_a_kill_at_any_call_of_a_write_or_its_reversal_leaves_a_valid_config(
    program: Any, new_site: Any, whole_with: Any, to: str, back: str
) -> None:
    whole = whole_with(back)
    there, back_again, *_ = writes_of_the_config(whole.ended.calls)
    require_cut_everywhere(Cutter(program, new_site, whole), there, to, back_again, back)


def require_cut_everywhere(cutter: Cutter, there: range, to: str, back_again: range, back: str) -> None:
    found = [cutter.cut(number, to) for number in there]
    assert found == sorted(found, key=["old config", "old config, leftover", "new config"].index)
    assert {"old config", "old config, leftover", "new config"} == set(found)
    found = [cutter.cut(number, back) for number in back_again]
    assert {"new config", "new config, leftover", "old config"} == set(found)
