"""A config on disk, a geometry to write into it, and a file system that fails on demand."""

import errno
import io
import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS

CONFIG = """\
# The owner's remarks stay.
title = "cell 7"   # not a number: 7

[geometry]
S = [
\t[-400.0, 0.0, 0.0],      # leg 1
\t[-400.0, 200, 0.0],
\t[-400.0, 4.0e2, 0.0],
\t[+400.0, 0.0, 0.0], [400.0, 200.0, 0.0],
\t[4_00.0, 400.0, 0.0],
]
B = [[-50.0, -40.0, 10.0], [-50.0, 0.0, 10.0], [-50.0, 40.0, 10.0],
     [50.0, -40.0, 10.0], [50.0, 0.0, 10.0], [50.0, 40.0, 10.0]]
l = [700.0, 700.0, 700.0, 700.0, 700.0, 700.0]
branch = [1, 1, 1, -1, -1, -1]

[drives]
gain = [1.0, 2.0]
"""


@dataclass
class Faults:
    """Counts the calls to the file system and fails ``width`` of them, from number ``at`` on."""

    at: float = math.inf
    width: float = 1
    error: Callable[[], BaseException] = lambda: OSError(errno.EIO, os.strerror(errno.EIO))
    calls: list[str] = field(default_factory=list)

    def fail_now(self, name: str) -> bool:
        self.calls.append(name)
        return self.at <= len(self.calls) - 1 < self.at + self.width

    def wrap(self, name: str, real: Callable) -> Callable:
        def call(*args, **kwargs):
            fails = self.fail_now(name)
            if name == "close":  # the descriptor is gone even when closing it fails
                real(*args, **kwargs)
            if fails:
                raise self.error()
            # The disk's own patience is not under test.
            return None if name in {"close", "fsync"} else real(*args, **kwargs)

        return call

    @contextmanager
    def active(self) -> Iterator["Faults"]:
        names = "open fsync replace fchmod fstat stat lstat readlink access listxattr mkdir unlink close"
        with pytest.MonkeyPatch.context() as patch:
            for name in names.split():
                patch.setattr(os, name, self.wrap(name, getattr(os, name)))
            patch.setattr(io, "open", self.wrap("io.open", io.open))
            yield self


@pytest.fixture
def faults() -> type[Faults]:
    return Faults


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "cell" / "controller.toml"
    path.parent.mkdir()
    path.write_bytes(CONFIG.encode())
    return path


@pytest.fixture
def geometry() -> Geometry:
    """What the config above says, each value moved by a number of its own."""
    moved = np.arange(42) * 0.001234567
    S = np.array([[side * 400.0, y, 0.0] for side in (-1, 1) for y in (0.0, 200.0, 400.0)])
    B = np.array([[side * 50.0, y, 10.0] for side in (-1, 1) for y in (-40.0, 0.0, 40.0)])
    return Geometry(HEXAGLIDE_PARAMETERS, np.concatenate([S.ravel(), B.ravel(), np.full(6, 700.0)]) + moved)
