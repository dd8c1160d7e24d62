"""The kinematics components in a running LinuxCNC against the program's own."""

import re
from functools import partial

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.config.layout import ConfigLayout
from hexacell.kinematics.mechanism import inverse_kinematics, joint_zeros
from hexacell.kinematics.pose import Pose, PoseBatch
from tests.configs.test_hexaglidekins import LOADED, loaded_joints
from tests.linuxcnc.server_client import ServerClient
from tests.waiting import wait_until

POSES = 1000
HEXAGLIDE = ("linuxcnc", 550.0, "hexaglidekins.fwd-kins-fail")
HEXAPOD = ("hexapod", 780.0, "genhexkins.fwd-kins-fail")
AS_SHOWN = 1.1e-6
"""Six decimals of LinuxCNC, and rounding, mm and deg."""
ARRIVED = 2e-5
"""Further away the robot is still on its way, mm and deg."""


def hurried(machine) -> None:
    """Simulated drives take any acceleration: a thousand moves in a minute."""
    text = machine.ini.read_text()
    text = re.sub(r"(MAX_(?:LINEAR_|ANGULAR_)?VELOCITY) = \d+", r"\1 = 5000", text)
    text = re.sub(r"(MAX_(?:LINEAR_|ANGULAR_)?ACCELERATION) = \d+", r"\1 = 500000", text)
    text = text.replace("CYCLE_TIME = 0.010", "CYCLE_TIME = 0.001")
    machine.ini.write_text(re.sub(r"FERROR = [\d.]+", "FERROR = 100", text))


def with_screws(machine) -> None:
    """Its legs are screws, for LinuxCNC and for the cell."""
    random = np.random.default_rng(17)
    axes = {plate: np.round(random.normal(size=(6, 3)), 3).tolist() for plate in ("base", "platform")}
    pins = ["setp genhexkins.screw-lead 10.0"] + [
        f"setp genhexkins.{plate}-n.{leg}.{axis} {value}"
        for plate, six in axes.items()
        for leg, vector in enumerate(six)
        for axis, value in zip("xyz", vector, strict=True)
    ]
    hal, cell = machine.folder / "hexapod.hal", machine.folder / "cell.toml"
    hal.write_text("\n".join([hal.read_text(), *pins, ""]))
    stated = "\n".join(f"{plate}_axes = {six}" for plate, six in axes.items())
    cell.write_text(f"{cell.read_text()}\n[robot.screws]\nlead_mm = 10.0\n{stated}\n")


def with_loaded_legs(machine) -> None:
    """Its legs have play and yield, as its config says."""
    cell = load_cell(machine.folder / "cell.toml")
    layout, path = ConfigLayout.of(cell.settings), cell.config_path
    [text] = layout.rewrite([path.read_text()], layout.read(path).geometry, LOADED)
    path.write_text(text)


def is_at(client: ServerClient, commanded: np.ndarray) -> bool:
    """Whether the pose that LinuxCNC shows is the commanded one, but for its rounding."""
    shown = np.array(client.get("abs_act_pos"))
    return bool(np.abs(shown - commanded).max() <= ARRIVED)


def go_to(client: ServerClient, commanded: np.ndarray) -> None:
    """Send the robot to a pose, and wait until it is there.

    On a busy machine LinuxCNC may acknowledge a block before it is done, refuse it without an error, or
    forget it; then the same block is sent again.
    """
    words = " ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZABC", commanded, strict=True))
    while not is_at(client, commanded):
        if not client.ask(f"set mdi G0 {words}").endswith("ACK"):
            assert client.ask("get error") == "ERROR OK", words
        wait_until(partial(has_ended, client, commanded))


def has_ended(client: ServerClient, commanded: np.ndarray) -> bool:
    """Whether the robot is at a pose, or nothing moves it any more."""
    return is_at(client, commanded) or client.ask("get program_status").endswith("IDLE")


@pytest.mark.parametrize(
    ("name", "height", "fails", "changes", "count"),
    [
        pytest.param(*HEXAGLIDE, (), POSES // 5, id="hexaglide"),
        pytest.param(*HEXAGLIDE, (with_loaded_legs,), POSES // 5, id="loaded legs"),
        pytest.param(*HEXAPOD, (), POSES // 5, id="hexapod"),
        pytest.param(*HEXAPOD, (with_screws,), POSES // 10, id="screws"),
        pytest.param(*HEXAGLIDE, (), POSES, id="hexaglide, all", marks=pytest.mark.slow),
        pytest.param(*HEXAPOD, (), POSES, id="hexapod, all", marks=pytest.mark.slow),
    ],
)
def test_random_poses_have_the_same_joints(request, name, height, fails, changes, count) -> None:
    machine = request.getfixturevalue(name)
    machine.shut_down()
    for change in (hurried, *changes):
        change(machine)
    machine.start()
    cell = load_cell(machine.folder / "cell.toml")
    controller = ConfigLayout.of(cell.settings).read(cell.config_path)
    mechanism = cell.settings.mechanism
    random = np.random.default_rng(16)
    spans = np.array([60.0, 60.0, 60.0, 20.0, 20.0, 20.0])
    middle = np.array([0.0, 0.0, height, 0.0, 0.0, 0.0])
    commanded = np.round(middle + spans * random.uniform(-1.0, 1.0, (count, 6)), 6)
    poses = [Pose(*row) for row in commanded.tolist()]
    with machine.connect() as client:
        client.make_ready()
        joints, reached = [], []
        for row in commanded:
            go_to(client, row)
            joints.append(client.get("joint_pos"))
            reached.append(client.get("abs_act_pos"))
    own = inverse_kinematics(mechanism, controller.geometry, controller.branch, PoseBatch.of(poses))
    if not controller.corrections.are_none:
        own = loaded_joints(mechanism, controller, PoseBatch.of(poses))
    if cell.settings.controller.joints_include_zeros:
        own += joint_zeros(mechanism, controller.geometry)
    assert np.abs(own - np.array(joints)).max() <= AS_SHOWN
    assert np.abs(commanded - np.array(reached)).max() <= AS_SHOWN
    assert machine.pin(fails) == "FALSE"
