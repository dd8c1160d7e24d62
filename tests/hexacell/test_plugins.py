"""Protects how plug-ins of installed packages are found, and that their failures are told as theirs."""

import asyncio
import json
import pickle
import re
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from drivers.errors import translated
from hexacell import plugins
from hexacell.cli import app
from hexacell.cli.commands import cell
from hexacell.errors import DeviceError, ExitCode, UsageError
from hexacell.plugins import Group, PluginFailed
from hexacell.study.tasks import results_of
from tests.cli.cell_folder import copy_cell

Install = Callable[..., None]
UNATTENDED = ("--unattended", "--mode", "optimise")


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Put a package on the path that announces ``plugins``; ``body`` is its module's source."""
    monkeypatch.syspath_prepend(tmp_path)

    def put(package: str, plugins: str, body: str, group: Group = Group.GAUGES) -> None:
        (tmp_path / f"{package}.py").write_text(body)
        info = tmp_path / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[{group.entry_points}]\n{plugins}\n")
        monkeypatch.delitem(sys.modules, package, raising=False)

    return put


def test_names_are_listed_without_importing(install: Install) -> None:
    install("laser_a", "laser = laser_a:Laser", "raise SystemExit('imported')")
    assert {"laser", "sylvac"} <= set(plugins.names(Group.GAUGES))
    assert "laser_a" not in sys.modules


@pytest.mark.parametrize("group", Group)
def test_every_plugin_of_hexacell_can_be_loaded(group: Group) -> None:
    assert all(callable(plugins.load(group, name)) for name in plugins.names(group))


def test_an_unknown_name_is_refused_with_the_nearest() -> None:
    with pytest.raises(UsageError, match=r"no gauge protocol 'sylvak'. Did you mean 'sylvac'\?") as caught:
        plugins.load(Group.GAUGES, "sylvak")
    assert caught.value.exit_code is ExitCode.USAGE


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("import no_such_module", "No module named 'no_such_module'"),
        ("1 / 0", "division by zero"),
        ("", "no attribute 'Laser'"),
        ("Laser = 7", "7 is not callable"),
    ],
)
def test_a_broken_plugin_is_named_when_asked_for(install: Install, body: str, reason: str) -> None:
    install("laser_c", "laser = laser_c:Laser", body)
    with pytest.raises(PluginFailed, match=reason) as caught:
        plugins.load(Group.GAUGES, "laser")
    assert caught.value.exit_code is ExitCode.HARDWARE
    assert str(caught.value).startswith("laser_c 1.0: ")
    assert str(caught.value).endswith("Repair or uninstall laser_c")


def test_two_packages_with_one_name_are_both_named(install: Install) -> None:
    install("laser_e", "laser = laser_e:Laser", "class Laser: ...")
    install("laser_f", "laser = laser_f:Laser", "class Laser: ...")
    with pytest.raises(UsageError, match="more than once, by laser_e and laser_f"):
        plugins.load(Group.GAUGES, "laser")


def test_an_installation_found_twice_is_one(install: Install) -> None:
    install("laser_g", "laser = laser_g:Laser", "class Laser: ...")
    install("laser_h", "laser = laser_g:Laser", "")
    assert plugins.load(Group.GAUGES, "laser").__name__ == "Laser"


FAILING = """
class Laser:
    def __init__(self, settings, ports):
        if settings == "broken":
            raise KeyError("no such laser")

    async def read(self):
        return self._parsed([])

    def _parsed(self, values):
        return values[0]

    async def unplugged(self):
        raise ConnectionResetError("gone")

    async def on_the_wire(self, call):
        call()
"""


@pytest.fixture
def laser(install: Install) -> Callable[[object], Any]:
    install("laser_k", "laser = laser_k:Laser", FAILING)
    return lambda settings: plugins.created(Group.GAUGES, "laser", settings, None)


def test_what_a_plugin_raises_is_told_with_its_package_version_and_method(laser) -> None:
    with pytest.raises(
        PluginFailed, match=r"^laser_k 1\.0: .* in laser_k\.Laser\.__init__: KeyError"
    ) as caught:
        laser("broken")
    assert caught.value.exit_code is ExitCode.HARDWARE
    with pytest.raises(PluginFailed, match=r"laser_k 1\.0: .* in laser_k\.Laser\.read: IndexError"):
        asyncio.run(translated(laser("sound"), "gauge x").read())
    with pytest.raises(DeviceError, match="gauge x: its driver failed"):
        asyncio.run(translated(laser("sound"), "gauge x").unplugged())


