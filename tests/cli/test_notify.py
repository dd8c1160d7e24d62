"""Unattended runs tell who the cell file names; and ``hexacell notify`` lists, tries and sends."""

import json
from unittest.mock import Mock

import pytest

from hexacell.runs.cell_lock import cell_lock
from tests.hexacell.services.notify.local_servers import broker, closed_port, webhook

CHECK = ("--mode", "check", "--unattended")
TOKEN = "hidden-token-7"


@pytest.fixture(autouse=True)
def reached_at_once(monkeypatch):
    """Servers on loopback, and again at once where they refuse."""
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    monkeypatch.setattr("hexacell.services.unattended.delivery.PAUSES_S", (0.0, 0.0))


def tell(folder, name: str, url: str, *lines: str) -> None:
    """Write a notification into the cell file."""
    further = "".join(f"{line}\n" for line in lines)
    with folder.cell.open("a") as cell:
        cell.write(f'\n[[notifications]]\nname = "{name}"\nurl = "{url}"\n{further}')


@pytest.mark.slow
def test_a_check_tells_its_verdict(typed_here, quick_cell, few_candidates, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("HEXACELL_NOTIFY_HALL_TOKEN", TOKEN)
    every = 'on = ["pass", "no-pass", "alarm", "answer-needed", "failure"]'
    with webhook() as server, broker() as state:
        tell(quick_cell, "hall", server.url, every)
        tell(quick_cell, "state", f"mqtt://127.0.0.1:{state.port}", every)
        tell(quick_cell, "nobody", f"http://127.0.0.1:{closed_port()}/", every)
        outcome = typed_here("run", quick_cell.cell, *CHECK, "--json")
    (body,) = server.bodies
    told = json.loads(body)
    assert told["due_at"] is None
    assert (told["exit_code"], told["verdict"]) == (outcome.code, outcome.document["verdict"])
    assert told["run"] == quick_cell.runs()[-1].name
    assert outcome.document["line"] in told["line"]
    assert server.headers[0]["Authorization"] == f"Bearer {TOKEN}"
    assert [json.loads(payload) for payload in state.retained.values()] == [told]
    (line,) = [line for line in outcome.err.splitlines() if "not notified" in line]
    assert "nobody: Connection refused" in line
    assert "hexacell notify CELL --send" in line
    for path in quick_cell.path.rglob("*"):
        assert not path.is_file() or TOKEN.encode() not in path.read_bytes()
    assert TOKEN not in outcome.err

    assert "waits for nobody" in typed_here("notify", quick_cell.cell).out
    assert typed_here("notify", quick_cell.cell, "--send").code == 3


def test_a_run_that_cannot_begin_is_told_too(typed_here, quick_cell) -> None:
    with webhook() as server:
        tell(quick_cell, "hall", server.url)
        with cell_lock(quick_cell.controller):
            outcome = typed_here("run", quick_cell.cell, *CHECK)
    told = json.loads(server.bodies[0])
    assert (outcome.code, told["exit_code"], told["occasions"]) == (5, 5, ["failure"])
    assert (told["run"], told["verdict"]) == (None, None)
    assert "\n" not in told["line"]


@pytest.mark.parametrize(
    ("raised", "told"),
    [(RuntimeError(TOKEN), "a fault of the program (RuntimeError)"), (KeyboardInterrupt(), "interrupted")],
    ids=["a fault", "a stop signal"],
)
def test_what_happens_while_it_is_told_leaves_the_exit_code(
    typed_here, quick_cell, monkeypatch, raised, told
) -> None:
    monkeypatch.setattr("hexacell.services.unattended.outbox.notify_all", Mock(side_effect=raised))
    tell(quick_cell, "hall", "http://127.0.0.1:1/")
    with cell_lock(quick_cell.controller):
        outcome = typed_here("run", quick_cell.cell, *CHECK)
    assert (outcome.code, f"not notified: {told}" in outcome.err) == (5, True)
    assert TOKEN not in outcome.err


def test_who_is_told_can_be_tried_and_sent_to_later(typed_here, quick_cell, tmp_path) -> None:
    with webhook() as server:
        tell(quick_cell, "hall", server.url)
        server.statuses = [503]
        with cell_lock(quick_cell.controller):
            typed_here("run", quick_cell.cell, *CHECK)
        tried = typed_here("notify", quick_cell.cell, "--test", "--json")
        assert (tried.code, tried.document["told"][0]["problem"]) == (3, "the server answers 503")
        server.statuses = [204]
        server.bodies.clear()
        assert typed_here("notify", quick_cell.cell, "--test").out == "hall: notified (1)\n"
        assert json.loads(server.bodies[-1])["occasions"] == ["test"]
        sent = typed_here("notify", quick_cell.cell, "--send")
        assert (sent.code, sent.out) == (0, "hall: notified (1)\n")
        assert json.loads(server.bodies[-1])["occasions"] == ["failure"]
        assert typed_here("notify", quick_cell.cell, "--send").out == "nothing waits\n"


def test_a_password_in_clear_is_warned_of(typed_here, quick_cell) -> None:
    text = quick_cell.cell.read_text()
    for url, is_warned in (
        ("http://host/", True),
        ("mqtt://host", True),
        ("https://host/", False),
        ("mqtt://127.0.0.1", False),
    ):
        quick_cell.cell.write_text(text)
        tell(quick_cell, "hall", url, 'password_file = "notify.toml"')
        err = typed_here("notify", quick_cell.cell).err
        assert ("goes over the network in clear" in err) is is_warned


def test_nobody_to_tell(typed_here, quick_cell) -> None:
    assert "nobody is notified" in typed_here("notify", quick_cell.cell).out
    outcome = typed_here("notify", quick_cell.cell, "--test")
    assert outcome.code == 2
    assert "[[notifications]]" in outcome.err
