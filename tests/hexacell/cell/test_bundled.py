"""Configs that travel with the package."""

from pathlib import Path

import pytest

from hexacell.cell import bundled
from hexacell.errors import UsageError


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A wheel's folder of configs."""
    (tmp_path / "linuxcnc-hexaglide").mkdir()
    (tmp_path / "simulated-hexaglide.toml").touch()
    (tmp_path / ".hidden").touch()
    monkeypatch.setattr(bundled, "_IN_THE_WHEEL", tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ["simulated-hexaglide", "simulated-hexaglide.toml"])
def test_a_config_by_name(installed: Path, name: str) -> None:
    assert bundled.bundled_config(name) == installed / "simulated-hexaglide.toml"


@pytest.mark.usefixtures("installed")
def test_an_unknown_config_name_is_refused_with_the_nearest() -> None:
    with pytest.raises(UsageError, match=r"'simulated-hexaglid' .* Did you mean 'simulated-hexaglide'"):
        bundled.bundled_config("simulated-hexaglid")
