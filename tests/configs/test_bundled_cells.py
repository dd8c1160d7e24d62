"""The cells in ``configs`` load, and agree with the paper's tables."""

from pathlib import Path

import numpy as np

from hexacell.cell.fields import GeometrySettings
from hexacell.cell.loader import load_cell
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from tests.hexacell.conftest import ACTUAL, CALIBRATED, NOMINAL, POINTS

CONFIGS = Path(__file__).parents[2] / "configs"


def same(settings: GeometrySettings, table: Geometry) -> None:
    stated = Geometry.of(HEXAGLIDE_PARAMETERS, settings.model_dump())
    np.testing.assert_array_equal(stated.vector, table.vector)


def test_simulated_hexaglide_is_table_1():
    settings = load_cell(CONFIGS / "simulated-hexaglide.toml").settings
    assert settings.simulation is not None
    same(settings.robot.nominal, NOMINAL)
    same(settings.simulation.geometry, ACTUAL)
    np.testing.assert_array_equal(settings.identification.points, POINTS[:5])
    assert settings.identification.orientations == 11
    assert settings.verification.points == (tuple(POINTS[5]), (100, 100, 550), (0, -100, 600))
    assert settings.limits.gauge_travel_mm == 5
    assert settings.tolerances.model_dump() == {"S_mm": 7, "B_mm": 7, "l_mm": 7, "ball_mm": 0}
    assert {settings.noise.encoder, settings.noise.gauge_mm} == {0.01}
    assert [gauge.protocol for gauge in settings.gauges] == ["sylvac", "mux10", "cdi"]
    assert settings.stations.placement == "fixed"
    assert settings.acceptance.approval == "automatic"


def test_paper_experiment_is_tables_3_and_4():
    settings = load_cell(CONFIGS / "paper-experiment.toml").settings
    assert settings.simulation is not None
    same(settings.robot.nominal, NOMINAL)
    same(settings.simulation.geometry, CALIBRATED)
    np.testing.assert_array_equal(settings.identification.points, POINTS[:3])
    np.testing.assert_array_equal(settings.verification.points, POINTS[3:])
    assert (settings.identification.orientations, settings.verification.orientations) == (20, 20)
    assert settings.tolerances.model_dump()["ball_mm"] == 40
