"""``hexacell tui --serve``: browsers show the screen, its keys act, and nothing is left behind."""

import asyncio
import signal
import sys
from base64 import b64encode
from collections.abc import Iterator
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from tests.chromium import CHROMIUM, opened_browser
from tests.cli.commands import Process, Start
from tests.hexacell.services.notify.local_servers import closed_port
from tests.screen.served_cell import served_in
from tests.waiting import until, wait_until

in_a_browser = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")


@pytest.fixture(autouse=True)
def sockets_have_short_paths(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Else each page says first that they have not, whatever it is to show."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


def pages_of(process: Process) -> list[str]:
    """The processes of its pages that are not over."""
    number = process.popen.pid
    children = Path(f"/proc/{number}/task/{number}/children").read_text().split()
    return [child for child in children if not is_over(child)]


def is_over(number: str) -> bool:
    return not Path(f"/proc/{number}/exe").exists()


def served_at(start: Start, cell: Path, place: str = "127.0.0.1") -> tuple[Process, str]:
    port = closed_port()
    process = start("tui", cell, "--serve", f"{place}:{port}")
    process.wait_for("; Ctrl-C ends it", lambda: process.err)
    return process, f"http://127.0.0.1:{port}/"


@in_a_browser
async def test_a_browser_shows_the_screen_and_its_keys_act(start, cell_folder, tmp_path) -> None:
    process, address = served_at(start, cell_folder.cell)
    async with opened_browser(tmp_path / "browser") as browser:
        tab = await browser.open(address)
        await tab.wait_for("hexacell │")
        await tab.press("2")
        await tab.wait_for("What must hold before the robot moves")
        assert {url[: len(address)] for url in tab.loaded if not url.startswith("data:")} == {address}
        assert tab.problems == []
        other = await browser.open(address)
        await other.wait_for("hexacell │")
        first, second = pages_of(process)
        await tab.close()
        await until(lambda: is_over(first))
        assert [second] == pages_of(process)
        await other.press("q")
        await other.wait_for_element("body.-closed")
        await until(lambda: is_over(second))
    process.popen.send_signal(signal.SIGINT)
    assert await asyncio.to_thread(process.popen.wait) == 0


@pytest.fixture
def running_cell(tmp_path: Path) -> Iterator[Path]:
    """A cell that another process serves; its run ends with it."""
    with served_in(tmp_path) as path:
        yield path


@pytest.mark.slow
@in_a_browser
async def test_several_pages_watch_one_run(running_cell, start, tmp_path) -> None:
    _, address = served_at(start, running_cell)
    async with opened_browser(tmp_path / "browser") as browser:
        tab = await browser.open(address)
        await tab.wait_for("um, 0.")
        await tab.press("2")
        await tab.wait_for("What must hold before the robot moves")
        await tab.press("s")
        await tab.wait_for("1/2 ")  # the second record
        other = await browser.open(address)
        await asyncio.gather(tab.wait_for("1/3 "), other.wait_for("1/3 "))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
@in_a_browser
async def test_no_page_outlives_its_server(start, cell_folder, tmp_path, number: signal.Signals) -> None:
    process, address = served_at(start, cell_folder.cell)
    async with opened_browser(tmp_path / "browser") as browser:
        tab = await browser.open(address)
        await tab.wait_for("hexacell │")
        [page] = pages_of(process)
        process.popen.send_signal(number)
        await tab.wait_for_element("body.-closed")
        await until(lambda: is_over(page))
        await asyncio.to_thread(process.popen.wait)


def test_for_other_computers_there_is_the_password_of_the_cell(start, cell_folder) -> None:
    passwords = cell_folder.cell.with_name("screen.toml")
    passwords.write_text('user = "line-7"\npassword = "hidden-password"\n')
    passwords.chmod(0o600)
    with cell_folder.cell.open("a") as cell:
        cell.write('\n[screen]\npassword_file = "screen.toml"\n')
    process, address = served_at(start, cell_folder.cell, "0.0.0.0")
    assert "warning: who reaches 0.0.0.0:" in process.err
    with pytest.raises(HTTPError, match="401"):
        urlopen(address)
    known = {"Authorization": f"Basic {b64encode(b'line-7:hidden-password').decode()}"}
    with urlopen(Request(address, headers=known)) as answer:
        assert answer.status == 200
    process.popen.send_signal(signal.SIGTERM)
    wait_until(lambda: process.popen.poll() == 0)


def test_without_a_password_other_computers_are_not_served(typed_here, cell_folder) -> None:
    outcome = typed_here("tui", cell_folder.cell, "--serve", "0.0.0.0:8000")
    assert (outcome.code, "whoever reaches 0.0.0.0 could move the robot" in outcome.err) == (2, True)


def test_without_textual_serve_it_says_what_to_install(typed_here, cell_folder, monkeypatch) -> None:
    for module in [name for name in sys.modules if name.startswith("hexacell.screen_server")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "textual_serve.server", None)
    outcome = typed_here("tui", cell_folder.cell, "--serve")
    assert (outcome.code, "Install hexacell[serve]" in outcome.err) == (2, True)
