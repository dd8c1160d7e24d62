"""A sample of the mutations of ``tests/benchmarks/test_mutations.py``."""

import random
from collections.abc import Iterator

import pytest

from tests.mutations.attempts import Place
from tests.mutations.kinds import SHARES
from tests.mutations.sound_cells import few_choices, make_templates
from tests.mutations.trials import Templates

SAMPLE, EACH = 1, 20
"""Trials of each kind in ``make test`` and in ``make test-full``."""


@pytest.fixture(scope="module")
def templates(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Templates]:
    with few_choices():
        yield make_templates(tmp_path_factory.mktemp("templates"))


@pytest.mark.parametrize("number", [SAMPLE, pytest.param(EACH, marks=pytest.mark.slow)])
@pytest.mark.parametrize("trial", SHARES, ids=lambda trial: trial.__name__)
def test_mutated_input_is_refused_or_used_and_never_more(trial, number, templates, tmp_path):
    place = Place(tmp_path / "place")
    found = [trial(templates, place, random.Random(seed)) for seed in range(number)]
    wrong = [f"seed {seed}: {one}" for seed, one in enumerate(found) if one.problems]
    assert not wrong, "\n".join(wrong)
