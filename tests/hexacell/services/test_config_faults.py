"""``apply`` and ``rollback`` cut off at every call to the file system: the config is one or the other."""

import asyncio
import math
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from hexacell.cell.loader import Cell
from hexacell.config.change import RECEIPT
from hexacell.config.write_back import commit
from hexacell.config.write_record import RECORDS
from hexacell.runs.cell_lock import cell_lock
from hexacell.services.write_back.config_rollback import roll_back_config
from hexacell.services.write_back.proposals import apply_proposal, read_proposal
from hexacell.storage.atomic_files import remove_stale_temporaries
from procedures.engine.commands import UnattendedOperator
from tests.hexacell.config.conftest import Faults
from tests.hexacell.services.proposed_runs import ProposedRun, propose_run

pytestmark = pytest.mark.usefixtures("records_agree")

Job = Callable[[], object]


class PowerCut(BaseException):
    """From here on this process does nothing any more."""


def cut_at_calls(cell: Cell, prepare: Job, job: Job, stride: int) -> dict[bytes, int]:
    """How often the config was found as what; whoever repeats the job afterwards completes it."""
    prepare()
    counter = Faults()
    with counter.active():
        job()
    completed = cell.config_path.read_bytes()
    found: dict[bytes, int] = {}
    for number in range(0, len(counter.calls), stride):
        prepare()
        with Faults(at=number, width=math.inf, error=PowerCut).active(), pytest.raises(PowerCut):
            job()
        let_go_of_lock()
        config = cell.config_path.read_bytes()
        found[config] = found.get(config, 0) + 1
        with cell_lock(cell.config_path):
            pass
        job()
        assert cell.config_path.read_bytes() == completed
    return found


def let_go_of_lock() -> None:
    """What the kernel does for a process that is gone."""
    for descriptor in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):
            if descriptor.readlink().name.endswith(".hexacell-lock"):
                os.close(int(descriptor.name))


def applied(run: ProposedRun) -> None:
    asyncio.run(apply_proposal(read_proposal(run.folder), UnattendedOperator()))


EVERY = pytest.param(1, marks=pytest.mark.slow, id="every call")
SOME = pytest.param(5, id="some calls")


@pytest.mark.parametrize("stride", [SOME, EVERY])
def test_a_proposal_is_applied_whole_or_not_at_all(cell, stride: int) -> None:
    run = propose_run(cell)

    def prepare() -> None:
        cell.config_path.write_bytes(run.before)
        (run.folder.siblings / RECORDS).unlink(missing_ok=True)
        for name in ("applied.json", RECEIPT, "config-before", "config-after"):
            (run.folder.path / name).unlink(missing_ok=True)
        remove_stale_temporaries(run.folder.path)  # each is looked at by the next one

    found = cut_at_calls(cell, prepare, lambda: applied(run), stride)
    assert set(found) == {run.before, run.after}


@pytest.mark.parametrize("stride", [SOME, EVERY])
@pytest.mark.parametrize("to", [None, "a"])
def test_a_rollback_is_whole_or_not_at_all(cell, to, stride: int) -> None:
    runs = [propose_run(cell, "a")]
    commit(runs[0].change, runs[0].folder.path)
    runs.append(propose_run(cell, "b"))
    commit(runs[1].change, runs[1].folder.path)

    def prepare() -> None:
        cell.config_path.write_bytes(runs[1].after)
        (runs[1].folder.siblings / RECORDS).unlink(missing_ok=True)

    def job() -> None:
        if cell.config_path.read_bytes() == runs[1].after:  # who is told that it is done does not repeat it
            roll_back_config(cell, to)

    found = cut_at_calls(cell, prepare, job, stride)
    assert set(found) == {runs[1].after, runs[0].after}
