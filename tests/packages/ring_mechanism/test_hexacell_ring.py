"""The mechanism passes what every mechanism must: the whole test of such a package."""

import tomllib
from pathlib import Path

import numpy as np
from hexacell_ring import PARAMETERS, Ring

from hexacell.conformance import MechanismConformance, MechanismExample
from hexacell.kinematics.geometry import Geometry

CELL = tomllib.loads((Path(__file__).parent / "cells" / "ring.toml").read_text())


class TestRing(MechanismConformance):
    example = MechanismExample(
        Ring(),
        Geometry.of(PARAMETERS, CELL["robot"]["nominal"]),
        branch=(1, -1, 1, -1, 1, -1),
        points=np.array(CELL["identification"]["points"]),
        tolerances={"ring": 1.0, "B": 1.0, "l": 1.0},
    )
