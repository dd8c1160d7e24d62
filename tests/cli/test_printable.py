"""Protects that no text from outside reaches an output with a raw control or a sign that hides text."""

import ast
import asyncio
import io
import json
import logging
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from textual.app import App
from textual.widgets import Digits

from hexacell.cli.commands.status import escaped
from hexacell.cli.console import Console
from hexacell.cli.process import fault_line, log
from hexacell.printable import printable
from hexacell.runs.run_folder import runs_folder
from hexacell.screen.widgets import CardPanel, ChoiceTable, LinePanel, RowList, TextPanel
from hexacell.storage.output_files import LOG, OutputFile
from hexacell.text.report.pages import html_of
from hexacell.text.screens.views import Card, Column, Row, Urgency
from procedures.journal.journal import encode, read_entries
from procedures.steps import events
from tests.hexacell.services.notify.notices import a_notice
from tests.hexacell.text.test_report_pages import report
from tests.mutations.texts import raw_signs

CHECKOUT = Path(__file__).parents[2]
HOSTILE = "a\x1b]0;title\x07\x1b[2J\x9b31m\x00\x08\x7f\r\u202e\u2066\u200b\u2028[red]\U000e0001z"
TEXTS = st.text(st.characters(), max_size=30) | st.just(HOSTILE)


@given(TEXTS)
def test_whatever_it_is_is_printable_and_says_which_signs_it_has(text) -> None:
    shown = printable(text)
    assert raw_signs(shown) == []
    assert printable(shown) == shown
    assert printable("Prüfstand 一 \u00a0│⠿ µm\n") == "Prüfstand 一 \u00a0│⠿ µm\n"


@given(TEXTS)
def test_no_output_of_the_command_line_has_any(text) -> None:
    shown = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", shown)
        patch.setattr(sys, "stderr", shown)
        console = Console(wants_json=True)
        for write in (console.print, console.error, console.warn, console.prompt):
            write(text)
        assert raw_signs(shown.getvalue()) == []
        shown.truncate(shown.seek(0))
        console.document({text: text})
    assert raw_signs(shown.getvalue()) == []
    assert json.loads(shown.getvalue()) == {text: text}


@given(TEXTS)
def test_no_notice_page_or_metric_has_any(text) -> None:
    notice = a_notice(line=text, run=text, host=text)
    assert raw_signs(f"{notice.line}{notice.run}{notice.host}{notice.title}") == []
    assert raw_signs(html_of(report(text)).replace("\t", "")) == []
    assert raw_signs(escaped(text)) == []


