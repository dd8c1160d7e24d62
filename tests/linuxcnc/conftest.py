"""A real LinuxCNC without a screen, of the configurations in ``configs/linuxcnc-...``.

Only one can run on a machine: a second one would end the first.
"""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.linuxcnc.server_client import ServerClient
from tests.waiting import wait_until

CONFIGURATIONS = Path(__file__).parents[2] / "configs"
LOCK = Path("/tmp/linuxcnc.lock")
STARTS = 3
STARTED_S, ENDED_S, ANSWER_S = 120.0, 20.0, 30.0
NOBODY = "65534"
TWO_FILES = "base and platform in the HAL file"
FURTHER_FILE = """\
[[controller.further_files]]
config = "hexapod.ini"
config_format = "linuxcnc-ini"
"""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    here = Path(__file__).parent
    for item in items:
        if here in item.path.parents:
            item.add_marker(pytest.mark.linuxcnc)


class LinuxCNC:
    """One in a folder of its own, started and ended as often as a test likes.

    Attributes:
        folder: of the configuration.
        ini: its INI file.
        port: where its server listens.
    """

    def __init__(self, folder: Path, ini: str, port: int) -> None:
        self.folder = folder
        self.ini = folder / ini
        self.port = port
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def environment(self) -> dict[str, str]:
        """For its programs, and those of hexacell; as root it wants another user to be."""
        fifo = {"RTAPI_UID": NOBODY, "RTAPI_FIFO_PATH": str(self.folder / "rtapi_fifo")}
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        return os.environ | (fifo if os.geteuid() == 0 else {}) | {"PATH": path}

    def start(self) -> None:
        """Start it and wait until its server answers.

        One that ends or stays silent is started again: that was seen once, on a machine that had just
        installed it, and not why.
        """
        for _ in range(STARTS):
            self._process = self._started()
            if self._answers_in_time(self._process):
                return
            self.kill()
        pytest.fail(f"LinuxCNC did not answer after {STARTS} starts; it printed\n{self.log}")

    def shut_down(self) -> None:
        """As its owner does."""
        with suppress(OSError), self.connect() as client:
            client.send("shutdown")
        self._wait()
        wait_until(lambda: not LOCK.exists())  # hexacell may have started it again

    def kill(self) -> None:
        """Its task and its server at once, as in a crash."""
        for name in ("milltask", "linuxcncrsh"):
            subprocess.run(["pkill", "-KILL", "-x", name], check=False)
        self._wait()

    def signal(self, name: str, program: str) -> None:
        """Send a signal to one of its programs: ``STOP`` freezes it, ``CONT`` lets it go on."""
        subprocess.run(["pkill", f"-{name}", "-x", program], check=True)

    @property
    def is_running(self) -> bool:
        """Whether it was started, and not killed or shut down since."""
        return self._process is not None

    @property
    def log(self) -> str:
        """All that it printed."""
        return (self.folder / "started.log").read_text(errors="replace")

    def connect(self) -> ServerClient:
        """A connection that may command."""
        connection = socket.create_connection(("127.0.0.1", self.port), timeout=ANSWER_S)
        try:
            return ServerClient(connection)
        except BaseException:
            connection.close()
            raise

    def pin(self, name: str) -> str:
        """What a pin has, with the seven digits that LinuxCNC tells."""
        return self._run("halcmd", "getp", name).stdout.strip()

    def set_pin(self, name: str, value: str) -> None:
        """Set a pin that nothing else drives."""
        self._run("halcmd", "setp", name, value)

    def hexacell(self, *arguments: str, timeout_s: float = 900.0) -> subprocess.CompletedProcess[str]:
        """Run the program in the folder of the configuration."""
        return self._run("hexacell", *arguments, timeout_s=timeout_s, check=False)

    def _run(
        self, *command: str, timeout_s: float = ANSWER_S, check: bool = True
    ) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command,
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=check,
        )

    def _started(self) -> subprocess.Popen[bytes]:
        with (self.folder / "started.log").open("ab") as log:
            return subprocess.Popen(
                ["linuxcnc", "-r", self.ini.name],
                cwd=self.folder,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def _answers_in_time(self, process: subprocess.Popen[bytes]) -> bool:
        """Whether its server answers; nothing but time tells that one that still runs never will."""
        given_up = time.monotonic() + STARTED_S
        wait_until(lambda: self._answers() or process.poll() is not None or time.monotonic() > given_up)
        return self._answers()

    def _answers(self) -> bool:
        try:
            self.connect().close()
        except OSError:
            return False
        return True

    def _wait(self) -> None:
        if self._process is None:
            return
        try:
            self._process.wait(ENDED_S)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait(ENDED_S)
        self._process = None


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The kinematics of the Hexaglide, for the LinuxCNC of this machine."""
    if shutil.which("linuxcnc") is None or shutil.which("halcompile") is None:
        pytest.skip("there is no LinuxCNC here; docs/linuxcnc.md says how to install it")
    component = CONFIGURATIONS / "linuxcnc-hexaglide" / "hexaglidekins.comp"
    source = shutil.copy(component, tmp_path_factory.mktemp("kinematics"))
    subprocess.run(["halcompile", "--install", Path(source).name], cwd=Path(source).parent, check=True)


@pytest.fixture
def linuxcnc(installed: None, folder_of_nobody: Path) -> Iterator[LinuxCNC]:
    """A copy of the Hexaglide's configuration; it is running."""
    yield from _running("hexaglide", folder_of_nobody)


@pytest.fixture
def hexapod(installed: None, folder_of_nobody: Path, request: pytest.FixtureRequest) -> Iterator[LinuxCNC]:
    """A copy of the stock hexapod's configuration; it is running.

    With the parameter ``TWO_FILES`` base and platform are numbers in its HAL file.
    """
    is_in_two = getattr(request, "param", None) == TWO_FILES
    yield from _running("hexapod", folder_of_nobody, _split_geometry if is_in_two else None)


@pytest.fixture
def folder_of_nobody() -> Iterator[Path]:
    """LinuxCNC of root runs as nobody, from whom another pytest that begins takes all folders of pytest."""
    with TemporaryDirectory(prefix="hexacell-linuxcnc-") as folder:
        Path(folder).chmod(0o777)
        yield Path(folder)


def _split_geometry(folder: Path) -> None:
    """As the stock configurations have it: the numbers in the HAL file, the zeros in the INI file."""
    hal, ini, cell = (folder / name for name in ("hexapod.hal", "hexapod.ini", "cell.toml"))
    head, _, rest = ini.read_text().partition("[HEXAPOD]\n")
    numbers, include, rest = rest.partition("#INCLUDE")
    values = dict(re.findall(r"(?m)^(\w+) = (\S+)$", numbers))
    hal.write_text(re.sub(r"\[HEXAPOD\](\w+)", lambda variable: values[variable[1]], hal.read_text()))
    ini.write_text(head + include + rest)
    text = cell.read_text().replace('config = "hexapod.ini" ', 'config = "hexapod.hal" ')
    text = text.replace('config_format = "linuxcnc-ini"', 'config_format = "linuxcnc-hal"')
    head, _, rest = text.partition("[controller.config_options]\n")
    names = rest.partition("names = ")[2].partition("\n")
    cell.write_text(f"{head}{FURTHER_FILE}config_options = {{ names = {names[0]} }}\n{names[2]}")


def _running(machine: str, place: Path, edit: Callable[[Path], None] | None = None) -> Iterator[LinuxCNC]:
    running = configuration(machine, place, f"{machine}.ini", edit)
    running.start()
    yield running
    running.shut_down()


def configuration(
    machine: str, place: Path, ini: str, edit: Callable[[Path], None] | None = None
) -> LinuxCNC:
    """A copy of a bundled configuration, with a port of its own; it does not run yet."""
    folder = place / f"linuxcnc-{machine}"
    shutil.copytree(CONFIGURATIONS / folder.name, folder)
    if edit is not None:
        edit(folder)
    port = _free_port()
    for name, pattern in ((ini, r"--port \d+"), ("cell.toml", r"port = \d+")):
        text = (folder / name).read_text()
        words = re.search(pattern, text)
        assert words is not None
        (folder / name).write_text(text.replace(words[0], f"{words[0].rsplit(maxsplit=1)[0]} {port}"))
    for path in (folder, *folder.iterdir()):
        path.chmod(path.stat().st_mode | 0o777)
    return LinuxCNC(folder, ini, port)


def _free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])
