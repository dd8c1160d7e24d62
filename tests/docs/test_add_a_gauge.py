"""The example of docs/add-a-gauge.md, taken from the page, passes the conformance suite and is found."""

import asyncio
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from drivers.conformance import GaugeConformance, served_twin
from drivers.discovery import SearchTimeouts
from drivers.discovery.gauges import search_port
from hexacell.cell.devices import GaugeSettings

PAGE = Path(__file__).parents[2] / "docs" / "add-a-gauge.md"
DRIVER, TWIN = "drivers.gauges.shop_display", "drivers.simulated.gauges.shop_display"
CHECKS = sorted(name for name in vars(GaugeConformance) if name.startswith("test_"))


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE.read_text(), flags=re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    """The test module of the page, its driver and twin in the modules that the page names."""
    folder = tmp_path_factory.mktemp("add-a-gauge")
    modules = [DRIVER, TWIN, "test_shop_display"]
    for name, text in zip(modules, blocks("python"), strict=True):
        path = folder / f"{name}.py"
        path.write_text(text)
        spec = spec_from_file_location(name, path)
        assert spec is not None
        assert spec.loader is not None
        sys.modules[name] = module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    yield sys.modules[modules[-1]]
    for name in modules:
        del sys.modules[name]


@pytest.mark.parametrize("check", CHECKS)
def test_the_example_passes_what_every_gauge_must(example: ModuleType, check: str) -> None:
    getattr(example.TestShopDisplay(), check)()


def test_the_announcement_names_the_classes_of_the_page(example: ModuleType) -> None:
    [announced] = blocks("toml")
    entries = tomllib.loads(announced)["project"]["entry-points"]
    assert entries["hexacell.gauges"]["shop-display"] == f"{DRIVER}:{example.ShopDisplay.__name__}"
    twin = example.SimulatedShopDisplay.__name__
    assert entries["hexacell.simulated_gauges"]["shop-display"] == f"{TWIN}:{twin}"


def test_a_search_finds_it(example: ModuleType) -> None:
    settings = GaugeSettings(name="x", axis="x", protocol="shop-display", timeout_s=1.0)
    with served_twin(settings, example.SimulatedShopDisplay) as twin:
        assert twin.settings.port is not None
        search = search_port(
            twin.settings.port, {"shop-display": example.ShopDisplay}, SearchTimeouts(gauge=2.0)
        )
        [found] = asyncio.run(search).gauges
    assert (found.description, found.shown) == ("number 20417", "V=+00.0000")
