"""The chain of estimates where records are false: they are left out, and not sought for at every record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexacell.campaign import online_estimate as estimate_chain
from hexacell.campaign.online_estimate import SearchInVain, update_estimate
from hexacell.identification.estimator import estimate_online
from hexacell.identification.problem.data_requirements import is_overdetermined
from hexacell.identification.solver import multistart
from hexacell.measurements.records import MeasurementSet

FALSE = (2, 5)
OTHERS = (1, 3)
"""A record before the others determine anything."""


def one_mm_more(d):
    return np.add(d, [0.0, 0.0, 1.0])


def with_change(measurements, label, change):
    """The readings d (3,) of one record, or of all, replaced by ``change(d)``."""
    return MeasurementSet(
        tuple(
            replace(record, deviation=tuple(change(np.array(record.deviation)).tolist()))
            if label in {None, record.id}
            else record
            for record in measurements.records
        )
    )


@pytest.fixture
def chain(make_problem):
    """All estimates of the chain, that of the first record first."""

    def estimates(measurements, tries_others=True):
        last, every = None, []
        for count in range(1, len(measurements) + 1):
            problem = make_problem(MeasurementSet(measurements.records[:count]))
            last = update_estimate(problem, last, tries_others)
            every.append(last)
        return every

    return estimates


@pytest.mark.sample("label0")
@pytest.mark.parametrize("label", [FALSE, OTHERS, (2, 1), (3, 2)])
def test_a_false_record_is_left_out_and_changes_nothing(noisy, chain, make_problem, label):
    spoilt = with_change(noisy, label, one_mm_more)
    last = chain(spoilt)[-1]
    assert last.false_records == {label}
    others = MeasurementSet(tuple(record for record in noisy.records if record.id != label))
    without = estimate_online(make_problem(others))
    sigma = np.sqrt(np.diag(without.free_covariance))
    assert np.abs((last.identification.free - without.free) / sigma).max() < 1e-2


def test_no_record_of_good_ones_is_left_out(noisy, chain):
    assert not any(one.false_records for one in chain(noisy))


def test_a_false_record_is_left_out_as_soon_as_the_others_prove_it(noisy, chain):
    spoilt = with_change(noisy, OTHERS, one_mm_more)
    every = chain(spoilt)
    first = next(number for number, one in enumerate(every) if one.false_records)
    assert is_overdetermined(every[first].identification.problem)
    assert all(one.false_records == {OTHERS} for one in every[first:])
    assert first < 25


def test_a_robot_near_its_prior_keeps_all_records(noisy, chain):
    spoilt = with_change(noisy, FALSE, one_mm_more)
    last = chain(spoilt, tries_others=False)[-1]
    assert last.identification.records == len(noisy)
    assert not last.false_records


@pytest.mark.slow
def test_a_search_in_vain_is_not_repeated_at_every_record(noisy, chain, monkeypatch):
    searched = []
    restarts = multistart.restarts

    def counted(problem):
        searched.append(problem.records)
        return restarts(problem)

    monkeypatch.setattr(estimate_chain, "restarts", counted)
    every = chain(with_change(noisy, None, np.negative))
    assert every[-1].in_vain is not None
    assert 1 <= len(searched) <= 15
    implausible = [one for one in every if one.in_vain is not None]
    assert len(implausible) > 30


@pytest.mark.parametrize(
    ("cost", "records", "outdated"),
    [(100.0, 20, False), (199.0, 29, False), (200.0, 20, True), (100.0, 30, True), (10.0, 10, False)],
)
def test_a_search_is_repeated_for_twice_the_cost_or_half_as_many_records_again(cost, records, outdated):
    assert SearchInVain(cost=100.0, records=20).is_outdated(cost, records) is outdated
