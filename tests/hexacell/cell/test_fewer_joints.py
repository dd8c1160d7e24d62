"""Cell files, records and poses of robots with four and five joints, and what is refused of them."""

import dataclasses
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from drivers.controllers.adapter.controller import AdapterController
from drivers.controllers.adapter.link import Link
from drivers.controllers.adapter.messages import Position
from drivers.controllers.adapter.options import Program
from drivers.controllers.linuxcnc.gcode import timed_move
from drivers.controllers.opcua.options import OpcUaOptions
from drivers.controllers.poses import agree, from_wire, on_wire
from hexacell.campaign.planner import Plan
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.errors import DeviceError, FileError, HexacellError, UsageError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.measurements.csv_file import read_measurements, write_measurements
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.plugins import Group, created
from hexacell.robot.model import robot_of
from hexacell.services.offline import fit_measurements, next_pose


def five_legs() -> Cell:
    return load_cell(bundled_config("five-legs"))


def load_with(tmp_path: Path, old: str, new: str, name: str = "five-legs") -> Cell:
    bundled = load_cell(bundled_config(name))
    text = bundled.path.read_text()
    assert old in text
    (tmp_path / bundled.config_path.name).write_text(bundled.config_path.read_text())
    (tmp_path / "cell.toml").write_text(text.replace(old, new))
    return load_cell(tmp_path / "cell.toml")


@pytest.mark.parametrize(
    ("name", "old", "new", "told"),
    [
        ("five-legs", "nodes = [1, 2, 3, 4, 5]", "nodes = [1, 2, 3, 4, 5, 6]", "nodes.* list of 5 items"),
        ("four-arms", "nodes = [1, 2, 3, 4]", "nodes = [1, 2, 3]", "nodes.* list of 4 items"),
        ("gough-stewart", "nodes = [1, 2, 3, 4, 5, 6]", "nodes = [1, 2, 3, 4, 5]", r"a list of 6 items"),
        ("five-legs", '"xyzab" ', '"xyzabc"', r"xyzabc are not the coordinates of five-legs.*xyzab"),
        ("four-arms", '"xyzc" ', '"xyzab"', r"xyzab are not the coordinates of four-arms.*xyzc"),
        ("five-legs", "base_cone_deg = 45.0", "base_cone_deg = [45.0, 45.0]", r"a list of 5 of them"),
        ("five-legs", "skew = [0.0]", "skew = [0.0, 0.0]", "skew.* list of 1 items"),
    ],
)
def test_other_numbers_of_joints_are_refused_by_name(tmp_path, name, old, new, told) -> None:
    with pytest.raises(FileError, match=told):
        load_with(tmp_path, old, new, name)


def test_what_has_an_item_for_each_joint_has_as_many_and_one_number_is_of_all(tmp_path) -> None:
    wear = "[simulation.encoders]\n"
    cell = load_with(tmp_path, wear, f"[simulation.joints]\nbacklash_mm = 0.02\n\n{wear}")
    simulation = cell.settings.simulation
    assert simulation is not None
    assert [*simulation.joints.backlash] == [0.02] * 5
    assert [*simulation.temperature.legs_share] == [1.0] * 5
    assert [*cell.settings.encoders.direction] == [1] * 5
    assert cell.settings.controller.coordinates == "xyzab"


def five_joints(number: int) -> Record:
    pose = Pose(0.1 * number, 0.0, 700.0, 3.0, -2.0)
    joints = tuple(100.0 + leg + 0.1 * number for leg in range(5))
    return Record(1, number, pose, joints, (0.0, 0.01, 0.02), (1, -1, 0, 1, 1))


def test_a_file_has_as_many_joint_variables_as_the_robot(tmp_path) -> None:
    records = MeasurementSet(tuple(map(five_joints, range(1, 4))))
    write_measurements(tmp_path / "five.csv", records)
    header = (tmp_path / "five.csv").read_text().splitlines()[0]
    assert header == "point,orientation,x,y,z,a,b,c,q1,q2,q3,q4,q5,dx,dy,dz,d1,d2,d3,d4,d5"
    assert read_measurements(tmp_path / "five.csv") == records
    assert records.joints.shape == records.directions.shape == (3, 5)


