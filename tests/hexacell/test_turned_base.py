"""A controller whose base is turned: gauges and level platforms are along its own axes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.cell.loader import Cell, load_cell
from hexacell.config.interface import ControllerGeometry
from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.measurements.records import MeasurementSet, deviation_of
from hexacell.robot.model import Robot, make_robot
from hexacell.robot.virtual_robot import robots_within_tolerances
from tests.records_within_travel import within_travel
from tests.simulated_campaign import SimulatedCampaign

CONFIG = Path(__file__).parents[2] / "configs" / "gough-stewart.toml"
TURNED = FrameTransform(
    Rotation.from_euler("ZYX", [40.0, 15.0, -20.0], degrees=True).as_matrix(),
    np.array([30.0, -20.0, 100.0]),
    np.eye(3),
)
"""From the drawing's frames to those of the controller; a level platform is level in both."""


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell(CONFIG)


@pytest.fixture(scope="module")
def turned(cell: Cell) -> Robot:
    """The bundled platform on its side; what is level turns with it."""
    change = replace(TURNED, platform=TURNED.base)
    drawing = Geometry.of(cell.settings.mechanism.parameters, cell.settings.robot.nominal.model_dump())
    controller = cell.settings.mechanism.change_frames(drawing, change)
    return make_robot(cell.settings, ControllerGeometry(controller, ()))


@pytest.fixture(scope="module")
def points(cell: Cell) -> np.ndarray:
    given = np.array(cell.settings.identification.points)
    poses = PoseBatch(given, np.broadcast_to(np.eye(3), (len(given), 3, 3)))
    return np.asarray(TURNED.poses(poses).positions)


@pytest.fixture(scope="module")
def truth(turned: Robot) -> Geometry:
    return robots_within_tolerances(turned, 1, seed=3)[0]


@pytest.fixture(scope="module")
def records(turned: Robot, truth: Geometry, points: np.ndarray) -> MeasurementSet:
    """Without noise, at orientations about a level platform."""
    random = np.random.default_rng(4)
    data = within_travel(turned, truth, points, 11, np.radians(25.0), random)
    return data.measured(0.0, random)


def test_its_first_records_are_level_in_its_own_frames(records: MeasurementSet, points: np.ndarray) -> None:
    firsts = [record for record in records.records if record.orientation == 1]
    for record, point in zip(firsts, points, strict=True):
        np.testing.assert_allclose(record.pose.as_tuple(), [*point, 0.0, 0.0, 0.0], atol=1e-9)


def test_its_geometry_is_identified(turned: Robot, truth: Geometry, records: MeasurementSet) -> None:
    exact = replace(turned, noise=Noise(1e-4, 1e-4))
    found = identify(exact.problem(records))
    assert found.geometry.largest_difference(truth) < 1e-5


def scaled(records: MeasurementSet, scales: tuple[float, float, float]) -> MeasurementSet:
    """What gauges with errors of scale show."""
    return MeasurementSet(
        tuple(
            replace(record, deviation=deviation_of(np.array(scales) * record.deviation))
            for record in records.records
        )
    )


@pytest.mark.slow
def test_each_gauge_has_a_scale_of_its_own(turned: Robot, truth: Geometry, records: MeasurementSet) -> None:
    shown = scaled(records, (1.004, 1.0, 0.993))
    noise = Noise(1e-4, 1e-4, gauge_scale=0.005)
    found = identify(replace(turned, noise=noise).problem(shown))
    assert found.geometry.largest_difference(truth) < 1e-3
    silent = identify(replace(turned, noise=Noise(1e-4, 1e-4)).problem(shown))
    assert silent.geometry.largest_difference(truth) > 0.01


def test_each_gauge_has_noise_of_its_own(turned: Robot, records: MeasurementSet) -> None:
    noise = turned.noise.with_devices([0.01] * 6, [0.01, 0.02, 0.5])
    robot = replace(turned, noise=noise)
    for covariance in (
        robot.problem(records).noise.gauge_covariance,
        robot.belief().noise.gauge_covariance,
    ):
        along = robot.frames.base.T @ covariance @ robot.frames.base
        np.testing.assert_allclose(along, np.diag([0.01, 0.02, 0.5]) ** 2, atol=1e-12)
    np.testing.assert_allclose(robot.limits.sigma_along_gauges(covariance), [0.01, 0.02, 0.5])


def test_travel_is_left_to_each_gauge_along_its_own_axis(turned: Robot) -> None:
    """An uncertainty of the z gauge takes nothing from x and y."""
    base, limits = turned.frames.base, turned.limits
    covariance = base @ np.diag([0.0, 0.0, 1.0]) @ base.T
    spread = 4.0 * limits.sigma_along_gauges(covariance)
    room = limits.room.upper
    assert limits.within_travel(base @ (0.99 * room[0], 0.0, 0.0), spread)
    assert not limits.within_travel(base @ (0.0, 0.0, room[2] - 3.9), spread)
    assert limits.within_travel(base @ (0.0, 0.0, room[2] - 4.1), spread)


@pytest.mark.slow
def test_a_campaign_stays_within_the_travel(cell: Cell, turned: Robot, truth: Geometry, points) -> None:
    moved = {"points": tuple(tuple(point) for point in points.tolist())}
    settings = cell.settings.model_copy(
        update={
            "identification": cell.settings.identification.model_copy(update=moved),
            "task": cell.settings.task.model_copy(update={"poses": ()}),
        }
    )
    campaign = SimulatedCampaign(settings, turned, truth, np.random.default_rng(5))
    campaign.carry_out()
    assert campaign.outside == 0
    assert campaign.largest_mm < settings.limits.gauge_travel_mm
    found = campaign.plan.estimate(campaign.state).identification
    assert found is not None
    assert np.abs(found.geometry.vector - truth.vector).max() < 1.0
