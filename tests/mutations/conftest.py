"""Sound cells and runs, from which mutated ones are made."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.mutations.attempts import Place
from tests.mutations.sound_cells import few_choices, make_templates
from tests.mutations.trials import Templates


@pytest.fixture(scope="session")
def templates(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Templates]:
    with few_choices():
        yield make_templates(tmp_path_factory.mktemp("templates"))


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return Place(tmp_path / "place")
