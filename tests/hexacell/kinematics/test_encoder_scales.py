"""Errors of the encoders' scales: as numbers of any mechanism, in cell file and config, and identified."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.config.layout import ConfigLayout
from hexacell.conformance import MechanismConformance, MechanismExample
from hexacell.conformance.frame_checks import records_without_noise
from hexacell.errors import FileError
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.encoder_scales import WithEncoderScales
from hexacell.robot.model import Robot, robot_of

CONFIGS = Path(__file__).parents[3] / "configs"
SCALES = 1e-6 * np.array([300.0, -200.0, 100.0, -300.0, 200.0, -100.0])
"""Their mean is zero, as no record tells it."""


def example_of(name: str, share: float = 1.0) -> MechanismExample:
    """A bundled cell's robot, whose tolerances are a share of those of the cell."""
    robot = robot_of(cell := load_cell(CONFIGS / f"{name}.toml"))
    mechanism = WithEncoderScales(robot.mechanism)
    return MechanismExample(
        mechanism,
        mechanism.with_scales(robot.drawing, SCALES),
        robot.branch,
        np.array(cell.settings.identification.points),
        {**robot.tolerances.scaled(share).by_kind, "encoder_scale": 3e-4},
    )


class TestHexaglide(MechanismConformance):
    example = example_of("simulated-hexaglide", 0.2)


class TestRotaryCranks(MechanismConformance):
    example = example_of("rotary-cranks")


CellWith = Callable[[bool, bool], Path]


@pytest.fixture
def cell_with(tmp_path: Path) -> CellWith:
    """Writes the Linapod's cell, with and without errors of scale in it and in the controller's config."""

    def write(in_cell: bool, in_config: bool) -> Path:
        cell, config = ((CONFIGS / f"linapod.{kind}").read_text() for kind in ("toml", "controller.toml"))
        if in_cell:
            cell = cell.replace("[robot]\n", "[robot]\nencoder_scales = true\n")
            cell = cell.replace("[tolerances]\n", "[tolerances]\nencoder_scale = 1e-3\n")
        if in_config:
            config = config.replace("[geometry]\n", f"[geometry]\nencoder_scale = {[0.0] * 6}\n")
        (tmp_path / "linapod.toml").write_text(cell)
        (tmp_path / "linapod.controller.toml").write_text(config)
        return tmp_path / "linapod.toml"

    return write


def test_drawing_and_true_machine_have_right_scales_where_nothing_is_said(cell_with: CellWith) -> None:
    settings = load_cell(cell_with(True, True)).settings
    assert settings.robot.nominal.model_dump()["encoder_scale"] == (0.0,) * 6
    assert settings.simulation is not None
    assert settings.simulation.geometry.model_dump()["encoder_scale"] == (0.0,) * 6
    robot = robot_of(load_cell(cell_with(True, True)))
    assert len(robot.mechanism.convention.free_names) == 45 + 6
    assert robot.mechanism.convention.display_name("encoder_scale3") == "leg 3 encoder scale"


def test_a_config_without_a_place_for_them_is_refused_by_its_name(cell_with: CellWith) -> None:
    cell = cell_with(True, False)
    with pytest.raises(FileError, match=r"'encoder_scale' in \[geometry\] is missing"):
        robot_of(load_cell(cell))


def test_they_are_written_beside_the_other_numbers(cell_with: CellWith) -> None:
    cell = load_cell(cell_with(True, True))
    robot, text = robot_of(cell), cell.config_path.read_text()
    assert isinstance(robot.mechanism, WithEncoderScales)
    changed = robot.mechanism.with_scales(robot.mechanism.without_scales(robot.controller), SCALES)
    [written] = ConfigLayout.of(cell.settings).rewrite([text], changed)
    assert "encoder_scale = [0.0003, -0.0002, 0.0001, -0.0003, 0.0002, -0.0001]" in written
    assert len(written.splitlines()) == len(text.splitlines())


def test_each_encoder_s_scale_is_no_effect_beside_where_it_is_identified(cell_with: CellWith) -> None:
    names = [
        {effect.name for effect in robot_of(load_cell(cell_with(on, on))).effects} for on in (False, True)
    ]
    [without] = names[0] - names[1]
    assert "scale" in without
    assert names[1] < names[0]


@pytest.mark.parametrize("scales", [SCALES, np.zeros(6)], ids=["off", "right"])
def test_scales_are_told_and_where_they_are_not_identified_residuals_show_whether_they_are_off(
    cell_with: CellWith, scales: np.ndarray
) -> None:
    exact, scaled = (robot_of(load_cell(cell_with(on, on))) for on in (False, True))
    found, without = _identified(exact, scaled, scales)
    told = found.geometry["encoder_scale"]
    np.testing.assert_allclose(told - told.mean(), scales, atol=2e-6)
    assert found.residual_rms_mm < 1e-5
    assert without.residual_rms_mm > 1e-3 if scales.any() else without.residual_rms_mm < 1e-5


def _identified(exact: Robot, scaled: Robot, scales: np.ndarray) -> tuple[Identification, Identification]:
    """By the same records of a machine with errors of scale: with these, and without."""
    example = replace(example_of("linapod", 0.2), drawing=scaled.drawing)
    _, built, *_ = example.robots()
    truth = Geometry(built.parameters, np.concatenate([built.vector[:-6], scales]))
    records = records_without_noise(example, truth)
    return identify(scaled.problem(records)), identify(exact.problem(records), find_outliers=False)
