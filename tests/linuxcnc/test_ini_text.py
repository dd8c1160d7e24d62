"""Variables of INI files as LinuxCNC's own ``inivar`` finds them, generated ones and its examples."""

import random
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexacell.config.interface import NumberToken, number_of, replace_tokens
from hexacell.config.linuxcnc_ini import IniText
from hexacell.errors import FileError
from hexacell.storage.atomic_files import read_text

EXAMPLES = Path("/usr/share/doc/linuxcnc/examples/sample-configs")
SECTIONS, NAMES = ("A", "B", "JOINT_0"), ("X", "x", "HOME_OFFSET")
OF_EACH_EXAMPLE = 12
ANOTHER = "-1234.567891"

values = st.one_of(
    st.floats(-1000.0, 1000.0).map("{:.6f}".format),
    st.sampled_from(
        ["1", "+2.50", "1e1", "", "= 5", '"1"', "1 # mm", "2#mm", "3 ; mm", "yes", "1 2 3", "4\\"]
    ),
)
gaps = st.sampled_from(["", " ", "\t", "  "])
variables = st.tuples(gaps, st.sampled_from(NAMES), gaps, st.just("="), gaps, values, gaps).map("".join)
headers = st.tuples(gaps, st.sampled_from(SECTIONS), st.sampled_from(["", " ", " # c", "X = 5"])).map(
    lambda parts: f"{parts[0]}[{parts[1]}]{parts[2]}"
)
others = st.sampled_from(
    [
        *("", "# X = 7", "; X = 7", "#INCLUDE other.inc", "X 7", "X y = 7", "x", "[A"),
        *("# goes on \\", "NOTE = a\\", "[ A ]", "\u00b5 = 1"),
    ]
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("inivar") is None:
        pytest.skip("there is no LinuxCNC here; docs/linuxcnc.md says how to install it")
    made: Path = tmp_path_factory.mktemp("ini")
    return made


def of_linuxcnc(path: Path, section: str, name: str) -> str | None:
    """What LinuxCNC finds, without the blanks around it; none if nothing."""
    words = ["inivar", "-ini", str(path), "-sec", section, "-var", name]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else None


def token_of(text: str, section: str, name: str) -> NumberToken | None:
    """The number that the program finds; none if it refuses."""
    try:
        found = IniText(text, None, section).number(name)
        number_of(found, None)
    except FileError:
        return None
    return found


def require_same(path: Path, section: str, name: str) -> NumberToken | None:
    """What the program takes is what LinuxCNC takes, before and after it is written."""
    text = read_text(path)
    found = token_of(text, section, name)
    if found is None:
        return None
    assert of_linuxcnc(path, section, name) == found.text
    changed = path.with_name("changed.ini")
    changed.write_bytes(replace_tokens(text, {found: ANOTHER}).encode())
    assert of_linuxcnc(changed, section, name) == ANOTHER
    return found


@settings(max_examples=150)
@given(
    st.lists(st.one_of(variables, variables, headers, others), max_size=12),
    st.sampled_from(["\n", "\r\n"]),
    st.sampled_from(SECTIONS),
    st.sampled_from(NAMES),
)
def test_what_is_read_and_written_is_what_linuxcnc_finds(folder, lines, end, section, name) -> None:
    path = folder / "generated.ini"
    path.write_bytes(end.join([f"[{section}]", *lines]).encode())
    require_same(path, section, name)


def test_numbers_of_its_examples_are_those_that_linuxcnc_finds(folder) -> None:
    """A dozen numbers of each file, drawn; none of those that LinuxCNC has is refused without a reason."""
    files = sorted(EXAMPLES.rglob("*.ini"))
    if not files:
        pytest.skip("the examples of LinuxCNC are not installed here")
    draw, compared = random.Random(16), 0
    for source in files:
        path = folder / "example.ini"
        shutil.copyfile(source, path)
        text = IniText(read_text(path), None, "")
        keys = sorted({(one.section, one.name) for one in text._variables})
        for section, name in draw.sample(keys, min(OF_EACH_EXAMPLE, len(keys))):
            compared += require_same(path, section, name) is not None
    assert compared > 5 * len(files)
