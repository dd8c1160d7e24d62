"""What ``hexacell fit`` prints: the verdict first, no line too wide, nothing that matters left out."""

import json
import math
import re
from dataclasses import replace

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.uncertainty import UncertaintySettings
from hexacell.cli.app import main
from hexacell.config.interface import ControllerGeometry
from hexacell.errors import ExitCode
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.measurements.csv_file import write_measurements
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import make_robot
from hexacell.robot.stated import stated_effects
from hexacell.text.identification import budget_table
from hexacell.verdict.assessment import assess
from hexacell.verdict.fit_document import fit_document


@pytest.fixture
def fit(tmp_path, capsys):
    def run(measurements, *options, is_incomplete=False):
        file = tmp_path / "measured.csv"
        write_measurements(file, measurements)
        code = main(
            ["fit", str(bundled_config("simulated-hexaglide")), "--measurements", str(file), *options]
        )
        assert code == (ExitCode.OUT_OF_LIMITS if is_incomplete else ExitCode.DONE)
        return capsys.readouterr()

    return run


def test_the_report_has_every_free_parameter(fit, noisy):
    text = fit(noisy).out
    assert text.startswith("Good: the records agree with the stated noise.\n")
    lines = text.splitlines()
    named = [line.split()[0] for line in lines if line.endswith("sigma)")]
    fixed = {"S2x", "S2y", "S2z", "S3z"}
    assert named == [name for name in HEXAGLIDE_PARAMETERS.names if name not in fixed]
    (leg,) = (line for line in lines if line.startswith("l1 "))
    _, old, new, change, sigma, _, times, _ = leg.replace("(", "").split()
    assert float(new) - float(old) == pytest.approx(float(change), abs=2e-3)
    assert float(times) == pytest.approx(abs(float(change)) / float(sigma), rel=0.02)
    said = " ".join(text.split())
    assert "Repeatability: not evaluated, no pose was measured twice." in said
    assert "leg 2 length and leg 3 length cannot be separated from these poses (+0.9" in said
    assert "Each point by the others: 5 of 5 agree." in said
    assert "Verdict: not evaluated, as no held-out records test this model." in said
    assert re.search(r"U at the task poses is \d\.\d{3} mm\.", said)
    assert max(map(len, lines)) <= 80


def test_undetermined_parameters_are_reported(fit, visit):
    few = visit(points=2, orientations=9, degrees=3.0).measured(0.01)
    text = fit(few, is_incomplete=True).out
    assert "of 35 parameters these records hardly determine" in " ".join(text.split()).lower()
    assert text.count("not determined") > 10


def test_a_second_visit_gives_a_repeatability(fit, noisy):
    again = replace(noisy.records[1], orientation=99)
    text = " ".join(fit(MeasurementSet((*noisy.records, again))).out.split())
    assert "Repeatability: on returning to 1 pose the ball scatters by x 0.0000" in text
    assert "(1 degree of freedom)" in text


def test_a_point_that_the_others_contradict_makes_a_fit_doubtful(noisy, fit):
    """The gauges of point 2 show 0.6 % too much; all records together still agree with the noise."""
    records = [
        replace(
            record, deviation=tuple((1.006 if record.point == 2 else 1.0) * mm for mm in record.deviation)
        )
        for record in noisy.records
    ]
    document = json.loads(fit(MeasurementSet(tuple(records)), "--json").out)
    assert document["verdict"] == "not evaluated"
    said = " ".join(fit(MeasurementSet(tuple(records))).out.split())
    assert "Each point by the others: 4 of 5 agree, not point 2." in said
    assert re.match(r"Doubtful: the records of point 2 are 1\.\d times as far as the stated noise", said)
    assert "The residuals agree with the stated noise." in said
    (second,) = (one for one in document["points_predicted"] if not one["agrees"])
    assert second["point"] == 2
    assert second["probability"] < 2e-4


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
    parts = [document["noise_part_mm"], *(row["part_mm"] for row in document["lines"])]
    assert math.hypot(*parts) == pytest.approx(document["standard_mm"])