@pytest.mark.parametrize("body", ["class Laser: ...", "def Laser(): ..."])
def test_one_that_cannot_even_be_called_is_named_too(install: Install, body: str) -> None:
    install("laser_m", "laser = laser_m:Laser", body)
    with pytest.raises(PluginFailed, match=r"laser_m 1\.0: .* in Laser: TypeError"):
        plugins.created(Group.GAUGES, "laser", None, None)


def test_errors_of_this_program_stay_its_own(laser) -> None:
    def fail() -> None:
        raise ValueError("ours")

    with pytest.raises(ValueError, match="ours"), plugins.plugin_failures_named():
        fail()
    with pytest.raises(TypeError, match="argument"):
        plugins.created(Group.MECHANISMS, "hexaglide", "too much")
    with pytest.raises(UsageError, match="ours"):
        asyncio.run(translated(laser("sound"), "x").on_the_wire(Mock(side_effect=UsageError("ours"))))


@pytest.mark.parametrize("group", [Group.GAUGES, Group.ENCODERS, Group.CONTROLLERS, Group.THERMOMETERS])
def test_no_place_makes_a_plugin_without_naming_its_failures(group: Group) -> None:
    """``load`` alone is for those that only ask what a class is."""
    called = re.compile(rf"load\(\s*Group\.{group.name},[^()]*\)\(")
    for package in ("hexacell", "drivers", "procedures"):
        for path in (Path(plugins.__file__).parents[1] / package).rglob("*.py"):
            assert not called.search(path.read_text()), path


def test_a_command_ends_with_it(install: Install, capsys, monkeypatch) -> None:
    install("laser_n", "laser = laser_n:Laser", "class Laser:\n    def find(self): return {}['x']")

    def find(*_: object) -> int:
        return int(plugins.created(Group.GAUGES, "laser").find())

    monkeypatch.setattr(cell, "main", find)
    assert app.main(["cell", "schema", "--json"]) == ExitCode.HARDWARE
    captured = capsys.readouterr()
    assert captured.err.startswith(
        "hexacell: laser_n 1.0: this plug-in failed in laser_n.Laser.find: KeyError"
    )
    assert json.loads(captured.out)["exit_code"] == ExitCode.HARDWARE


def test_a_task_of_a_study_is_named_where_it_is_carried_out(laser) -> None:
    with ThreadPoolExecutor(1) as pool, pytest.raises(PluginFailed, match=r"laser_k\.Laser\._parsed"):
        list(results_of([()], laser("sound")._parsed, lambda: pool))
    failed = PluginFailed("failed", subject="laser_k 1.0", action="Report it")
    assert str(pickle.loads(pickle.dumps(failed))) == str(failed)


DRIVER = """
from hexacell.cell.fields import key
from hexacell.cell.robot import ControllerOptions

class BoxOptions(ControllerOptions):
    slot: int = key(..., "its place in the rack")

class Box:
    Options = BoxOptions

    def __init__(self, settings, *, trace=None):
        self._slot = settings.options.slot

    async def open(self):
        return {}["no such robot"]
"""


@pytest.fixture
def box(install: Install, tmp_path: Path) -> Callable[[str], str]:
    """A cell whose controller is of a package."""
    cell = copy_cell(tmp_path)
    cell.edit(('"linuxcncrsh"', '"box"\noptions = { slot = 3 }'))

    def of(body: str) -> str:
        install("box_a", "box = box_a:Box", body, Group.CONTROLLERS)
        return str(cell.cell)

    return of


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("import no_such_module", "No module named 'no_such_module'"),
        ("class Box:\n    Options = dict", "its Options are no hexacell.cell.robot.ControllerOptions"),
    ],
)
def test_a_controller_that_cannot_be_loaded_is_named_with_its_version(box, capsys, body, reason) -> None:
    assert app.main(["cell", "show", box(body)]) == ExitCode.HARDWARE
    said = " ".join(capsys.readouterr().err.split())
    assert "box_a 1.0: controller protocol 'box' cannot be loaded" in said
    assert reason in said


@pytest.mark.parametrize(
    ("methods", "reason"),
    [
        (
            "stop reload close",
            "controller protocol 'box' cannot be loaded from box_a:Box: Box has no 'async def move'",
        ),
        ("move stop reload close", "this plug-in failed in box_a.Box.open: KeyError"),
    ],
)
def test_a_controller_that_is_not_whole_or_fails_is_named_with_its_version(
    box, capsys, methods, reason
) -> None:
    body = DRIVER + "".join(
        f"\n    async def {one}(self, *_): ..." for one in f"prepare position status {methods}".split()
    )
    assert app.main(["run", box(body), *UNATTENDED]) == ExitCode.HARDWARE
    assert f"box_a 1.0: {reason}" in " ".join(capsys.readouterr().err.split())
