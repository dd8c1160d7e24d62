"""A sample of the mutations of ``tests/benchmarks/test_mutations.py``."""

from __future__ import annotations

import random

import pytest

from tests.mutations.kinds import SHARES

EACH = 5
"""Trials of each kind."""


@pytest.mark.parametrize("trial", SHARES, ids=lambda trial: trial.__name__)
def test_mutated_input_is_refused_or_used_and_never_more(trial, templates, place):
    found = [trial(templates, place, random.Random(seed)) for seed in range(EACH)]
    wrong = [f"seed {seed}: {one}" for seed, one in enumerate(found) if one.problems]
    assert not wrong, "\n".join(wrong)
