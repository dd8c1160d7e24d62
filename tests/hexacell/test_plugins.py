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

Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Put a package on the path that announces ``gauges``; ``body`` is its module's source."""
    monkeypatch.syspath_prepend(tmp_path)

    def put(package: str, gauges: str, body: str) -> None:
        (tmp_path / f"{package}.py").write_text(body)
        info = tmp_path / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[{Group.GAUGES.entry_points}]\n{gauges}\n")
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
    with pytest.raises(UsageError, match=reason) as caught:
        plugins.load(Group.GAUGES, "laser")
    assert "laser_c:Laser" in str(caught.value)
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
