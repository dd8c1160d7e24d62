"""Parts of the reference that are made from the program while the site is built.

A page has a line ``<!-- made from the program: NAME -->``; :func:`page_with_generated_parts` puts the part
of that name there, as Markdown.
"""

import argparse
import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from pydantic import TypeAdapter

from docs.raised_messages import GAP, HEADINGS, ROOT, raised_messages
from hexacell.cell.loader import schema
from hexacell.cli.arguments import make_parser
from procedures.steps.events import Event

MARK = re.compile(r"^<!-- made from the program: ([a-z -]+) -->$", flags=re.MULTILINE)


def page_with_generated_parts(page: str) -> str:
    """The Markdown of a page, with the parts that are made from the program in their places."""
    return MARK.sub(lambda mark: PARTS[mark[1]](page), page)


def escaped(text: str) -> str:
    """Text for a cell of a table."""
    return re.sub(r"([|<>*_`\[\]\\])", r"\\\1", text.replace("\n", " "))


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown."""
    head = list(head)
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def commands(_page: str = "") -> str:
    """Every command with its arguments, as its ``--help`` has them."""
    return "\n".join(_command_sections(make_parser()))


def _command_sections(parser: argparse.ArgumentParser) -> Iterator[str]:
    for action in parser._actions:
        if not isinstance(action, argparse._SubParsersAction):
            continue
        for command in action.choices.values():
            yield f"## `{command.prog}`\n\n{command.description}\n"
            rows = [_argument_row(one) for one in command._actions if _is_described(one)]
            if rows:
                yield table(["argument", "meaning"], rows)
            yield from _command_sections(command)


def _is_described(action: argparse.Action) -> bool:
    everywhere = {"help", "log_file", "verbose"}
    is_special = isinstance(action, argparse._SubParsersAction)
    return not is_special and action.dest not in everywhere and action.help != argparse.SUPPRESS


def _argument_row(action: argparse.Action) -> tuple[str, str]:
    choices = action.choices
    value = action.metavar or (f"{{{','.join(map(str, choices))}}}" if choices else action.dest.upper())
    words = " ".join(value) if isinstance(value, tuple) else value
    if action.nargs == 0:
        words = ""
    elif action.nargs == "?":
        words = f"[{words}]"
    name = " ".join(filter(None, [*action.option_strings[:1], words]))
    text = (action.help or "") % {"default": action.default}
    return f"`{name}`".replace("|", r"\|"), escaped(text)


def cell_keys(_page: str = "") -> str:
    """Every section of a cell file with its keys, from the JSON Schema."""
    return "\n".join(_cell_sections())


def _cell_sections() -> Iterator[str]:
    document = schema()
    definitions = document["$defs"]
    waiting = [("", document)]
    while waiting:
        name, section = waiting.pop(0)
        rows, parts = [], []
        for key, value in section["properties"].items():
            found, is_list = _sections_in(value, definitions)
            if not found:
                words = _type(value, definitions).removesuffix(" or null")
                default = _default(value, key in section.get("required", ()))
                rows.append((f"`{key}`", words, default, escaped(value.get("description", ""))))
            else:
                path = f"{name}.{key}" if name else key
                parts += [(f"[{path}]" if is_list else path, part) for part in found]
        yield f"## {f'`[{name}]`' if name else 'At the top of the file'}\n"
        yield f"{section.get('description', '')}\n"
        if rows:
            yield table(["key", "value", "default", "meaning"], rows)
        waiting = parts + waiting


def _sections_in(value: dict[str, Any], definitions: dict[str, Any]) -> tuple[list[dict[str, Any]], bool]:
    """The section that a key holds, or each that it may, and whether it is a list; none: a plain value."""
    options = [value, *value.get("anyOf", ())]
    is_list = any(option.get("type") == "array" for option in options)
    found = []
    for option in options:
        items = option.get("items") or next(iter(option.get("prefixItems", ())), None) or option
        reference = items.get("$ref", "").removeprefix("#/$defs/")
        if "properties" in definitions.get(reference, ()):
            found.append(definitions[reference])
    return found, is_list


_UNBOUNDED = 1e5


def _type(value: dict[str, Any], definitions: dict[str, Any]) -> str:  # noqa: PLR0911 - a case a kind of type
    """What a JSON Schema allows, in words."""
    if "$ref" in value:
        definition = definitions[value["$ref"].removeprefix("#/$defs/")]
        return _heading_of(definition) if "properties" in definition else _type(definition, definitions)
    if options := value.get("anyOf") or value.get("oneOf"):
        return " or ".join(dict.fromkeys(_type(one, definitions) for one in options))
    if "const" in value or "enum" in value:
        return " or ".join(f"`{one}`" for one in value.get("enum", [value.get("const")]))
    match value.get("type", ""):
        case "array":
            items = value.get("items") or next(iter(value.get("prefixItems", ())), None)
            if items is None:
                return "an empty list"
            count = value.get("minItems") if value.get("minItems") == value.get("maxItems") else None
            return f"{count or 'list of'} {'x ' if count else ''}{_type(items, definitions)}"
        case "number" | "integer" as kind:
            least, most = value.get("minimum"), value.get("maximum")
            words = "whole number" if kind == "integer" else "number"
            if least is not None and most is not None and abs(most) < _UNBOUNDED:
                return f"{words}, {least:g} to {most:g}"
            return f"{words} above 0" if least is not None and 0 < least < 1 else words
        case "string":
            return "time" if value.get("format") == "date-time" else "text"
        case kind:
            return {"boolean": "true or false", "null": "null", "object": "named values"}.get(kind, "text")


def _default(value: dict[str, Any], is_required: bool) -> str:
    if is_required:
        return "**required**"
    default = value.get("default")
    if default is None or default in ([], {}, ""):
        return ""
    if isinstance(default, bool):
        return f"`{str(default).lower()}`"
    shown = f"{default:g}" if isinstance(default, float) else str(default).replace("'", '"')
    return f"`{shown}`"


def messages(page: str) -> str:
    """Every message that the program raises, under what it is about, with what to do.

    ``page`` has a table with what to do about messages that do not say it themselves.
    """
    advice = dict(re.findall(r"^\| (.+?) \| (.+?) \|$", page, flags=re.MULTILINE))
    found: dict[str, set[tuple[str, str]]] = {}
    for message in raised_messages():
        problem = escaped(message.problem)
        action = escaped(message.action) or advice.get(problem, "")
        found.setdefault(message.kind, set()).add((problem, action))
    order = list(dict.fromkeys(HEADINGS.values()))
    sections = []
    for heading in sorted(found, key=order.index):
        rows = sorted(found[heading], key=lambda row: row[0].lstrip(f"{GAP} '\"").lower())
        sections.append(f"### {heading}\n\n{table(['message', 'what to do'], rows)}")
    return "\n".join(sections)


FIELDS = ROOT / "procedures" / "journal" / "fields.md"


def journal(_page: str = "") -> str:
    """Every event of a journal and every part of one, with its fields."""
    meanings = field_meanings()
    sections = []
    for heading, (description, fields) in journal_models().items():
        rows = [
            (f"`{name}`", words, *meanings[field_key(heading, name, meanings)])
            for name, words in fields.items()
        ]
        text = re.sub(r":\w+:`[~.]*([^`]+)`", r"`\1`", " ".join(description.split()))
        sections.append(f"### {heading}\n\n{text.replace('``', '`')}\n")
        if rows:
            sections.append(table(["field", "type", "unit", "meaning"], rows))
    return "\n".join(sections)


def field_meanings() -> dict[str, tuple[str, str]]:
    """Unit and meaning of each field, by name, or by event and name where that differs."""
    text = FIELDS.read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w .]+)` \| ([^|]*) \| ([^|]*) \|$", text, flags=re.MULTILINE)
    return {name: (unit.strip(), meaning.strip()) for name, unit, meaning in rows}


def field_key(heading: str, name: str, meanings: dict[str, tuple[str, str]]) -> str:
    """Under which name the table has the field of an event: a name of its own, or the common one."""
    own = f"{heading}.{name}"
    return own if own in meanings else name


def journal_models() -> dict[str, tuple[str, dict[str, str]]]:
    """Description and fields of every event by its kind, then of every model within them by kind or name.

    The fields are names with their types; ``kind`` says which event it is and is left out.
    """
    document = TypeAdapter(Event).json_schema()
    definitions = document["$defs"]
    events = [one["$ref"].removeprefix("#/$defs/") for one in document["oneOf"]]
    found = {}
    for model in map(definitions.__getitem__, dict.fromkeys([*events, *definitions])):
        if "properties" in model:
            fields = {name: _type(one, definitions) for name, one in model["properties"].items()}
            if "const" in model["properties"].get("kind", ()):
                del fields["kind"]
            found[_heading_of(model)] = model.get("description", ""), fields
    return found


def _heading_of(model: dict[str, Any]) -> str:
    """The word that says which event it is, where it is one of several; else the model's name."""
    return model["properties"].get("kind", {}).get("const") or model["title"]


FAULTS = ROOT / "tests" / "drivers" / "simulated" / "fault_table.md"
"""What becomes of each fault of a device, as the table of the test has it."""

PARTS: dict[str, Callable[[str], str]] = {
    "commands": commands,
    "cell keys": cell_keys,
    "messages": messages,
    "journal": journal,
    "faults of devices": lambda _page: FAULTS.read_text(encoding="utf-8"),
}
