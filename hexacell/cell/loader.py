"""The cell file: read, checked, described and written.

The content that :mod:`hexacell.cell.model` describes becomes settings here, with the line of every value
and errors that a technician can act on.
"""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import SecretStr, ValidationError

from hexacell.cell.by_mechanism import cell_model
from hexacell.cell.diagnostics import Diagnosis
from hexacell.cell.fields import Section
from hexacell.cell.model import CellSettings
from hexacell.cell.robot import DEFAULT_CONTROLLER, DEFAULT_MECHANISM, ControllerOptions
from hexacell.errors import FileError, HexacellError, UsageError, did_you_mean, joined
from hexacell.plugins import Group, PluginFailed, broken, load, names
from hexacell.storage import toml_document
from hexacell.storage.atomic_files import read_text

_log = logging.getLogger(__name__)

LARGEST_FILE_BYTES = 500_000
"""Largest cell file that is read, bytes; most have less than ten thousand."""

MOST_REPORTED = 20
"""Most mistakes that are reported at once."""

SectionType = TypeVar("SectionType", bound=Section)

Remark = Callable[[toml_document.KeyPath], str | None]
"""The comment behind the value at a path, if any."""


@dataclass(frozen=True)
class Cell:
    """A cell file as read."""

    path: Path
    settings: CellSettings
    document: toml_document.TomlDocument

    @property
    def text(self) -> str:
        """The whole file, without a byte order mark."""
        return self.document.text

    @property
    def text_without_secrets(self) -> str:
        """The whole file with every password masked, as it is kept with a run."""
        return toml_document.without_secrets(self.text)

    @property
    def config_path(self) -> Path:
        """The controller's config, or its first file; its name is relative to the cell file."""
        return self.path.parent / self.settings.controller.config

    @property
    def config_paths(self) -> tuple[Path, ...]:
        """All files of the controller's config, that one first."""
        return config_paths(self.settings, self.path.parent)

    @property
    def taught_path(self) -> Path:
        """The config with which points and frames were taught last, or its first file."""
        return self.taught_paths[0]

    @property
    def taught_paths(self) -> tuple[Path, ...]:
        """All files of that config."""
        controller = self.settings.controller
        if controller.taught is None:
            return self.config_paths
        further = (one.taught for one in controller.further_files if one.taught is not None)
        return tuple(self.path.parent / name for name in (controller.taught, *further))


def config_paths(settings: CellSettings, folder: Path) -> tuple[Path, ...]:
    """All files of the controller's config, the first one first; ``folder`` has the cell file."""
    controller = settings.controller
    return (folder / controller.config, *(folder / one.config for one in controller.further_files))


def load_cell(path: Path | str) -> Cell:
    """The cell of a TOML file: settings with every default filled in, and the text with all lines.

    Raises:
        FileError: it cannot be read, is no TOML, or has one mistake.
        SeveralErrors: it has more than one; each of ``errors`` is a FileError with its line.
    """
    return checked_cell(Path(path), read_text(Path(path), LARGEST_FILE_BYTES))


def checked_cell(path: Path, text: str) -> Cell:
    """The cell of a file's text, whether the file holds it yet or not; raises as ``load_cell`` does."""
    document = toml_document.TomlDocument.parse(text, path)
    settings = validated(document, _model(document), path)
    _log.info("read the cell file %s: %s", path, settings.name)
    return Cell(path, settings, document)


def is_cell_file(path: Path) -> bool:
    """Whether a file seems to be one, with or without mistakes: not a config or a password file beside it.

    What cannot be read as TOML counts as one, so that nobody overlooks a broken cell file.
    """
    try:
        data = toml_document.TomlDocument.parse(read_text(path, LARGEST_FILE_BYTES), path).data
    except FileError:
        return True
    return any(section in data for section in ("robot", "gauges", "encoders", "identification"))


