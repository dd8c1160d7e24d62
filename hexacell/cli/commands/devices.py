"""``hexacell devices``: what is connected, as text for a cell file; and one device watched for a while."""

import argparse
import asyncio
import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from drivers.discovery.encoders import set_node_id
from hexacell.addresses import require_host
from hexacell.cell.fields import SerialPortName, first_mistake
from hexacell.cell.loader import LARGEST_FILE_BYTES
from hexacell.cli.commands.cell import cell_at
from hexacell.cli.console import Console
from hexacell.cli.terminal import is_interactive
from hexacell.errors import AnswerNeeded, ExitCode, UsageError
from hexacell.services.devices.device_diagnosis import diagnose
from hexacell.services.devices.device_search import draft_of, search_devices
from hexacell.services.devices.first_cell import CellDraft
from hexacell.storage.atomic_files import os_errors, read_text, require_creatable
from hexacell.storage.output_files import NEW_ANSWERS, OutputFile
from hexacell.storage.toml_document import TomlDocument
from hexacell.text import found_devices
from hexacell.text.layout import wrapped
from hexacell.text.screens.answers_file import take, template
from hexacell.text.screens.first_questions import FirstCellAssistant

TCP_PORTS = 1 << 16


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Search, or watch one device of a cell; nothing moves. Only ``--set-node`` sets a device."""
    if options.diagnose is not None and options.ports:
        problem = f"--diagnose watches a device of the cell, and {options.ports[0]} is a port"
        raise UsageError(problem, action="Leave the port out, or --diagnose")
    if options.set_node is not None:
        return _set_node(options, console)
    return _watch(options, console) if options.diagnose is not None else _search(options, console)


def _set_node(options: argparse.Namespace, console: Console) -> ExitCode:
    """Set the node id of the only device on a bus, once a person has agreed."""
    if len(options.can) != 1:
        raise UsageError("--set-node wants one bus", action="Name it: --can interface=slcan,channel=...")
    if not is_interactive():
        raise AnswerNeeded("--set-node changes a device for good", action="Start it at a terminal")
    console.print(wrapped(f"The only device on this bus gets node id {options.set_node}, and keeps it."))
    console.prompt("Is it the only one that is connected? Type yes: ")
    if sys.stdin.readline().strip().lower() != "yes":
        raise AnswerNeeded("you have not agreed", action="Nothing was set")
    before = set_node_id(_bus(options.can[0]), options.set_node)
    had = "had none" if before is None else f"had {before}"
    document = {"node": options.set_node, "before": before}
    console.show(document, f"Node {options.set_node} answers; it {had}.")
    return ExitCode.DONE


def _search(options: argparse.Namespace, console: Console) -> ExitCode:
    answers = _require_answers(options)
    for port in options.ports:
        try:
            TypeAdapter(SerialPortName).validate_python(port)
        except ValidationError as refusal:
            action = "Name a device path, socket://HOST:PORT or rfc2217://HOST:PORT"
            raise UsageError(first_mistake(refusal, "the port"), action=action) from refusal
    buses = [_bus(words) for words in options.can]
    found = asyncio.run(search_devices(options.ports, buses, _address(options.controller)))
    text = found_devices.cell_text(found)
    console.document(asdict(found) | {"cell": text})
    for line in found_devices.search_lines(found):
        console.print(wrapped(line))
    if options.write is not None:
        return _write(draft_of(found, options.write.path), options.answers, answers, console)
    if text:
        console.print(f"\nFor your cell file:\n\n{text}")
    return ExitCode.DONE


def _require_answers(options: argparse.Namespace) -> TomlDocument | None:
    """The answers of ``--answers``, if there are any yet; raises if they are needed and cannot come."""
    path: Path | None = options.answers
    if options.write is None and path is not None:
        raise UsageError("--answers is for a cell file that is written", action="Add --write CELL")
    if options.write is not None:
        require_creatable(options.write.path)
        if path is None and not is_interactive():
            action = "Start it at a terminal, or name a file of answers with --answers"
            raise AnswerNeeded("--write asks what no device reports", action=action)
    if path is None:
        return None
    with os_errors("cannot be read", path):
        is_new = not path.exists()
    return None if is_new else TomlDocument.parse(read_text(path, LARGEST_FILE_BYTES), path)


def _write(draft: CellDraft, file: Path | None, answers: TomlDocument | None, console: Console) -> ExitCode:
    """Write the cell file; without answers in their file, that file with the questions."""
    if file is None:
        _ask(draft, console)
    elif answers is None:
        OutputFile(file, NEW_ANSWERS).write(template(draft).encode())
        problem = f"{file} is new, and has every question with what is known or proposed"
        raise AnswerNeeded(problem, action="Correct it, and give the same command again")
    else:
        take(draft, answers)
        draft.write()
    console.print(f"\n{draft.path} is written. Next: hexacell preflight {draft.path}")
    return ExitCode.DONE


def _ask(draft: CellDraft, console: Console) -> None:
    """Ask for the rest, question by question; an empty answer takes what stands in brackets."""
    assistant = FirstCellAssistant(draft.path, draft)
    while not assistant.is_done:
        if assistant.problem:
            console.error(assistant.problem)
        text, hint = assistant.question
        console.print(f"\n{assistant.progress}: {text}\n  {hint}")
        console.prompt(f"[{assistant.suggestion}] ")
        typed = sys.stdin.readline()
        if not typed:
            raise AnswerNeeded("the questions were not all answered", action="No file was written")
        assistant.answer(typed.strip() or assistant.suggestion)


def _watch(options: argparse.Namespace, console: Console) -> ExitCode:
    if options.cell is None:
        raise UsageError("--diagnose wants the cell of the device", action="Add --cell CELL")
    found = asyncio.run(diagnose(cell_at(options.cell, console), options.diagnose, options.seconds))
    console.document({**asdict(found), "is_usable": found.is_usable})
    for line in found_devices.diagnosis_lines(found):
        console.print(wrapped(line))
    return ExitCode.DONE if found.is_usable else ExitCode.HARDWARE


def _bus(words: str) -> dict[str, Any]:
    pairs = [word.partition("=") for word in words.split(",")]
    if not all(name and value for name, _, value in pairs):
        raise UsageError(
            f"--can {words} does not say what the bus is",
            action="Write it like interface=slcan,channel=/dev/ttyACM0,bitrate=500000",
        )
    return {name.strip(): int(value) if value.isdigit() else value for name, _, value in pairs}


def _address(words: str) -> tuple[str, int]:
    host, _, port = words.rpartition(":")
    with suppress(UsageError):
        require_host(host)
        if port.isdecimal() and 0 < int(port) < TCP_PORTS:
            return host, int(port)
    raise UsageError(f"--controller {words} is not an address", action="Write it like 127.0.0.1:5007")
