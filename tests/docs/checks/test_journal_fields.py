"""The docs have the meaning, and for numbers the unit, of every field of the journal."""

import re
from pathlib import Path

import pytest

from docs.generated import field_key, field_meanings, journal_models
from procedures.journal.journal import VERSION

PAGE = (Path(__file__).parents[3] / "docs" / "journal.md").read_text(encoding="utf-8")
MEANINGS = field_meanings()
NUMBERS = re.compile(r"\bnumbers?\b")
QUOTED = re.compile(r"`[^`]*`")
FIELDS = {heading: fields for heading, (_, fields) in journal_models().items()}


@pytest.mark.parametrize(("heading", "fields"), FIELDS.items(), ids=list(FIELDS))
def test_every_field_has_a_meaning_and_every_number_a_unit(heading, fields):
    for name, words in fields.items():
        unit, meaning = MEANINGS[field_key(heading, name, MEANINGS)]
        assert meaning, name
        assert unit or not NUMBERS.search(QUOTED.sub("", words)), name


def test_no_other_field_is_described_nor_another_version() -> None:
    used = {field_key(heading, name, MEANINGS) for heading, fields in FIELDS.items() for name in fields}
    assert set(MEANINGS) == used
    assert f"`version` is {VERSION}" in PAGE
