"""The uncertainty budget that ``fit`` prints has a line for every effect that matters."""

from dataclasses import replace

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.uncertainty import UncertaintySettings
from hexacell.config.interface import ControllerGeometry
from hexacell.robot.model import make_robot
from hexacell.robot.stated import stated_effects
from hexacell.text.identification import budget_table
from hexacell.verdict.assessment import assess
from hexacell.verdict.fit_document import fit_document


@pytest.fixture(scope="module")
def assessed_of(identified, noisy, paper):
    settings = load_cell(bundled_config("simulated-hexaglide")).settings
    robot = make_robot(settings, ControllerGeometry(paper.nominal, paper.branch))

    def assessed(range_k=None, **sizes):
        stated = settings.model_copy(update={"uncertainty": UncertaintySettings(**sizes)})
        machine = replace(robot, effects=stated_effects(stated, range_k))
        return assess(stated, machine, noisy, identified)

    return assessed


def test_every_effect_of_the_grade_that_matters_has_a_line(assessed_of) -> None:
    budget = assessed_of(grade="ordinary").budget
    lines = budget_table(budget).splitlines()
    assert max(map(len, lines)) <= 80
    (encoders,) = (line for line in lines if "scale of each encoder" in line)
    assert "20 um/m" in encoders
    (line,) = (line for line in budget.lines if line.effect.name == "scale of each encoder")
    assert encoders.split()[-3:] == [
        f"{mm:.3f}" for mm in (line.through_mm, line.direct_mm, line.combined_mm)
    ]
    assert budget_table(None) == "", "no task pose is reachable"
    (load,) = (line for line in lines if "load at work" in line)
    assert load.split()[-3] == "-"


def test_the_document_has_all_lines_and_their_sum(assessed_of) -> None:
    document = fit_document(assessed_of(range_k=0.4, grade="precision"))["uncertainty"]
    rows = {row["name"]: row for row in document["lines"]}
    assert rows["scale of each encoder"]["source"] == "assumed: precision"
    assert rows["temperature while measuring"]["size"] == 0.4
    assert rows["temperature while measuring"]["source"] == "thermometers"
    assert not rows["scale common to all encoders"]["visible"]
    assert rows["load at work"]["acts"] == "at work only"
    assert document["noise_mm"] < document["standard_mm"] < document["expanded_mm"]
