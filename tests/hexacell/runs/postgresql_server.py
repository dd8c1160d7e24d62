"""A PostgreSQL of one's own, from Debian's packages: a cluster in a temporary folder, on a local socket."""

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

HOW_TO = (
    "no PostgreSQL is installed here, so the shared archive was not tested: apt-get install postgresql, "
    "then .venv/bin/python -m pytest tests/hexacell/runs/test_shared_archive.py"
)


def installed_programs() -> Path | None:
    """The folder of ``initdb`` and ``pg_ctl``; none if there is no PostgreSQL."""
    named = shutil.which("initdb")
    found = [Path(named).resolve().parent] if named else []
    found += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    return next((path for path in found if (path / "initdb").exists() and (path / "pg_ctl").exists()), None)


@contextmanager
def running_server(programs: Path) -> Iterator[str]:
    """The address of a database in a new cluster, which is stopped and removed afterwards.

    A server does not run as root, who has it run as another user.
    """
    user = "nobody" if os.geteuid() == 0 else None
    with tempfile.TemporaryDirectory(prefix="hexacell-pg-") as name:
        folder = Path(name)
        if user is not None:
            os.chown(folder, pwd.getpwnam(user).pw_uid, -1)

        def call(program: str, *arguments: str) -> None:
            subprocess.run(
                [programs / program, *arguments], cwd=folder, user=user, check=True, capture_output=True
            )

        data = str(folder / "data")
        call("initdb", "-D", data, "-U", "tester", "-A", "trust", "--no-sync", "--encoding=UTF8")
        options = f"-c listen_addresses='' -c unix_socket_directories={folder} -c fsync=off"
        call("pg_ctl", "-D", data, "-w", "-o", options, "-l", str(folder / "log"), "start")
        try:
            yield f"postgresql://tester@/postgres?host={folder}"
        finally:
            call("pg_ctl", "-D", data, "-w", "-m", "immediate", "stop")
