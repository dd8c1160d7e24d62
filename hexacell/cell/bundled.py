"""The cells that come with the package, wherever it is installed."""

from pathlib import Path

from hexacell.errors import UsageError, did_you_mean

CONTROLLER = ".controller.toml"
"""The end of the name of a controller's config; the rest is the name of its cell."""

_IN_THE_WHEEL = Path(__file__).parents[1] / "_configs"
_IN_A_CHECKOUT = Path(__file__).parents[2] / "configs"


def bundled_config(name: str) -> Path:
    """The cell called ``name``, with or without its suffix: ``simulated-hexaglide``.

    It is a cell file, or a folder with a cell file and the files that it names. Treat it as read-only: a
    calibration writes beside its cell file, so copy it first.

    Raises:
        UsageError: no such config comes with the package; the message names the nearest.
    """
    known = _configs()
    found = known.get(name) or known.get(name.removesuffix(".toml"))
    if found is None:
        action = did_you_mean(name, known) or f"There are: {', '.join(known)}"
        raise UsageError(f"no cell called '{name}' comes with hexacell", action=action)
    return found


def bundled_names() -> tuple[str, ...]:
    """The names of all cells that come with the package."""
    return tuple(_configs())


def _configs() -> dict[str, Path]:
    folder = _IN_THE_WHEEL if _IN_THE_WHEEL.is_dir() else _IN_A_CHECKOUT
    configs = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    return {path.stem: path for path in configs if not path.name.endswith(CONTROLLER)}
