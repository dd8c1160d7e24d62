"""SIGKILL of a program whose cell lives in another process: the robot stays where it was left."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from tests.faults.cell import Site
from tests.faults.conftest import ROOT
from tests.faults.killing import KILLED, after, finish, history_of, places
from tests.faults.matrix import step_of
from tests.faults.promises import require_identical


@pytest.fixture
def served(new_site: Any) -> Iterator[Site]:
    """A cell that another process serves; its site's cell file leads there."""
    site = new_site()
    own = site.folder / "own.toml"
    site.cell_path.rename(own)
    with subprocess.Popen(
        [sys.executable, "-m", "hexacell", "simulate", own, "--output", site.cell_path],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        assert "serving" in process.stderr.readline()
        own.unlink()
        yield site
        process.terminate()


def run_over_killed(records: int, program: Any, site: Site, undisturbed: Any, case: Any) -> None:
    assert program.run(site, **after(records)).code == KILLED
    step = step_of(history_of(site))
    case("killed beside a living cell", step, finish(program, site))
    require_identical(site, undisturbed.site)


def test_in_a_set(program: Any, served: Site, undisturbed: Any, case: Any) -> None:
    run_over_killed(places(undisturbed.history)["sampling"] + 20, program, served, undisturbed, case)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "step", ["to reference", "to orientation", "closing", "held-out", "committing", "after"]
)
def test_at_each_kind_of_step(step: str, program: Any, served: Site, undisturbed: Any, case: Any) -> None:
    run_over_killed(places(undisturbed.history)[step], program, served, undisturbed, case)
