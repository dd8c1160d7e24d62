"""Protects that another term is one file: announced, sized, identified, told and judged."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.model import CellSettings
from hexacell.cell.uncertainty import ModelSettings
from hexacell.identification.estimator import identify
from hexacell.identification.terms.term import Finding
from hexacell.kinematics.corrections import CorrectionKind, Corrections
from hexacell.plugins import Group
from hexacell.results.term_result import FoundTerms, corrections_for, term_results
from hexacell.results.written_geometry import as_written
from hexacell.robot.stated import stated_terms
from hexacell.text.terms import found_sentence
from tests.benchmarks.worlds import budgets
from tests.benchmarks.worlds.campaigns import setting
from tests.benchmarks.worlds.not_geometry import effect_of
from tests.benchmarks.worlds.world import World
from tests.small_cell import changed

SPRINGS = """
from hexacell.identification.placement import leg_forces
from hexacell.identification.terms.term import ModelTerm

def springs(machine):
    def yields(placement, directions):
        return -0.1 * leg_forces(placement, machine.weight)

    def jumps(placement, directions, sizes):
        return 1e-3 * yields(placement, directions)[..., None] * sizes[:, None]

    return ModelTerm("springs", "um/N", machine.sizes.get("springs", 3.0), yields, on_either_side=jumps)
"""
STIFFNESS = np.array([0.3, 0.18, 0.27, 0.15, 0.24, 0.21])
"""um/N."""


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CellSettings:
    """A cell that looks for the term of a package of one file."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "springs_a.py").write_text(SPRINGS)
    info = tmp_path / "springs_a-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: springs_a\nVersion: 1.0\n")
    announced = f"[{Group.TERMS.entry_points}]\nsprings = springs_a:springs\n"
    (info / "entry_points.txt").write_text(announced)
    monkeypatch.delitem(sys.modules, "springs_a", raising=False)
    weight = {"uncertainty.own_weight_centre_mm": (5.0, -3.0, 20.0)}
    model = {"model.terms": ("backlash", "springs"), "model.sizes": {"springs": 0.3}}
    drawn: CellSettings = changed(setting(0).cell.settings, weight | model)
    return drawn


def test_it_is_made_with_the_size_that_the_cell_file_states(settings: CellSettings) -> None:
    backlash, springs = stated_terms(settings)
    assert (backlash.name, springs.name, springs.size) == ("backlash", "springs", 0.3)
    unstated = changed(settings, {"model.sizes": {}})
    assert stated_terms(unstated)[1].size == 3.0


@pytest.mark.parametrize("given", [{"terms": ["sprinx"]}, {"sizes": {"springs": 0.1}}])
def test_names_that_nothing_is_known_by_are_refused(given: dict[str, object]) -> None:
    with pytest.raises(ValidationError, match="no term"):
        ModelSettings.model_validate(given)


def test_it_is_identified_and_judged_though_no_controller_corrects_it(settings: CellSettings) -> None:
    own = setting(0)
    robot = replace(own.robot, effects=budgets.machine("precision"), terms=stated_terms(settings))
    world = World(robot, own.truth, effect_of({"compliance": STIFFNESS}), 1)
    found = identify(robot.problem(world.records(own.commands, robot.commanding)))
    _, springs = results = term_results(found)
    assert springs.finding is Finding.TAKEN
    assert (np.abs(np.array(springs.values) - STIFFNESS) < 4.0 * np.array(springs.sigma)).all()
    assert not any(Corrections().of("springs"))
    corrections, left = corrections_for(results, settings, list(CorrectionKind))
    assert (corrections, {*left}) == (None, {"springs"})
    after = replace(robot, holds=frozenset(CorrectionKind))
    written = as_written(settings, after, found.geometry, results).geometry
    assert written.largest_difference(robot.for_controller(found.geometry)) > 0.0, "it does what it can"
    budget = Task.of(settings, after, after.belief(found)).budget(found, after.belief(found), ())
    assert budget is not None
    assert [line.effect.unit for line in budget.lines] == ["um/N"], "springs on either side"
    assert "springs of" in (said := found_sentence(FoundTerms(results)))
    assert "no controller corrects it" in said
