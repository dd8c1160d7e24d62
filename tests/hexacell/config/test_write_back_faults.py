"""Every call to the file system that a commit or a rollback makes is made to fail, one by one."""

import math
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from hexacell.config.change import ConfigChange, Receipt, propose
from hexacell.config.layout import fingerprint
from hexacell.config.write_back import commit, rollback
from hexacell.errors import FileError, WriteBackUndone
from hexacell.kinematics.geometry import Geometry
from tests.native_config import NATIVE

Job = Callable[[Path], object]


class PowerCut(BaseException):
    """From here on this process does nothing any more."""


class Bench:
    """A config behind a symbolic link, and as many attempts at a job as the job makes calls."""

    def __init__(self, config: Path, folder: Path, geometry: Geometry, faults: Any) -> None:
        self.config = config
        self.link = config.parent / "link.toml"
        self.link.symlink_to(config.name)
        self.proposal = self._proposal(geometry)
        self.before = self.proposal.text_before.encode()
        self.after = self.proposal.text_after.encode()
        self._runs = (folder / f"run-{number}" for number in count())
        self._faults = faults

    def _proposal(self, geometry: Geometry) -> ConfigChange:
        return propose(
            (self.link,),
            NATIVE,
            geometry,
            fingerprint_at_start=fingerprint(self.link),
        )

    def attempts(
        self, prepare: Job, job: Job, **how: Any
    ) -> Iterator[tuple[str, Path, BaseException | None]]:
        """For each call that fails: which it is, the run folder, and what the job raised."""
        run = next(self._runs)
        prepare(run)
        with self._faults().active() as counter:
            job(run)
        assert {"open", "fsync", "replace", "fchmod", "lstat", "io.open"} <= set(counter.calls)
        for at, name in enumerate(counter.calls):
            run = next(self._runs)
            prepare(run)
            raised = None
            with self._faults(at=at, **how).active():
                try:
                    job(run)
                except (FileError, WriteBackUndone, PowerCut) as error:
                    raised = error
            assert self.link.is_symlink()
            yield f"call {at}, {name}", run, raised

    def reset(self, _: Path) -> None:
        self.config.write_bytes(self.before)

    def commit(self, run: Path) -> Receipt:
        return commit(self.proposal, run)

    def commit_afresh(self, run: Path) -> Receipt:
        self.reset(run)
        return self.commit(run)

    def left_behind(self) -> list[str]:
        return [path.name for path in self.config.parent.iterdir() if path not in {self.config, self.link}]


@pytest.fixture
def bench(config: Path, tmp_path: Path, geometry: Geometry, faults: Any) -> Bench:
    return Bench(config, tmp_path, geometry, faults)


def test_any_single_failure_of_a_commit_leaves_the_old_config(bench: Bench) -> None:
    undone = 0
    for name, _, raised in bench.attempts(bench.reset, bench.commit):
        assert bench.config.read_bytes() == (bench.after if raised is None else bench.before), name
        assert bench.left_behind() == [], name
        undone += isinstance(raised, WriteBackUndone)
    assert undone >= 4  # the folder cannot be opened, synced or closed; the file not be read back


@pytest.mark.parametrize("width", [2, 5, math.inf])
def test_consecutive_failures_leave_the_old_or_new_config_and_a_correct_message(
    bench: Bench, width: float
) -> None:
    found = set()
    for name, run, raised in bench.attempts(bench.reset, bench.commit, width=width):
        text = bench.config.read_bytes()
        found.add(text)
        if raised is None:
            assert text == bench.after, name
        elif "may hold the new geometry" in str(raised):
            assert text in {bench.before, bench.after}, name
            assert str(run / "config-before") in str(raised), name
        else:
            assert text == bench.before, name
    assert found == {bench.before, bench.after}


def test_a_power_cut_leaves_the_old_config_or_the_new_one_with_its_backup(bench: Bench) -> None:
    ends = []
    for name, run, raised in bench.attempts(bench.reset, bench.commit, width=math.inf, error=PowerCut):
        text = bench.config.read_bytes()
        ends.append(text)
        if text == bench.after:
            assert bench.commit(run) == Receipt.of(run), name  # the resumed run finds it done
            rollback(Receipt.of(run))
        assert isinstance(raised, PowerCut), name
        assert bench.config.read_bytes() == bench.before, name
    assert bench.after in ends
    assert bench.before in ends


def test_a_commit_can_be_made_after_any_interrupted_one(bench: Bench) -> None:
    for name, run, _ in bench.attempts(bench.reset, bench.commit, width=math.inf, error=PowerCut):
        bench.commit(run)
        assert bench.config.read_bytes() == bench.after, name
        rollback(Receipt.of(run))


@pytest.mark.parametrize("width", [1, math.inf])
def test_a_rollback_that_fails_leaves_one_of_both_and_can_be_repeated(bench: Bench, width: float) -> None:
    for name, run, raised in bench.attempts(
        bench.commit_afresh, lambda run: rollback(Receipt.of(run)), width=width
    ):
        text = bench.config.read_bytes()
        assert text in {bench.before, bench.after}, name
        if raised is not None and text == bench.before:
            assert "was replaced" in str(raised) or "cannot be read" in str(raised), name
        rollback(Receipt.of(run))
        assert bench.config.read_bytes() == bench.before, name
