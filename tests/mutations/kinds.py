"""Which kinds of trials there are, and how often each is made."""

import random

from tests.mutations import hands, trials
from tests.mutations.prompts import answers_to_prompts
from tests.mutations.trials import Trial

SHARES: dict[Trial, int] = {
    trials.cell_file: 560,
    trials.config: 140,
    trials.odd_cell_file: 10,
    trials.records: 60,
    trials.cell_file_of_records: 10,
    trials.journal_replayed: 30,
    trials.journal_exported: 20,
    trials.journal_beside_records: 10,
    trials.run_resumed: 10,
    trials.run_checked: 5,
    answers_to_prompts: 5,
    trials.cell_file_scheduled: 60,
    trials.earlier_runs_listed: 30,
    trials.config_writes_listed: 20,
    trials.run_reported: 30,
    hands.output_named: 60,
    hands.run_with_a_link: 60,
    hands.odd_argument: 60,
}
"""How many of some 1200 trials are of which kind; those that compute much are rarer."""


def drawn_trial(draw: random.Random) -> Trial:
    """One of the kinds."""
    return draw.choices(list(SHARES), weights=list(SHARES.values()))[0]
