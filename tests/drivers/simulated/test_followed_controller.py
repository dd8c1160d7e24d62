"""Gauges and encoders follow the joints that another program prints, also after it starts again."""

import sys

import numpy as np
import pytest

from drivers.simulated.followed_controller import FollowedController, JointSource, joints_in
from hexacell.cell.simulation import SimulatedFault
from hexacell.config.layout import ConfigLayout
from hexacell.errors import UsageError
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from tests.small_cell import changed
from tests.waiting import wait_until


@pytest.mark.parametrize(
    ("line", "joints"),
    [
        ("1 2 3 4 5 6\n", [1, 2, 3, 4, 5, 6]),
        (" 1.5 -2e0 3 4 5 6 1 ", [1.5, -2, 3, 4, 5, 6]),
        ("1 2 3 4 5 6 0", None),
        ("1 2 3 4 5", None),
        ("1 2 3 4 5 6 7 8", None),
        ("overrun", None),
        ("nan 2 3 4 5 6", None),
        ("", None),
    ],
)
def test_a_line_of_six_numbers_is_where_the_joints_are(line, joints) -> None:
    found = joints_in(line)
    assert (None if found is None else found.tolist()) == joints


PRINTS = """
import sys, time
begin, places = time.monotonic(), {places}
while True:
    row = min(int((time.monotonic() - begin) / {each_s}), len(places) - 1)
    print(*places[row], 1, flush=True)
    time.sleep(0.002)
"""


def printing(places: np.ndarray, each_s: float) -> tuple[str, ...]:
    """A program that stands at each place for some time, and at the last for ever."""
    return (sys.executable, "-c", PRINTS.format(places=places.tolist(), each_s=each_s))


@pytest.fixture
def followed(bundled_cell):
    """A cell whose joints go through the given poses of its controller."""
    cell = bundled_cell
    form = ConfigLayout.of(cell.settings)
    opened: list[FollowedController] = []

    def follow(poses: list[Pose], **changes) -> tuple[FollowedController, np.ndarray]:
        controller = form.read(cell.config_path)
        batch = PoseBatch.of(poses)
        joints = inverse_kinematics(Hexaglide(), controller.geometry, controller.branch, batch)
        settings = changed(
            cell.settings,
            {"timing.clock_factor": 1.0, "simulation.joints_command": printing(joints, 0.4)} | changes,
        )
        opened.append(FollowedController(settings, cell.config_paths))
        return opened[-1], joints

    yield follow
    for one in opened:
        one.close()
        one.close()


def test_encoders_and_gauges_are_those_of_the_hidden_geometry(followed) -> None:
    home, there = Pose(0, 0, 550, 0, 0, 0), Pose(2, 1, 551, 3, -2, 5)
    cell, joints = followed([home, home, there])
    started = []
    cell.physics.on_motion_start = lambda: started.append(1)
    wait_until(lambda: np.abs(cell.physics.encoder_positions() - joints[-1]).max() < 0.1)
    truth = cell.physics._truth
    error = Hexaglide().residual_and_jacobian(truth, cell.physics._pose, cell.physics._joints[None])[0]
    assert np.abs(error).max() < 1e-6
    assert np.linalg.norm(cell.physics._pose.positions[0] - [2, 1, 551]) > 0.5, "another geometry"
    assert started == [1]


STANDS = [Pose(0, -200, 550, 0, 0, 0)] * 2
TURNED = Pose(0, -200, 550, 15, -10, 20)
"""There the ball is elsewhere by what the geometry is wrong, millimetres."""


def shown_at_last(cell: FollowedController, joints: np.ndarray) -> list[float]:
    """What the gauges show once the joints are where they end."""
    wait_until(lambda: np.abs(cell.physics.encoder_positions() - joints[-1]).max() < 0.1)
    return [cell.physics.gauge_displacement(axis) for axis in "xyz"]


def test_gauges_stand_where_they_were_when_the_program_is_started_again(followed) -> None:
    """As real ones do: the robot is where it was stopped, beside the middle of their travel."""
    first, joints = followed([*STANDS, TURNED])
    shown_at_last(first, joints)
    second, joints = followed([TURNED])
    shown_at_last(second, joints)
    np.testing.assert_array_equal(second.physics.gauges.station, first.physics.gauges.station)


@pytest.mark.parametrize("damaged", [b"", b"\xff", b"[]", b'{"config": 1}'])
def test_a_damaged_file_of_the_gauges_places_is_none(followed, tmp_path, damaged) -> None:
    (tmp_path / ".simulated-hexaglide.controller.toml.simulated-gauges").write_bytes(damaged)
    assert np.abs(shown_at_last(*followed(STANDS))).max() < 3.0


def test_a_program_that_ends_is_started_again(tmp_path) -> None:
    count = tmp_path / "count"
    script = f"open({str(count)!r}, 'a').write('x'); import time; time.sleep(0.4); print(1, 2, 3, 4, 5, 6)"
    with JointSource((sys.executable, "-c", script)) as source:
        found: list[np.ndarray] = []

        def came_twice() -> bool:
            found.extend(source.passed())
            return len(found) >= 2

        wait_until(came_twice)
    assert len(count.read_text()) >= 2
    assert found[0].tolist() == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"simulation.faults": (SimulatedFault(kind="emergency stop"),)}, "only a simulated controller"),
        ({"timing.clock_factor": 10.0}, "no fast clock"),
        ({"simulation.joints_command": ("halsampler-not-here",)}, "no program 'halsampler-not-here'"),
    ],
)
def test_what_only_a_simulated_controller_can_is_refused(followed, changes, words) -> None:
    with pytest.raises(UsageError, match=words):
        followed([Pose(0, 0, 550, 0, 0, 0)], **changes)
