"""The cells in ``configs`` load, and agree with the paper's tables."""

from __future__ import annotations

from pathlib import Path

import pytest

from hexacell.cell.loader import Cell, load_cell

CONFIGS = Path(__file__).parents[2] / "configs"
NAMES = ["simulated-hexaglide", "paper-experiment"]

# Table 3 of Abtahi et al. 2010: the ball's positions P1 to P6.
P1, P2, P3 = (0, 0, 550), (0, -200, 550), (100, -100, 500)
P4, P5, P6 = (100, 0, 600), (-100, 100, 500), (-100, -50, 450)


@pytest.fixture(params=NAMES)
def cell(request: pytest.FixtureRequest) -> Cell:
    return load_cell(CONFIGS / f"{request.param}.toml")


def test_geometries_obey_the_paper_frame(cell):
    """S2 = 0, S3z = 0, B2z = B3z = B5z, B2y = B5y: the drawing and the truth can be compared."""
    assert cell.settings.simulation is not None
    for section in (cell.settings.robot.nominal, cell.settings.simulation.geometry):
        values = section.model_dump()
        assert values["S"][1] == (0, 0, 0)
        assert values["S"][2][2] == 0
        assert values["B"][1][2] == values["B"][2][2] == values["B"][4][2]
        assert values["B"][1][1] == values["B"][4][1]


def test_simulated_hexaglide_is_table_1():
    settings = load_cell(CONFIGS / "simulated-hexaglide.toml").settings
    assert settings.simulation is not None
    drawing = settings.robot.nominal.model_dump()
    assert drawing["l"] == (590, 580, 615, 615, 580, 590)
    assert drawing["B"][5] == (90, -67, -125)
    actual = settings.simulation.geometry.model_dump()
    assert actual["S"][0] == (0.861, -160.815, 1.501)
    assert actual["B"][5] == (86.346, -67.912, -130.613)
    assert actual["l"] == (583.941, 578.279, 610.563, 614.068, 585.272, 593.461)
    assert settings.identification.points == (P1, P2, P3, P4, P5)
    assert settings.identification.orientations == 11
    assert settings.verification.points == (P6, (100, 100, 550), (0, -100, 600))
    assert settings.limits.gauge_travel_mm == 5
    assert settings.tolerances.model_dump() == {"S_mm": 7, "B_mm": 7, "l_mm": 7, "ball_mm": 0}
    assert {settings.noise.encoder, settings.noise.gauge_mm} == {0.01}
    assert [(gauge.axis, gauge.protocol) for gauge in settings.gauges] == [
        ("x", "sylvac"),
        ("y", "mux10"),
        ("z", "cdi"),
    ]
    assert settings.stations.placement == "fixed"
    assert settings.acceptance.approval == "automatic"


def test_paper_experiment_is_tables_3_and_4():
    settings = load_cell(CONFIGS / "paper-experiment.toml").settings
    assert settings.simulation is not None
    actual = settings.simulation.geometry.model_dump()
    assert actual["S"][3] == (1.08, 155.85, -0.26)
    assert actual["B"][0] == (-90.04, -67.09, -151.27)
    assert actual["l"] == (590.58, 579.58, 615.75, 619.33, 578.71, 592.50)
    assert settings.identification.points == (P1, P2, P3)
    assert settings.verification.points == (P4, P5, P6)
    assert (settings.identification.orientations, settings.verification.orientations) == (20, 20)
    assert settings.tolerances.model_dump()["ball_mm"] == 40
