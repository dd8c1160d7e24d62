"""A config on disk, a geometry to write into it, and a file system that fails on demand."""

import errno
import io
import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexacell.config.change import ConfigChange, Receipt, propose
from hexacell.config.layout import ConfigLayout, Contents, fingerprint, read_contents
from hexacell.config.pending_write import note_path
from hexacell.config.write_back import commit
from hexacell.errors import FileError, WriteBackUndone
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from tests.native_config import NATIVE
from tests.several_config_files import LAYOUT, drawn_geometry, write_config

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
        names = "open fsync replace fstat stat lstat readlink access listxattr chmod mkdir unlink close"
        with pytest.MonkeyPatch.context() as patch:
            for name in names.split():
                patch.setattr(os, name, self.wrap(name, getattr(os, name)))
            patch.setattr(io, "open", self.wrap("io.open", io.open))
            yield self


@pytest.fixture(autouse=True)
def disk_without_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Waiting for the disk is not under test; that it is asked to write at once, ``Faults`` counts."""
    monkeypatch.setattr(os, "fsync", lambda _: None)


class PowerCut(BaseException):
    """From here on this process does nothing any more."""


Job = Callable[[Path], object]


class Bench:
    """The files of a config, the last one behind a symbolic link, and a change of all of them."""

    def __init__(self, folder: Path, files: tuple[Path, ...], layout: ConfigLayout, new: Geometry) -> None:
        self.files, self.layout = files, layout
        self.change = self.changed_to(new)
        self.before, self.after = self.change.before_contents, self.change.after_contents
        self._runs = (folder / f"run-{number}" for number in count())

    def changed_to(self, new: Geometry) -> ConfigChange:
        return propose(self.files, self.layout, new, fingerprint_at_start=fingerprint(*self.files))

    @property
    def found(self) -> Contents:
        return read_contents(self.files)

    @property
    def is_mixed(self) -> bool:
        return self.found not in {self.before, self.after}

    def left_behind(self) -> list[str]:
        targets = {*self.files, *(path.resolve() for path in self.files)}
        folders = {path.parent for path in targets}
        return [path.name for one in folders for path in one.iterdir() if path not in targets]

    def reset(self, _: Path) -> None:
        note_path(self.files).unlink(missing_ok=True)
        for path, data in zip(self.files, self.before, strict=True):
            path.write_bytes(data)

    def commit(self, run: Path) -> Receipt:
        return commit(self.change, run)

    def commit_afresh(self, run: Path) -> None:
        self.reset(run)
        self.commit(run)

    def attempts(
        self, prepare: Job, job: Job, **how: Any
    ) -> Iterator[tuple[str, Path, BaseException | None]]:
        """For each call to the file system that fails: which it is, the run, and what the job raised."""
        run = next(self._runs)
        prepare(run)
        with Faults().active() as counter:
            job(run)
        assert {"open", "fsync", "replace"} <= set(counter.calls)
        for at, name in enumerate(counter.calls):
            run = next(self._runs)
            prepare(run)
            raised = None
            with Faults(at=at, **how).active():
                try:
                    job(run)
                except (FileError, WriteBackUndone, PowerCut) as error:
                    raised = error
            assert self.files[-1].is_symlink()
            yield f"call {at}, {name}", run, raised


def shifted(shift_mm: float) -> Geometry:
    return Geometry(drawn_geometry().parameters, drawn_geometry().vector + shift_mm)


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """Two files."""
    (tmp_path / "machine").mkdir()
    (tmp_path / "real").mkdir()
    hal, ini = write_config(tmp_path / "real")
    files = tmp_path / "machine" / "hexapod.hal", tmp_path / "machine" / "hexapod.ini"
    hal.rename(files[0])
    files[1].symlink_to(ini)
    return Bench(tmp_path, files, LAYOUT, shifted(1.25))


@pytest.fixture(params=["one", "two"])
def either(request: pytest.FixtureRequest, tmp_path: Path, geometry: Geometry) -> Bench:
    """One file, or two."""
    if request.param == "two":
        found: Bench = request.getfixturevalue("bench")
        return found
    link = request.getfixturevalue("config").parent / "link.toml"
    link.symlink_to("controller.toml")
    return Bench(tmp_path, (link,), NATIVE, geometry)


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "cell" / "controller.toml"
    path.parent.mkdir()
    path.write_bytes(CONFIG.encode())
    return path


@pytest.fixture
def proposal(config: Path, geometry: Geometry) -> ConfigChange:
    return propose((config,), NATIVE, geometry, fingerprint_at_start=fingerprint(config))


@pytest.fixture
def geometry() -> Geometry:
    """What the config above says, each value moved by a number of its own."""
    moved = np.arange(42) * 0.001234567
    S = np.array([[side * 400.0, y, 0.0] for side in (-1, 1) for y in (0.0, 200.0, 400.0)])
    B = np.array([[side * 50.0, y, 10.0] for side in (-1, 1) for y in (-40.0, 0.0, 40.0)])
    return Geometry(HEXAGLIDE_PARAMETERS, np.concatenate([S.ravel(), B.ravel(), np.full(6, 700.0)]) + moved)
