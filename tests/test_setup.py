"""Setting up with make, against a fake Python that records its calls."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parent.parent

MARKED = "not slow and not benchmark and not linuxcnc"
ELSEWHERE = "--ignore=tests/benchmarks --ignore=tests/linuxcnc"
THE_TESTS = f"-m pytest -n 4 --dist loadfile --no-loadscope-reorder {ELSEWHERE} -m {MARKED}"
"""The arguments that ``make test`` gives to Python."""
AT_LINUXCNC = "-m pytest tests/linuxcnc --timeout=1200 -m not slow"

FAKE_PYTHON = """\
#!/bin/sh
lacks() { case " $LACKING " in *" $1 "*) true ;; *) false ;; esac; }
echo "$0 $*" >>"$NOTES"
case "$*" in
    "-V") echo "Python 3.9.2" ;;
    *version_info*) ! lacks version ;;
    "-m venv"*)
        mkdir -p .venv/bin && cp "$0" .venv/bin/python
        case "$*" in *--without-pip*) ;; *) ! lacks ensurepip ;; esac ;;
    "-c import pip") ! lacks ensurepip ;;
    "-m pip --version") ! lacks pip ;;
    *install*editable*) ! lacks network ;;
esac
"""


@dataclass
class Newcomer:
    """Somebody at a checkout, with a Python that may lack a thing or two."""

    checkout: Path
    python: Path
    lacking: str = ""
    printed: list[str] = field(default_factory=list)
    environment: dict[str, str] = field(default_factory=lambda: {"PATH": os.environ["PATH"]})

    def make(self, *arguments: str) -> int:
        """Run make; what it says on stderr goes to ``printed``, make's own last line excepted."""
        notes = self.python.with_name("notes")
        environment = {**self.environment, "NOTES": str(notes), "LACKING": self.lacking}
        command = ["make", f"PYTHON={self.python}", *arguments]
        done = subprocess.run(
            command, cwd=self.checkout, env=environment, capture_output=True, text=True, check=False
        )
        self.printed = [line for line in done.stderr.splitlines() if not line.startswith("make: ***")]
        return done.returncode

    def calls(self) -> list[str]:
        """What Python was asked since the last time, the base one's calls marked with ``base:``."""
        notes = self.python.with_name("notes")
        lines = notes.read_text().splitlines() if notes.exists() else []
        notes.unlink(missing_ok=True)
        return [line.replace(str(self.python), "base:").removeprefix(".venv/bin/python ") for line in lines]

    def installations(self) -> list[str]:
        """The calls that make a venv or install."""
        return [call for call in self.calls() if "-m venv" in call or " install " in call]


FROM_SCRATCH = [
    "base: -m venv .venv",
    "-m pip install --quiet --constraint constraints.txt hatchling",
    "-m pip install --quiet --constraint constraints.txt --no-build-isolation --editable .[dev]",
]
IN_PLACE = FROM_SCRATCH[1:]


@pytest.fixture
def newcomer(tmp_path: Path) -> Newcomer:
    """A fresh clone in a folder whose name has a space."""
    checkout = tmp_path / "a checkout"
    shutil.copytree(CHECKOUT / ".ci", checkout / ".ci")
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(CHECKOUT / name, checkout)
    python = tmp_path / "python3"
    python.write_text(FAKE_PYTHON)
    python.chmod(0o755)
    return Newcomer(checkout, python)


@pytest.fixture
def settled(newcomer: Newcomer) -> Newcomer:
    """The same, installed."""
    assert newcomer.make("venv") == 0
    assert newcomer.installations() == FROM_SCRATCH
    return newcomer


def test_what_is_installed_is_used_and_each_bench_adds_its_requirements_once(settled: Newcomer) -> None:
    settled.python.unlink()
    (settled.checkout / "pyproject.toml").touch()
    assert settled.make("test") == 0
    assert (settled.calls(), settled.printed) == (["-c ", THE_TESTS], [])
    for _ in range(2):
        settled.make("bench")
    added = "-m pip install --quiet --constraint constraints.txt --no-build-isolation --editable"
    assert settled.installations() == [f"{added} .[bench]", f"{added} .[peers]"]


def test_other_pins_are_installed_in_place(settled: Newcomer) -> None:
    for name in ("pyproject.toml", "constraints.txt"):
        with (settled.checkout / name).open("a") as pins:
            pins.write("# changed\n")
        assert settled.make("venv") == 0
        assert settled.installations() == IN_PLACE