def require_plugins(cell: Cell) -> None:
    """Import what the cell file names: the mechanism, the format of the config, every device's driver.

    Raises:
        FileError: one is not installed; the message has its line and names the most similar one.
        PluginFailed: one cannot be imported.
        SeveralErrors: more than one of these.
    """
    failures: list[HexacellError] = []
    for path, group, name in sorted(_plugins(cell.settings), key=lambda one: one[1].value):
        try:
            load(group, name)
        except PluginFailed as error:
            failures.append(error)
        except HexacellError as error:
            line = cell.document.line_of(path)
            failures.append(FileError(error.problem, subject=cell.path, line=line, action=error.action))
    if failures:
        raise joined(f"{cell.path} has {len(failures)} mistakes", failures)


def _plugins(settings: CellSettings) -> Iterator[tuple[toml_document.KeyPath, Group, str]]:
    for n, gauge in enumerate(settings.gauges):
        yield ("gauges", n, "protocol"), Group.GAUGES, gauge.protocol
    for n, thermometer in enumerate(settings.thermometers):
        yield ("thermometers", n, "protocol"), Group.THERMOMETERS, thermometer.protocol
    yield ("encoders", "protocol"), Group.ENCODERS, settings.encoders.protocol
    yield ("controller", "protocol"), Group.CONTROLLERS, settings.controller.protocol
    yield ("controller", "config_format"), Group.CONFIG_FORMATS, settings.controller.config_format
    for n, file in enumerate(settings.controller.further_files):
        path = ("controller", "further_files", n, "config_format")
        yield path, Group.CONFIG_FORMATS, file.config_format
    yield ("robot", "mechanism"), Group.MECHANISMS, settings.robot.mechanism


def describe(cell: Cell) -> str:
    """The cell file with every default filled in; behind each value its line in the file, or ``default``.

    The text is itself a cell file with equal settings; passwords are not in it.
    """
    document = cell.document
    return dump(
        cell.settings, lambda key: f"line {document.line_of(key)}" if key in document.spans else "default"
    )


def settings_document(cell: Cell) -> dict[str, Any]:
    """The settings as a JSON document, every default filled in and every secret masked."""
    found: dict[str, Any] = _masked(cell.settings.model_dump(mode="json"))
    return found


def schema() -> dict[str, Any]:
    """The JSON Schema of a cell file, for editors and other programs, with each controller's options."""
    from pydantic.json_schema import models_json_schema  # noqa: PLC0415 - only for this

    found = cell_model(DEFAULT_MECHANISM, encoder_scales=False).model_json_schema()
    each = dict.fromkeys(controller_options(one) for one in names(Group.CONTROLLERS))
    refs, definitions = models_json_schema([(one, "validation") for one in each])
    found["$defs"] |= definitions["$defs"]
    section = found["$defs"]["ControllerSettings"]["properties"]["options"]
    del section["$ref"]
    section["anyOf"] = list(refs.values())
    return found


def validated(document: toml_document.TomlDocument, model: type[SectionType], path: Path) -> SectionType:
    """The values of a document by the model of its file.

    Raises:
        FileError: there is one mistake.
        SeveralErrors: there is more than one.
    """
    diagnosis = Diagnosis(document, model, MOST_REPORTED)
    errors = diagnosis.unsupported_values()
    try:
        # As JSON, because strict validation then accepts arrays as tuples.
        settings = model.model_validate_json(document.to_json(), strict=True)
    except ValidationError as refusal:
        errors |= diagnosis.explain_refusal(refusal)
    except UsageError:  # a date is not a valid name, and has its error already
        if not errors:
            raise
    if errors:
        in_order = sorted(errors.values(), key=lambda error: error.line or 0)
        count = f"{len(errors)} mistakes" if len(errors) < MOST_REPORTED else "many mistakes; among them"
        raise joined(f"{path} has {count}", in_order[:MOST_REPORTED])
    return settings


def _model(document: toml_document.TomlDocument) -> type[CellSettings]:
    """The model by the mechanism that the file names; raises ``FileError`` if it is not installed."""
    stated = document.data.get("robot")
    robot = stated if isinstance(stated, dict) else {}
    name = robot.get("mechanism")
    if not isinstance(name, str):
        name = DEFAULT_MECHANISM
    if name not in (known := names(Group.MECHANISMS)):
        action = (
            did_you_mean(name, known) or f"Known are: {', '.join(known)}; or install the package with it"
        )
        raise document.error(("robot", "mechanism"), f"there is no mechanism '{name}'", action)
    scales = robot.get("encoder_scales") is True
    return cell_model(name, encoder_scales=scales, options=_options(document))


