"""The mathematics of LinuxCNC's kinematics component, compiled as plain C, against the program's own."""

import ctypes
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.controllers.linuxcnc.set_pins import _wanted
from hexacell.cell.loader import load_cell
from hexacell.config.interface import ControllerGeometry
from hexacell.config.layout import ConfigLayout
from hexacell.config.linuxcnc_ini import IniText
from hexacell.identification.placement import Placement, Weight, leg_forces
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from tests.cli.cell_folder import CONFIGS

FOLDER = CONFIGS / "linuxcnc-hexaglide"
SEATED = 0.005
LOADED = Corrections(
    play_mm=(0.1, 0.08, -0.02, 0.1, 0.05, 0.09),
    compliance_um_n=(0.3, 0.36, 0.3, 0.24, 0.0, 0.3),
    weight_n=100.0,
    weight_direction=(0.6, 0.0, -0.8),
    weight_centre_mm=(3.0, -20.0, 40.0),
)
# What LinuxCNC's headers and halcompile declare, beside the pins.
STUBS = """
#include <math.h>
typedef struct { struct { double x, y, z; } tran; double a, b, c, u, v, w; } EmcPose;
typedef int KINEMATICS_TYPE, KINEMATICS_FORWARD_FLAGS, KINEMATICS_INVERSE_FLAGS;
#define KINEMATICS_BOTH 3
#define KINS_NOT_SWITCHABLE
#define EXPORT_SYMBOL(name)
#define EXTRA_SETUP() int setup(struct __comp_state *__comp_inst)
"""


def loaded_joints(mechanism: Mechanism, controller: ControllerGeometry, poses: PoseBatch) -> Array:
    """Joints (n, 6) of legs as long as the model's forces make them, each pose by its own geometry."""
    corrections, geometry = controller.corrections, controller.geometry
    joints = mechanism.inverse(geometry, controller.branch, poses)
    direction, centre = np.array(corrections.weight_direction), corrections.weight_centre_mm
    at = Placement(mechanism, geometry, poses, joints)
    forces = leg_forces(at, Weight(direction, None if centre is None else np.array(centre)))
    longer = 1e-3 * np.array(corrections.compliance_um_n) * corrections.weight_n * forces
    longer += 0.5 * np.array(corrections.play_mm) * np.clip(forces / SEATED, -1.0, 1.0)
    for row, changes in enumerate(mechanism.parameters.changes("l", longer.T).T):
        changed = Geometry(mechanism.parameters, geometry.vector + changes)
        joints[row] = mechanism.inverse(changed, controller.branch, poses[np.array([row])])[0]
    return joints


def compiled(ini: str, folder: Path) -> ctypes.CDLL:
    """The component, with its pins as HAL sets them to variables of an INI text."""
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler here")
    set_pins = _wanted([FOLDER / "hexaglide.hal"], [IniText(ini, None, "")])
    pins = {pin.removeprefix("hexaglidekins."): number for pin, number in set_pins.items()}
    head, code = (FOLDER / "hexaglidekins.comp").read_text().split("\n;;\n")
    source, library = folder / "kinematics.c", folder / "kinematics.so"
    text = STUBS
    for pin, six, value in re.findall(r"(?m)^pin \w+ \w+ ([\w.#-]+)(\[6\])?(?: = (\S+))?", head):
        every = [pins.get(pin.replace("#", str(leg)), value or "0") for leg in range(6)]
        name = re.sub(r"[-.]", "_", pin.replace(".#", ""))
        text += f"static double {name}_[6] = {{{', '.join(every)}}};\n"
        text += f"#define {name}{'(leg)' if six else ''} {name}_[{'leg' if six else 0}]\n"
    source.write_text(text + re.sub(r'#include ".*"', "", code))
    options = ["-O2", "-Wall", "-Werror", "-shared", "-fPIC"]
    subprocess.run(["cc", *options, "-o", library, source, "-lm"], check=True)
    return ctypes.CDLL(str(library))


@pytest.mark.parametrize("corrections", [LOADED, replace(LOADED, weight_centre_mm=None)])
def test_joints_of_legs_under_a_weight_and_the_way_back(tmp_path: Path, corrections: Corrections) -> None:
    cell = load_cell(FOLDER / "cell.toml")
    layout, paths, mechanism = ConfigLayout.of(cell.settings), cell.config_paths, cell.settings.mechanism
    controller = layout.read(*paths)
    [ini] = layout.rewrite([paths[0].read_text()], controller.geometry, corrections)
    component = compiled(ini, tmp_path)
    rows = np.random.default_rng(38).uniform(-1.0, 1.0, (1000, 6)) * (60, 60, 60, 20, 20, 20)
    rows[:, 2] += 550.0
    poses = PoseBatch.of([Pose(*row) for row in rows.tolist()])
    wanted = loaded_joints(mechanism, replace(controller, corrections=corrections), poses)
    assert np.abs(wanted - mechanism.inverse(controller.geometry, controller.branch, poses)).max() > 0.1
    for row, expected in zip(rows, wanted, strict=True):
        pose, joints = (ctypes.c_double * 9)(*row), (ctypes.c_double * 6)()
        assert component.kinematicsInverse(pose, joints, None, None) == 0
        assert np.array(joints) == pytest.approx(expected, abs=1e-9)
        pose[0], pose[4] = pose[0] + 2.0, pose[4] - 1.0
        assert component.kinematicsForward(joints, pose, None, None) == 0
        assert np.array(pose)[:6] == pytest.approx(row, abs=1e-8)
