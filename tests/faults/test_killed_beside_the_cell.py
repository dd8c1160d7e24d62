"""SIGKILL of a program whose cell runs in another process: the robot stays at its position."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tests.faults.cell import Site
from tests.faults.conftest import ROOT
from tests.faults.killing import KILLED, after, finish, places
from tests.faults.promises import require_identical
from tests.faults.steps import STEPS
from tests.signals import terminal_signals

STEPS_OF_A_RUN = [step for step in STEPS if step not in {"beginning", "revisiting", "ending"}]
"""Those that begin in a run that nothing has disturbed yet."""


@contextmanager
def served(site: Site) -> Iterator[None]:
    """Have another process serve the site's cell; its cell file leads there."""
    own = site.folder / "own.toml"
    site.cell_path.rename(own)
    with terminal_signals():
        simulating = subprocess.Popen(
            [sys.executable, "-m", "hexacell", "simulate", own, "--output", site.cell_path],
            cwd=ROOT,
            stderr=subprocess.PIPE,
            text=True,
        )
    with simulating as process:
        try:
            assert process.stderr is not None
            assert "serving" in process.stderr.readline()
            own.unlink()
            yield
        finally:
            process.terminate()


def run_over_killed(records: int, program: Any, site: Site, whole: Any) -> None:
    with served(site):
        assert program.run(site, **after(records)).code == KILLED
        finish(program, site, code=whole.ended.code)
        require_identical(site, whole.site)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("step", STEPS_OF_A_RUN)
def test_a_run_killed_at_any_kind_of_step_is_resumed(step, program, new_site, whole_with):
    whole = whole_with(step)
    records = places(whole.history)[step]
    run_over_killed(records, program, new_site(*whole.changes), whole)
