"""``hexacell serve``: the results of a cell by OPC UA, until it is interrupted."""

import signal
import sys

import pytest

from tests.hexacell.services.notify.local_servers import closed_port


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGTERM])
def test_it_serves_until_it_is_interrupted(start, cell_folder, number) -> None:
    port = closed_port()
    with cell_folder.cell.open("a") as cell:
        cell.write(f"\n[opcua]\nport = {port}\nanonymous = true\n")
    process = start("serve", cell_folder.cell)
    process.wait_for("serving", lambda: process.err)
    assert f"serving opc.tcp://127.0.0.1:{port}/hexacell/" in process.err
    assert "warning: anybody who reaches the server" in process.err
    process.popen.send_signal(number)
    assert process.popen.wait() == 0


def test_it_is_off_until_the_cell_file_says_otherwise(typed_here, cell_folder) -> None:
    outcome = typed_here("serve", cell_folder.cell)
    assert (outcome.code, "[opcua]" in outcome.err) == (2, True)


def test_without_asyncua_it_says_what_to_install(typed_here, cell_folder, monkeypatch) -> None:
    with cell_folder.cell.open("a") as cell:
        cell.write("\n[opcua]\nanonymous = true\n")
    for module in [name for name in sys.modules if name.startswith("hexacell.result_server")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "asyncua", None)
    outcome = typed_here("serve", cell_folder.cell)
    assert (outcome.code, "hexacell[opcua]" in outcome.err) == (2, True)


def test_who_serves_others_is_warned_and_needs_a_reader(typed_here, cell_folder) -> None:
    with cell_folder.cell.open("a") as cell:
        cell.write('\n[opcua]\nhost = "0.0.0.0"\n')
    outcome = typed_here("serve", cell_folder.cell)
    assert (outcome.code, "nobody may read the results" in outcome.err) == (2, True)
    assert "warning: who reaches 0.0.0.0:4840" in outcome.err
