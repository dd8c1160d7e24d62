"""``hexacell-restart-linuxcnc`` against a ``linuxcnc`` that notes when it begins and ends."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.controllers.linuxcnc import restart as command
from drivers.controllers.linuxcnc.restart import restart
from hexacell.errors import UsageError

LINUXCNC = """#!{python}
import socket, sys
from pathlib import Path

lock, notes, ini = Path("lock"), Path("notes"), Path(sys.argv[-1]).read_text()
note = lambda word: notes.write_text(notes.read_text() + word + "\\n")
if "broken" in ini:
    sys.exit("machine.ini: no such kinematics")
lock.touch()
note("begin")
asked = 0
with socket.create_server(("127.0.0.1", {port})) as server:
    while True:
        connection, _ = server.accept()
        with connection, connection.makefile("rb") as lines:
            if lines.readline().split()[:2] != [b"hello", b"open"]:
                connection.sendall(b"HELLO NAK\\r\\n")
                continue
            connection.sendall(b"HELLO ACK EMCNETSVR 1.1\\r\\n")
            said = [lines.readline().strip(), lines.readline().strip()]
        asked += said == [b"set enable sesame", b"shutdown"]
        if asked > ini.count("garbled"):
            break
note("end")
lock.unlink()
"""
INIVAR = '#!/bin/sh\nsed -n "s/^$6 = //p" "$2" | sed -n "$8p"\n'
SCREEN = """#!{python}
import subprocess, sys
from pathlib import Path

screen = subprocess.Popen(["./{screen}", "-ini", str(Path(sys.argv[-1]).absolute()) + ".expanded"])
server = subprocess.Popen([str(Path(sys.argv[0]).with_name("server")), *sys.argv[1:]])
screen.wait()
Path("notes").write_text(Path("notes").read_text() + "closed\\n")
server.kill()
server.wait()
Path("lock").unlink()
"""
WINDOW = """#!{python}
import os, signal
from pathlib import Path

Path("window").write_text(str(os.getpid()))
signal.pause()
"""


class Machine:
    """The folder of one; ``ini`` is its INI file, ``notes`` when it began and ended."""

    def __init__(self, folder: Path, port: int) -> None:
        self.folder, self.port = folder, port
        self.started: list[subprocess.Popen[bytes]] = []
        self.ini = folder / "machine.ini"
        (folder / "notes").write_text("")
        self.display()

    def display(self, *more: str, program: str = "linuxcncrsh") -> None:
        options = f"-p {self.port} --connectpw open --enablepw=sesame -- -ini x"
        self.ini.write_text("\n".join([f"DISPLAY = {program} {options}", *more]))

    def restart(self) -> None:
        self.started.append(restart(self.ini, poll_s=0.01))

    @property
    def notes(self) -> list[str]:
        return (self.folder / "notes").read_text().split()


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Machine]:
    with socket.create_server(("127.0.0.1", 0)) as found:
        port = found.getsockname()[1]
    for name, text in (("linuxcnc", LINUXCNC.format(python=sys.executable, port=port)), ("inivar", INIVAR)):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(command, "LOCK", tmp_path / "lock")
    made = Machine(tmp_path, port)
    yield made
    for process in made.started[:-1]:
        process.wait()
    for process in made.started[-1:]:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_one_that_does_not_run_is_started(machine: Machine) -> None:
    machine.restart()
    assert machine.notes == ["begin"]


@pytest.mark.parametrize("how", ["", "garbled once"])
def test_one_that_runs_has_ended_before_it_is_started_again(machine: Machine, how: str) -> None:
    machine.display(how)
    machine.restart()
    machine.restart()
    assert machine.notes == ["begin", "end", "begin"]


def test_one_that_does_not_start_is_shown_with_what_it_said(machine: Machine) -> None:
    machine.display("broken")
    with pytest.raises(UsageError, match=r"ended at once: machine\.ini: no such kinematics"):
        restart(machine.ini)


def test_one_that_does_not_end_is_not_started_a_second_time(machine: Machine) -> None:
    (machine.folder / "lock").touch()
    with pytest.raises(UsageError, match="LinuxCNC does not end within 0 s"):
        restart(machine.ini, ended_s=0.0)
    assert machine.notes == []


def test_another_display_is_refused(machine: Machine) -> None:
    machine.display(program="axis")
    with pytest.raises(UsageError, match=r"\[APPLICATIONS\] APP of .*\.ini is linuxcncrsh"):
        restart(machine.ini)


@pytest.fixture(params=["axis", pytest.param("another", marks=pytest.mark.slow)])
def with_screen(machine: Machine, monkeypatch: pytest.MonkeyPatch, request) -> Machine:
    """LinuxCNC with a screen, which ends with it, and linuxcncrsh as an application beside it."""
    monkeypatch.setenv("DISPLAY", ":0")
    (machine.folder / "linuxcnc").rename(machine.folder / "server")
    for name, text in (
        ("linuxcnc", SCREEN.format(python=sys.executable, screen=request.param)),
        (request.param, WINDOW.format(python=sys.executable)),
        ("axis-remote", f"#!/bin/sh\ncd {machine.folder}\necho $1 >>notes\nkill $(cat window)\n"),
    ):
        (machine.folder / name).write_text(text)
        (machine.folder / name).chmod(0o755)
    server = f"linuxcncrsh -p {machine.port} -w open -e sesame"
    machine.ini.write_text(f"DISPLAY = ./{request.param} -x\nAPP = halshow\nAPP = {server}\n")
    return machine


def test_a_screen_beside_linuxcncrsh_is_ended_and_comes_back(with_screen: Machine) -> None:
    with_screen.restart()
    assert with_screen.notes == ["begin"]
    with_screen.restart()
    is_axis = (with_screen.folder / "axis").exists()
    quits = {"--quit"} if is_axis else set()
    assert {*with_screen.notes} - {"begin", "closed"} == quits
    assert [word for word in with_screen.notes if word not in quits] == ["begin", "closed", "begin"]


def test_a_screen_that_could_not_come_back_is_not_ended(with_screen: Machine, monkeypatch) -> None:
    with_screen.restart()
    monkeypatch.delenv("DISPLAY")
    with pytest.raises(UsageError, match="needs a screen, and there is no DISPLAY here"):
        restart(with_screen.ini)
    assert with_screen.notes == ["begin"]


@pytest.mark.parametrize(
    ("arguments", "problem"), [((), "no INI file is named"), (("machine.ini",), "'inivar'")]
)
def test_the_command_says_in_one_line_what_is_wrong(monkeypatch, capsys, arguments, problem) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sys, "argv", ["hexacell-restart-linuxcnc", *arguments])
    assert command.main() == 1
    said = capsys.readouterr().err
    assert said.startswith("hexacell-restart-linuxcnc: ")
    assert problem in said
    assert said.count("\n") == 1