def test_no_log_or_report_of_a_fault_has_any(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with log(OutputFile(tmp_path / "log", LOG), 0):
        logging.getLogger("hexacell.x").warning("%s", HOSTILE, exc_info=ValueError(HOSTILE))
    line = fault_line(ValueError(HOSTILE), ["status", HOSTILE])
    for path in (tmp_path / "log", Path(line.rpartition(" ")[2])):
        assert "\\u001b]0;title" in path.read_text()
        assert raw_signs(path.read_text()) == []


async def test_no_widget_has_any() -> None:
    class OneOfEach(App[None]):
        def compose(self):
            yield TextPanel(HOSTILE)
            yield RowList()
            yield LinePanel()
            yield CardPanel()
            yield ChoiceTable([Column("a", 20)], id="table")

    app = OneOfEach()
    async with app.run_test(size=(120, 20)) as pilot:
        panel, rows = app.query_one(TextPanel), app.query_one(RowList)
        rows.show([("1", HOSTILE)])
        await pilot.pause()
        assert raw_signs(f"{panel.render()}{rows.options[0].prompt}{panel.content}") == []
        panel.show(f"again {HOSTILE}")
        assert raw_signs(str(panel.render())) == []
        assert "[red]" in str(panel.content)
        lines, card, table = app.query_one(LinePanel), app.query_one(CardPanel), app.query_one(ChoiceTable)
        lines.show([(HOSTILE, Urgency.ALARM)])
        card.show(Card(HOSTILE, HOSTILE, Urgency.GOOD, f"{HOSTILE} 1.5", (HOSTILE,)))
        table.show([Row("1", (HOSTILE,))])
        await pilot.pause()
        shown = f"{lines.content}{card.border_title}{card.border_subtitle}{table.get_row_at(0)[0].plain}"
        shown += "".join(str(one.content) for one in card.query(TextPanel)) + card.query_one(Digits).value
        assert raw_signs(shown) == []
        assert shown.count("[red]") == 7
        await asyncio.sleep(0)


def test_commands_show_no_sign_of_hostile_files_and_arguments(typed_here, cell_folder, tmp_path) -> None:
    name = HOSTILE.replace("\0", "")
    odd = tmp_path / f"{name}.toml"
    shutil.copy(cell_folder.cell, odd)
    (tmp_path / "key.toml").write_text('"\\u001b[31m\\u202e" = 1\n' + cell_folder.cell.read_text())
    (tmp_path / "m.csv").write_text("point,\x1b[31mdx,\u202edy\n1,\x9b2J,3\n")
    for typed in (
        ["status", odd],
        ["status", odd, cell_folder.cell],
        ["cell", "validate", odd],
        ["cell", "validate", tmp_path / "key.toml"],
        ["fit", cell_folder.cell, "--measurements", tmp_path / "m.csv"],
        ["run", cell_folder.cell, "--resume", name],
        ["run", cell_folder.cell, name],
        ["report", odd],
        ["devices", f"socket://{name}"],
        ["devices", "--controller", "\u2028:9"],
    ):
        outcome = typed_here(*typed)
        assert outcome.code == 2, typed
        assert raw_signs(outcome.out + outcome.err) == []


def test_runs_in_folders_whose_names_are_no_text_are_listed(typed_here, cell, run) -> None:
    runs_folder(cell).mkdir(parents=True)
    run.rename(runs_folder(cell) / "a\u2028\udcffz")
    (runs_folder(cell) / "damaged\udcff").mkdir()
    (runs_folder(cell) / "damaged\udcff" / "journal.jsonl").write_text("x\n")
    for command in ("history", "status"):
        listed = typed_here(command, cell.path)
        assert listed.code == 0, listed.err
        assert raw_signs(listed.out + listed.err) == []


def test_a_hostile_journal_is_shown_printable(typed_here, demo, tmp_path) -> None:
    entries = [
        encode(one if not isinstance(one.event, events.ResultValidated) else _judged(one))
        for one in read_entries(demo.run / "journal.jsonl")
    ]
    (tmp_path / "journal.jsonl").write_bytes(b"".join(entries))
    outcome = typed_here("replay", tmp_path / "journal.jsonl", "--only", "results")
    assert "\\u001b]0;title" in outcome.out.replace("\n", "")
    assert raw_signs(outcome.out + outcome.err) == []


def _judged(entry):
    return replace(entry, event=entry.event.model_copy(update={"line": HOSTILE.replace("\udce9", "")}))


WRITERS = {
    "drivers/controllers/adapter/served_robot.py",  # answers another program, in JSON
    "drivers/controllers/linuxcnc/module_program.py",  # likewise
    "hexacell/cli/commands/completion.py",  # made of the program's own words
    "drivers/controllers/linuxcnc/set_pins.py",  # commands of their own: printable() in each of them
    "drivers/controllers/linuxcnc/restart.py",
}


def test_nothing_else_prints_or_formats_a_log() -> None:
    for package in ("hexacell", "drivers", "procedures"):
        for path in (CHECKOUT / package).rglob("*.py"):
            called = [ast.unparse(node.func) for node in ast.walk(ast.parse(path.read_text()))
                      if isinstance(node, ast.Call)]  # fmt: skip
            if path.relative_to(CHECKOUT).as_posix() not in WRITERS:
                assert not {"print", "logging.Formatter", "sys.stderr.write"} & set(called), path
