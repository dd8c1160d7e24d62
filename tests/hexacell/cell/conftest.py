"""A valid cell file, and loaders for changed texts of it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from hexacell.cell.loader import Cell, load_cell
from hexacell.errors import FileError, HexacellError, SeveralErrors

CONFIGS = Path(__file__).parents[3] / "configs"


@pytest.fixture(scope="session")
def cell_text() -> str:
    """The text of a cell file without mistakes."""
    return (CONFIGS / "simulated-hexaglide.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def cell_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where a test may write a cell file; one for all, since hypothesis needs it to outlive a test."""
    return tmp_path_factory.mktemp("cell") / "cell.toml"


@pytest.fixture(scope="session")
def load_text(cell_path: Path) -> Callable[[str], Cell]:
    """Load a cell file with this text."""

    def load(text: str) -> Cell:
        cell_path.write_bytes(text.encode())
        return load_cell(cell_path)

    return load


@pytest.fixture(scope="session")
def load_changed(cell_text: str, load_text: Callable[[str], Cell]) -> Callable[..., Cell]:
    """Load the good cell file with some of its text, at its first occurrence, replaced."""

    def load(*changes: tuple[str, str]) -> Cell:
        text = cell_text
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        return load_text(text)

    return load


@pytest.fixture(scope="session")
def load_with(cell_text: str, load_text: Callable[[str], Cell]) -> Callable[[str], Cell]:
    """Load the good cell file with more text at its end."""
    return lambda more: load_text(f"{cell_text}\n{more}")


@pytest.fixture
def copied(tmp_path: Path) -> Callable[..., Path]:
    """Copy a bundled cell and its controller's config, with some of the cell's text replaced."""

    def copy(name: str, *changes: tuple[str, str], more: str = "") -> Path:
        cell, config = ((CONFIGS / f"{name}.{end}").read_text() for end in ("toml", "controller.toml"))
        for old, new in changes:
            assert old in cell
            cell = cell.replace(old, new, 1)
        (tmp_path / f"{name}.controller.toml").write_text(config)
        (tmp_path / "cell.toml").write_text(cell + more)
        return tmp_path / "cell.toml"

    return copy


@pytest.fixture(scope="session")
def line_with(cell_text: str) -> Callable[[str], int]:
    """The number of the first line of the good cell file with this text in it."""

    def find(part: str) -> int:
        return next(n for n, line in enumerate(cell_text.splitlines(), start=1) if part in line)

    return find


@pytest.fixture(scope="session")
def refusal(load_text: Callable[[str], Cell]) -> Callable[[str, str, int], None]:
    """Assert that a text is refused in these words, with lines from one on."""

    def refused(text: str, words: str, first_line: int) -> None:
        with pytest.raises(HexacellError, match=words) as caught:
            load_text(text)
        errors = caught.value.errors if isinstance(caught.value, SeveralErrors) else (caught.value,)
        assert all(isinstance(error, FileError) and (error.line or 0) >= first_line for error in errors)

    return refused