def _options(document: toml_document.TomlDocument) -> type[ControllerOptions]:
    """The options of the controller's protocol; without any, an absent one is told with the devices."""
    stated = document.data.get("controller")
    section = stated if isinstance(stated, dict) else {}
    protocol = section.get("protocol", DEFAULT_CONTROLLER)
    is_absent = protocol not in names(Group.CONTROLLERS) and not section.get("options")
    if protocol == DEFAULT_CONTROLLER or not isinstance(protocol, str) or is_absent:
        return ControllerOptions  # the default has none, and its driver takes a while to be imported
    try:
        return controller_options(protocol)
    except UsageError as error:
        raise document.error(("controller", "protocol"), error.problem, error.action or "") from error


def controller_options(protocol: str) -> type[ControllerOptions]:
    """The options of a controller's protocol: ``Options`` of its driver, if it has any.

    Raises:
        UsageError: there is no such driver.
        PluginFailed: it cannot be imported, or has options that are no ``ControllerOptions``.
    """
    options = getattr(load(Group.CONTROLLERS, protocol), "Options", ControllerOptions)
    if not (isinstance(options, type) and issubclass(options, ControllerOptions)):
        raise broken(
            Group.CONTROLLERS, protocol, "its Options are no hexacell.cell.robot.ControllerOptions"
        )
    return options


def dump(settings: Section, remark: Remark = lambda _: None) -> str:
    """The settings as TOML with defaults, each number in full; without passwords and values of None."""
    return "\n".join(_section(settings, (), remark)).lstrip("\n") + "\n"


def subsections(path: toml_document.KeyPath, value: object) -> list[tuple[toml_document.KeyPath, Section]]:
    """The sections in the value at ``path``, each with its path; empty for a plain value."""
    if isinstance(value, Section):
        return [(path, value)]
    items = value if isinstance(value, tuple) else ()
    return [((*path, n), item) for n, item in enumerate(items) if isinstance(item, Section)]


def _section(section: Section, path: toml_document.KeyPath, remark: Remark) -> Iterator[str]:
    """The section's own values first: after a header every key belongs to the section it opens."""
    for name, value in section:
        if not subsections((*path, name), value):
            shown, key = None if value == () and _has_sections(section, name) else value, section.key(name)
            yield from _setting(key, shown, remark((*path, key)))
    for name, value in section:
        for inner, subsection in subsections((*path, name), value):
            yield from ("", toml_document.table_header(inner))
            yield from _section(subsection, inner, remark)


def _has_sections(section: Section, name: str) -> bool:
    """Whether a key is a list of sections: an empty one leaves room for its first ``[[section]]``."""
    items = get_args(section.__class__.model_fields[name].annotation)
    return bool(items) and isinstance(items[0], type) and issubclass(items[0], Section)


def _setting(name: str, value: object, comment: str | None) -> list[str]:
    if value is None:
        return [f"# {name} is not set"] if comment else []
    if isinstance(value, SecretStr):
        return [f"# {name} is not shown"] if comment else []
    return [f"{name} = {_value(value)}" + (f"  # {comment}" if comment else "")]


def _value(value: object) -> str:
    import tomlkit  # noqa: PLC0415 - only where a cell file is printed

    if isinstance(value, tuple) and value and all(isinstance(row, tuple) for row in value):
        return "[\n" + "".join(f"  {_value(row)},\n" for row in value) + "]"
    if isinstance(value, dict):
        table = tomlkit.inline_table()
        table.update(_masked(value))
        return table.as_string()
    if isinstance(value, date):
        value = value.isoformat()
    return tomlkit.item(value).as_string()


def _masked(value: Any) -> Any:  # noqa: ANN401 - what JSON and TOML can hold
    """A value of a cell file without the secrets in its tables, which may be those of a plug-in."""
    if isinstance(value, list):
        return [_masked(item) for item in value]
    if not isinstance(value, dict):
        return value
    return {
        key: toml_document.MASK
        if toml_document.is_secret((key,)) and not isinstance(inner, dict | list | None)
        else _masked(inner)
        for key, inner in value.items()
    }
