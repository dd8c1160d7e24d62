"""Which kinds of trials there are, and how often each is made."""

from __future__ import annotations

import random

from tests.mutations import trials
from tests.mutations.prompts import answers_to_prompts
from tests.mutations.trials import Trial

SHARES: dict[Trial, int] = {
    trials.cell_file: 60,
    trials.config: 13,
    trials.records: 9,
    trials.cell_file_of_records: 3,
    trials.journal_replayed: 6,
    trials.journal_exported: 3,
    trials.journal_beside_records: 2,
    trials.run_resumed: 2,
    trials.run_checked: 1,
    answers_to_prompts: 1,
}
"""How many of a hundred trials are of which kind."""


def drawn_trial(draw: random.Random) -> Trial:
    """One of the kinds."""
    return draw.choices(list(SHARES), weights=list(SHARES.values()))[0]
