"""Plug-ins announced by installed packages, some of which are broken."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from hexacell import plugins
from hexacell.errors import ExitCode, UsageError
from hexacell.plugins import Group

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
