"""The kinematics component in a running LinuxCNC against the program's own."""

from __future__ import annotations

import re

import numpy as np

from hexacell.cell.loader import load_cell
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.robot_model import config_format

POSES = 1000
AS_SHOWN = 1.1e-6
"""Six decimals of LinuxCNC, and rounding, mm and deg."""


def hurried(linuxcnc) -> None:
    """Simulated drives take any acceleration: a thousand moves in a minute."""
    path = linuxcnc.folder / "hexaglide.ini"
    text = path.read_text()
    text = re.sub(r"(MAX_(?:LINEAR_|ANGULAR_)?VELOCITY) = \d+", r"\1 = 5000", text)
    text = re.sub(r"(MAX_(?:LINEAR_|ANGULAR_)?ACCELERATION) = \d+", r"\1 = 500000", text)
    path.write_text(re.sub(r"FERROR = [\d.]+", "FERROR = 100", text))


def test_a_thousand_poses_have_the_same_joints(linuxcnc) -> None:
    linuxcnc.shut_down()
    hurried(linuxcnc)
    linuxcnc.start()
    cell = load_cell(linuxcnc.folder / "cell.toml")
    controller = config_format(cell.settings).read(cell.config_path)
    random = np.random.default_rng(16)
    spans = np.array([60.0, 60.0, 60.0, 20.0, 20.0, 20.0])
    middle = np.array([0.0, 0.0, 550.0, 0.0, 0.0, 0.0])
    commanded = np.round(middle + spans * random.uniform(-1.0, 1.0, (POSES, 6)), 6)
    poses = [Pose(*row) for row in commanded.tolist()]
    with linuxcnc.connect() as client:
        client.make_ready()
        joints, reached = [], []
        for row in commanded:
            words = " ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZABC", row, strict=True))
            assert "ACK" in client.ask(f"set mdi G0 {words}")
            joints.append(client.get("joint_pos"))
            reached.append(client.get("abs_act_pos"))
    own = inverse_kinematics(Hexaglide(), controller.geometry, controller.branch, PoseBatch.of(poses))
    assert np.abs(own - np.array(joints)).max() <= AS_SHOWN
    assert np.abs(commanded - np.array(reached)).max() <= AS_SHOWN
    assert linuxcnc.pin("hexaglidekins.fwd-kins-fail") == "FALSE"