@pytest.mark.parametrize("use", [fit_measurements, next_pose])
def test_records_of_another_number_of_joints_are_refused(use: Any) -> None:
    records = MeasurementSet(tuple(map(five_joints, range(1, 4))))
    six = MeasurementSet(
        tuple(dataclasses.replace(one, joints=(*one.joints, 1.0), directions=()) for one in records.records)
    )
    with pytest.raises(UsageError, match="q1 to q6, and the robot has 5 joints"):
        use(five_legs(), six)
    with pytest.raises(UsageError, match="q1 to q5, and the robot has 6 joints"):
        use(load_cell(bundled_config("gough-stewart")), records)


def test_a_controller_gets_the_coordinates_that_the_robot_has() -> None:
    pose, settings = Pose(1.0, 2.0, 3.0, 4.0, 5.0, 6.0), five_legs().settings.controller
    assert on_wire(pose, "xyzab") == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert from_wire([1.0, 2.0, 3.0, 6.0], "xyzc") == Pose(1.0, 2.0, 3.0, 0.0, 0.0, 6.0)
    assert agree(pose, Pose(1.0, 2.0, 3.0, 4.0, 5.0, 99.0), settings), "its c means nothing"
    assert not agree(pose, Pose(1.0, 2.0, 3.0, 4.0, 5.1, 6.0), settings)
    block = timed_move(on_wire(pose, "xyzab"), 2.0, "xyzab")
    assert "B5.0" in block
    assert "C" not in block


class Answering:
    """A link to a program that answers each request with the same."""

    def __init__(self, answer: Position) -> None:
        self._answer = answer

    async def ask(self, *_request: object) -> Position:
        return self._answer


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (Position(pose=[0.0] * 6, joints=[0.0] * 5), "reports 6 coordinates, and the robot has 5: xyzab"),
        (Position(pose=[0.0] * 5, joints=[0.0] * 6), "reports 6 joints, and the robot has 5: xyzab"),
        (Position(pose=[0.0] * 4), "reports 4 coordinates"),
    ],
)
async def test_a_controller_that_reports_what_the_robot_does_not_have_is_named(answer, told) -> None:
    program = Program("controller of a test", ("true",), settings={}, protocol="adapter")
    controller = AdapterController(five_legs().settings.controller, program)
    with pytest.raises(DeviceError, match=told):
        await controller._position(cast("Link", Answering(answer)))


def test_a_plc_takes_six_coordinates() -> None:
    options = OpcUaOptions(endpoint="opc.tcp://127.0.0.1:4840", node="ns=2;s={name}")
    settings = five_legs().settings.controller.model_copy(update={"options": options})
    with pytest.raises(UsageError, match="a PLC takes xyzabc, and the robot has xyzab"):
        created(Group.CONTROLLERS, "opcua", settings)


def test_a_design_that_no_arm_holds_is_refused_by_name(tmp_path) -> None:
    """With the hinges along y the bar is square to where it is at 90 deg in the bundled cell."""

    bundled = load_cell(bundled_config("four-arms"))
    along_x, along_y = "  [-80.0, 0.0],\n  [80.0, 0.0],\n", "  [0.0, -80.0],\n  [0.0, 80.0],\n"
    config = tmp_path / bundled.config_path.name
    config.write_text(bundled.config_path.read_text().replace(along_x, along_y))
    (tmp_path / "cell.toml").write_text(bundled.path.read_text().replace(along_x, along_y))
    assert config.read_text() != bundled.config_path.read_text()
    with pytest.raises(HexacellError, match="singular"):
        next_pose(load_cell(tmp_path / "cell.toml"), MeasurementSet(()))


def test_a_calibrated_machine_whose_axes_are_not_square_has_plans_too() -> None:
    """Its level platform is turned by the skew; no records do not tell of how many joints they are."""
    cell = five_legs()
    robot = robot_of(cell)
    skewed = Geometry.of(robot.mechanism.parameters, robot.controller.document() | {"skew": [0.0015]})
    robot = robot.with_controller(skewed)
    plan = Plan(cell.settings, robot)
    assert [len(poses) for poses in plan.planned_sets] == [cell.settings.identification.orientations] * 7
    assert plan.planned_budget is not None
    assert robot.problem(MeasurementSet(())).joints.shape == (0, 5)
    level = robot.to_command(robot.from_commands([Pose(0.0, 0.0, 780.0)]).pose(0))
    assert level.as_tuple() == pytest.approx((0.0, 0.0, 780.0, 0.0, 0.0, -np.degrees(0.0015)), abs=1e-9)
