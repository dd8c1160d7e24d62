"""Every call to the file system that a commit or a rollback makes is made to fail, one by one."""

import math

import pytest

from hexacell.config.change import Receipt
from hexacell.config.pending_write import is_interrupted, note_write, settle_interrupted_write
from hexacell.config.write_back import rollback
from hexacell.errors import WriteBackUndone
from tests.hexacell.config.conftest import Bench, PowerCut


def test_any_single_failure_of_a_commit_leaves_the_old_config(either: Bench) -> None:
    undone = 0
    for name, _, raised in either.attempts(either.reset, either.commit):
        assert either.found == (either.after if raised is None else either.before), name
        settle_interrupted_write(either.files)  # a note may be left of what is undone
        assert either.found == (either.after if raised is None else either.before), name
        assert either.left_behind() == [], name
        undone += isinstance(raised, WriteBackUndone)
    assert undone >= 4 * len(either.files)  # the folder cannot be opened or synced; the file not be read


@pytest.mark.sample("one-*", "two-inf")
@pytest.mark.parametrize("width", [2, 5, math.inf])
def test_consecutive_failures_leave_what_the_message_says_or_what_is_undone_next(
    either: Bench, width: float
) -> None:
    kept, halves = ["config-before", "config-before-2"][: len(either.files)], 0
    for name, run, raised in either.attempts(either.reset, either.commit, width=width):
        if raised is None:
            assert either.found == either.after, name
        elif "may hold the new geometry" in str(raised):
            halves += either.found != either.before
            assert " and ".join(str(run / one) for one in kept) in str(raised), name
        else:
            assert either.found == either.before, name
        settle_interrupted_write(either.files)
        assert not either.is_mixed, name
    assert halves or math.isfinite(width)


@pytest.mark.sample("one-*", "two-commit")
@pytest.mark.parametrize("job", ["commit", "rollback"])
def test_a_power_cut_at_any_moment_is_settled(either: Bench, job: str) -> None:
    doing, prepare = {
        "commit": (either.commit, either.reset),
        "rollback": (lambda run: rollback(Receipt.of(run)), either.commit_afresh),
    }[job]
    mixed, ends = 0, set()
    for name, run, raised in either.attempts(prepare, doing, width=math.inf, error=PowerCut):
        assert isinstance(raised, PowerCut), name
        if was_mixed := either.is_mixed:
            assert is_interrupted(either.files), name
        settled = settle_interrupted_write(either.files)
        assert not either.is_mixed, name
        assert not is_interrupted(either.files), name
        if was_mixed:
            assert settled is not None, name
            assert settled.endswith("between them: hexapod.hal got the old content back"), name
        mixed += was_mixed
        ends.add(either.found)
        doing(run)  # whatever was left, it can be done again
        assert either.found == (either.after if job == "commit" else either.before), name
        rollback(Receipt.of(run))
        assert either.found == either.before, name
    assert ends == {either.before, either.after}
    assert bool(mixed) is (len(either.files) > 1)


@pytest.mark.sample("one-*")
@pytest.mark.parametrize("width", [1, math.inf])
def test_a_rollback_that_fails_leaves_one_of_both_and_can_be_repeated(either: Bench, width: float) -> None:
    for name, run, raised in either.attempts(
        either.commit_afresh, lambda run: rollback(Receipt.of(run)), width=width
    ):
        if len(either.files) == 1 and raised is not None and either.found == either.before:
            assert "was replaced" in str(raised) or "cannot be read" in str(raised), name
        settle_interrupted_write(either.files)
        assert not either.is_mixed, name
        rollback(Receipt.of(run))
        assert either.found == either.before, name


def test_what_is_settled_can_itself_be_cut_off(bench: Bench) -> None:
    def half(run: object) -> None:
        note_write(bench.files, bench.before, bench.after)
        bench.files[0].write_bytes(bench.after[0])
        bench.files[1].write_bytes(bench.before[1])

    for name, _, _ in bench.attempts(
        half, lambda _: settle_interrupted_write(bench.files), width=math.inf, error=PowerCut
    ):
        settle_interrupted_write(bench.files)
        assert bench.found == bench.before, name
