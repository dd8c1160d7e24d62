"""SIGKILL after every record of a run, within records, and again while it is resumed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from procedures.steps import events
from tests.faults.killing import KILLED, after, finish, history_of, places, within
from tests.faults.matrix import step_of
from tests.faults.promises import require_identical

Break = Callable[..., None]


@pytest.fixture
def kill(program: Any, new_site: Any, undisturbed: Any, case: Any) -> Break:
    """Kill a run, and its resumptions as often as more ways to die are given; then finish it."""

    def broken(fault: str, *deaths: dict[str, Any]) -> None:
        site = new_site()
        for number, death in enumerate(deaths):
            begun = number > 0 and history_of(site)
            ended = program.resume(site, **death) if begun else program.run(site, **death)
            assert ended.code == KILLED or (number and ended.code in {0, 2}), ended.words
            if number == 0:
                step = step_of(history_of(site))
        outcome = finish(program, site)
        case(fault, step, outcome)
        require_identical(site, undisturbed.site)

    return broken


class TestSelectedKills:
    @pytest.mark.slow
    def test_a_run_killed_between_a_step_and_its_record_is_resumed(
        self, undisturbed: Any, kill: Break
    ) -> None:
        kill("killed after a record", after(places(undisturbed.history)["sampling"]))

    def test_a_run_killed_with_an_unverified_config_is_resumed(self, undisturbed: Any, kill: Break) -> None:
        kill("killed after a record", after(places(undisturbed.history)["after"]))

    def test_a_run_killed_within_a_record_and_again_after_resuming_is_resumed(
        self, undisturbed: Any, kill: Break
    ) -> None:
        kill("killed twice", within(places(undisturbed.history)["committing"]), after(1))


@pytest.mark.slow
@pytest.mark.timeout(3600)
class TestAllKills:
    def test_a_run_killed_after_any_record_is_resumed(self, undisturbed: Any, kill: Break) -> None:
        for records in range(1, len(undisturbed.history) + 1):
            kill("killed after a record", after(records))

    def test_a_run_killed_within_a_record_of_any_kind_of_step_is_resumed(
        self, undisturbed: Any, kill: Break
    ) -> None:
        for record in places(undisturbed.history).values():
            kill("killed within a record", within(record))
            kill("killed within a record", within(record + 1))

    def test_a_run_killed_again_while_it_resumes_is_resumed(self, undisturbed: Any, kill: Break) -> None:
        for records in places(undisturbed.history).values():
            for more in (1, 2, 3, 5, 8):
                kill("killed twice", after(records), after(more))

    def test_a_run_killed_six_times_is_resumed(self, undisturbed: Any, kill: Break) -> None:
        for records in (5, 40, 90, 120):
            kill("killed six times", *[after(records), within(2), after(7), after(1), within(4), after(9)])


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_result_to_be_rolled_back_is_rolled_back_after_a_kill_at_any_record(
    program: Any, new_site: Any, rolled_back: Any, case: Any
) -> None:
    history = rolled_back.history
    for records in range(places(history)["committing"], len(history) + 1):
        site = new_site(*rolled_back.changes)
        assert program.run(site, **after(records)).code == KILLED
        step = step_of(history_of(site))
        outcome = finish(program, site, code=1)
        require_identical(site, rolled_back.site)
        assert site.config.read_bytes() == rolled_back.config_before
        case("killed after a record, bad result", step, outcome)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_provisional_geometry_is_reverted_after_a_kill_at_any_record(
    program: Any, new_site: Any, lent: Any, case: Any
) -> None:
    begun = places(lent.history)
    for first in (begun["lending"], begun["taking back"]):
        for records in range(first - 1, first + 4):
            site = new_site(*lent.changes)
            assert program.run(site, **after(records)).code == KILLED
            step = step_of(history_of(site))
            outcome = finish(program, site)
            require_identical(site, lent.site)
            case("killed after a record, lending", step, outcome)


def noise_records(whole: Any) -> range:
    """The records from the first reference's to that of the measured noise."""
    (last,) = (
        number
        for number, event in enumerate(whole.history, start=1)
        if isinstance(event, events.NoiseMeasured)
    )
    return range(places(whole.history)["measuring noise"] - 1, last + 1)


@pytest.fixture
def kill_while_measuring_noise(
    program: Any, new_site: Any, noise_measured: Any, case: Any
) -> Callable[[int], None]:
    def broken(records: int) -> None:
        site = new_site(*noise_measured.changes)
        assert program.run(site, **after(records)).code == KILLED
        step = step_of(history_of(site))
        outcome = finish(program, site)
        require_identical(site, noise_measured.site)
        case("killed after a record", step, outcome)

    return broken


@pytest.mark.slow
def test_a_run_killed_while_it_measures_the_noise_is_resumed(
    noise_measured: Any, kill_while_measuring_noise: Any
) -> None:
    records = noise_records(noise_measured)
    kill_while_measuring_noise(records[len(records) // 2])


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_run_killed_after_any_record_of_the_noise_is_resumed(
    noise_measured: Any, kill_while_measuring_noise: Any
) -> None:
    for records in noise_records(noise_measured):
        kill_while_measuring_noise(records)