def test_an_interrupted_installation_starts_anew(newcomer: Newcomer) -> None:
    newcomer.lacking = "network"
    assert newcomer.make("venv") == 2
    assert newcomer.printed[-1] == "hexacell: installing stopped, see above; once mended, run make again"
    (newcomer.checkout / ".venv/half-written").touch()
    newcomer.calls()
    newcomer.lacking = ""
    assert newcomer.make("venv") == 0
    assert newcomer.installations() == FROM_SCRATCH
    assert not (newcomer.checkout / ".venv/half-written").exists()


def test_a_venv_that_is_copied_or_without_its_python_is_made_anew(settled: Newcomer) -> None:
    settled.checkout = shutil.copytree(settled.checkout, settled.checkout.with_name("another"))
    for _ in range(2):
        assert settled.make("venv") == 0
        assert settled.installations() == FROM_SCRATCH
        (settled.checkout / ".venv/bin/python").unlink()


def test_without_ensurepip_the_outer_pip_installs(newcomer: Newcomer) -> None:
    newcomer.lacking = "ensurepip"
    assert newcomer.make("venv") == 0
    assert newcomer.installations() == [
        "base: -m venv .venv",
        "base: -m venv --clear --without-pip .venv",
        *(call.replace("-m pip", "base: -m pip --python .venv/bin/python") for call in IN_PLACE),
    ]


@pytest.mark.parametrize(
    ("lacking", "line"),
    [
        ("version", "Python 3.11 or newer is needed, '{}' is Python 3.9.2: name a newer one: "),
        ("ensurepip pip", "'{}' can neither make a venv with pip nor has pip itself: install python3-"),
    ],
)
def test_an_unusable_python_is_reported_in_one_line(newcomer: Newcomer, lacking: str, line: str) -> None:
    newcomer.lacking = lacking
    assert newcomer.make("test") == 2
    [said] = [said for said in newcomer.printed if "setting up" not in said]
    assert said.startswith("hexacell: " + line.format(newcomer.python))
    assert not any(" install " in call for call in newcomer.calls())


def test_python_environment_variables_are_not_passed_on(settled: Newcomer) -> None:
    python = settled.checkout / ".venv/bin/python"
    python.write_text('#!/bin/sh\necho "[$PYTHONPATH$PYTHONDONTWRITEBYTECODE]" >&2\n')
    settled.environment |= {"PYTHONPATH": "/opt/ros", "PYTHONDONTWRITEBYTECODE": "1"}
    assert settled.make("test") == 0
    assert set(settled.printed) == {"[]"}


SLOWEST = "--durations=10"
NOT_RUN = "LinuxCNC could not be installed: make test-linuxcnc was not run"


def ci(newcomer: Newcomer, lint: int = 0, linuxcnc: int | None = None) -> tuple[int, list[str]]:
    """Status and lines of ``.ci/run``, where lint and the tests at LinuxCNC end as told; or without it."""
    (newcomer.checkout / ".venv/bin/python").write_text(
        '#!/bin/sh\necho "$CI $*"\n'
        f'case "$*" in *ruff*) exit {lint} ;; *"pytest tests/linuxcnc"*) exit {linuxcnc} ;; esac\n'
    )
    lints = newcomer.checkout / ".venv/bin/lint-imports"
    lints.write_text("#!/bin/sh\n")
    lints.chmod(0o755)
    path = newcomer.checkout.parent / "bin"
    path.mkdir()
    replaced = {"linuxcnc", "halcompile", "apt-get"}
    for folder in os.environ["PATH"].split(os.pathsep):
        for program in Path(folder).glob("*"):
            if program.name not in replaced and not (path / program.name).is_symlink():
                (path / program.name).symlink_to(program)
    for name in replaced if linuxcnc is not None else {"apt-get"}:
        (path / name).write_text("#!/bin/sh\nexit 100\n")
        (path / name).chmod(0o755)
    done = subprocess.run(
        ["bash", "-c", ".ci/run 2>&1"],
        cwd=newcomer.checkout,
        env=newcomer.environment | {"PATH": str(path)},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout.splitlines()


def test_ci_lints_and_tests_even_if_lint_fails(settled: Newcomer) -> None:
    status, said = ci(settled, lint=1)
    assert status != 0
    assert "true -m ruff check" in said
    assert said[-3:] == [f"true {THE_TESTS} {SLOWEST}", "make lint failed, see above", NOT_RUN]


@pytest.mark.parametrize("status", [0, 1])
def test_ci_runs_the_tests_at_linuxcnc_last_and_fails_if_they_do(settled: Newcomer, status: int) -> None:
    found, said = ci(settled, linuxcnc=status)
    tests = [line for line in said if line.startswith("true -m pytest")]
    assert tests == [f"true {THE_TESTS} {SLOWEST}", f"true {AT_LINUXCNC} {SLOWEST}"]
    assert (found != 0, NOT_RUN in said) == (status != 0, False)
