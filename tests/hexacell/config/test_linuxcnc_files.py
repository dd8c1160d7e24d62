"""Configs of bundled cells as owners may have changed them, and limits in INI files."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexacell.cell.fields import LARGEST_NUMBER
from hexacell.cell.loader import load_cell
from hexacell.config.change import propose
from hexacell.config.interface import ControllerLimits
from hexacell.config.layout import ConfigLayout, fingerprint
from hexacell.config.linuxcnc_hal import HalText
from hexacell.config.linuxcnc_ini import UNLIMITED, limits_of_ini
from hexacell.config.write_back import commit, rollback
from hexacell.errors import FileError
from hexacell.kinematics.geometry import Geometry
from tests.several_config_files import LAYOUT, write_config

CONFIGS = Path(__file__).parents[3] / "configs"
CELLS = {
    "ini": CONFIGS / "linuxcnc-hexapod" / "cell.toml",
    "included": CONFIGS / "linuxcnc-hexaglide" / "cell.toml",
    "toml": CONFIGS / "simulated-hexaglide.toml",
}
HAL_AND_INI = "hal and ini"
REMARKS = ("", "# of the owner: S1X = 5.0", "# µm, ä", "#   [HEXAPOD]", "\t")
INI_LINES = ("#INCLUDE other.inc", "; a remark", "# setp genhexkins.base.0.x 1")


@dataclass(frozen=True)
class Real:
    """A config that comes with the program; ``texts`` are those of its files."""

    layout: ConfigLayout
    texts: tuple[str, ...]

    def of(self, *paths: Path) -> Geometry:
        """The geometry in files."""
        return self.layout.read(*paths).geometry


@pytest.fixture(scope="module", params=[*CELLS, HAL_AND_INI])
def real(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Real:
    paths: tuple[Path, ...]
    if request.param == HAL_AND_INI:
        layout, paths = LAYOUT, write_config(tmp_path_factory.mktemp("drawn"))
    else:
        cell = load_cell(CELLS[request.param])
        layout, paths = ConfigLayout.of(cell.settings), cell.config_paths
    return Real(layout, tuple(path.read_bytes().decode().replace("\r\n", "\n") for path in paths))


def as_owned(text: str, line_end: str, added: list[tuple[int, str]]) -> bytes:
    """The text with lines of its owner at some places, and other line ends."""
    lines = text.split("\n")
    for place, line in added:
        lines.insert(place % len(lines), line)
    return line_end.join(lines).encode()


def written(folder: Path, contents: list[bytes]) -> tuple[Path, ...]:
    """Links to files with these contents."""
    links = tuple(folder / f"link-{number}" for number, _ in enumerate(contents))
    for link, data in zip(links, contents, strict=True):
        target = link.with_name(f"config-of-{link.name}")
        target.write_bytes(data)
        link.symlink_to(target.name)
    return links


def moved(geometry: Geometry, rows: list[int]) -> Geometry:
    """Some of its numbers a millimetre and a bit larger."""
    vector = geometry.vector.copy()
    vector[rows] += 1.234567
    return Geometry(geometry.parameters, vector)


@settings(max_examples=20)
@given(st.data())
def test_a_change_is_written_in_its_lines_alone_and_undone_bit_for_bit(real: Real, data) -> None:
    is_toml = real.layout.formats[0].name == "toml"
    remarks = REMARKS if is_toml else REMARKS + INI_LINES
    added = st.lists(st.tuples(st.integers(0, 1000), st.sampled_from(remarks)), max_size=4)
    ends = st.sampled_from(["\n", "\r\n"])
    before = [as_owned(text, data.draw(ends), data.draw(added)) for text in real.texts]
    rows = data.draw(st.lists(st.integers(0, 41), min_size=1, max_size=4, unique=True))
    with tempfile.TemporaryDirectory() as place:
        links = written(Path(place), before)
        start, geometry = fingerprint(*links), real.of(*links)
        same = propose(links, real.layout, geometry, fingerprint_at_start=start)
        assert list(same.after_contents) == before
        change = propose(links, real.layout, moved(geometry, rows), fingerprint_at_start=start)
        receipt = commit(change, Path(place) / "backup")
        assert all(link.is_symlink() for link in links)
        assert real.of(*links).vector == pytest.approx(moved(geometry, rows).vector, abs=1e-6)
        after = [link.read_bytes().split(b"\n") for link in links]
        lines = [old.split(b"\n") for old in before]
        different = [
            pair for new, old in zip(after, lines, strict=True) for pair in zip(new, old, strict=True)
        ]
        assert 1 <= sum(new != old for new, old in different) <= len(rows)
        rollback(receipt)
        assert [link.read_bytes() for link in links] == before
        assert all(link.is_symlink() for link in links)


def test_what_is_not_utf8_is_refused_with_its_line_and_stays(real: Real, tmp_path: Path) -> None:
    contents = [text.encode() for text in real.texts]
    contents[-1] += "# Länge".encode("latin-1")
    links = written(tmp_path, contents)
    with pytest.raises(FileError, match="is not UTF-8 text") as caught:
        real.of(*links)
    assert caught.value.line == real.texts[-1].count("\n") + 1
    assert [link.read_bytes() for link in links] == contents


def test_those_of_the_hexaglide_that_comes_with_it() -> None:
    found = limits_of_ini(CONFIGS / "linuxcnc-hexaglide" / "hexaglide.ini")
    assert found.joints == ((-800.0, 200.0),) * 3 + ((-200.0, 800.0),) * 3
    assert found.axes is not None
    assert found.axes == (*((-300.0, 300.0),) * 2, (350.0, 750.0), *((-45.0, 45.0),) * 3)


@pytest.fixture
def ini(tmp_path: Path):
    def write(*lines: str) -> Path:
        path = tmp_path / "machine.ini"
        path.write_text("\n".join(lines))
        return path

    return write


def test_an_inch_machine_has_angles_in_degrees_too(ini) -> None:
    path = ini(
        "[AXIS_X]", "MIN_LIMIT = -2", "MAX_LIMIT = 3", "[AXIS_B]", "MIN_LIMIT = -45", "MAX_LIMIT = 45"
    )
    found = limits_of_ini(path, 25.4)
    assert found.axes is not None
    assert found.axes[0] == pytest.approx((-50.8, 76.2))
    assert found.axes[1:] == (None, None, None, (-45.0, 45.0), None)


@pytest.mark.parametrize(
    ("kind", "limits"),
    [("TYPE = LINEAR", (-50.8, 76.2)), ("TYPE = ANGULAR", (-2.0, 3.0)), ("FERROR = 1", (-50.8, 76.2))],
)
def test_joints_that_turn_have_limits_in_degrees(ini, kind, limits) -> None:
    each = [(f"[JOINT_{leg}]", kind, "MIN_LIMIT = -2", "MAX_LIMIT = 3") for leg in range(6)]
    found = limits_of_ini(ini(*(line for lines in each for line in lines)), 25.4)
    assert found.joints is not None
    assert found.joints == tuple(pytest.approx(limits) for _ in range(6))


def test_a_limit_that_is_not_there_is_none(ini) -> None:
    found = limits_of_ini(ini("[AXIS_Z]", "MAX_LIMIT = 700", "[JOINT_0]", "MIN_LIMIT = 1"))
    joints = ((1.0, LARGEST_NUMBER), *(UNLIMITED,) * 5)
    axes = (None, None, (-LARGEST_NUMBER, 700.0), None, None, None)
    assert found == ControllerLimits(joints=joints, axes=axes)
    assert limits_of_ini(ini("[EMC]")) == ControllerLimits()


@pytest.mark.parametrize("far", ["1e99", "1E+99", "1000001", "1e999"])
def test_what_linuxcnc_takes_for_no_limit_is_none(ini, far) -> None:
    both = "[AXIS_Z]", f"MIN_LIMIT = -{far}", f"MAX_LIMIT = {far}"
    assert limits_of_ini(ini(*both)) == ControllerLimits()
    found = limits_of_ini(ini(*both[:2], "MAX_LIMIT = 70"), 25.4)
    assert found.axes is not None
    assert found.axes[2] == pytest.approx((-LARGEST_NUMBER, 1778.0))
    with pytest.raises(FileError, match="is not within"):
        limits_of_ini(ini("[AXIS_Z]", f"MIN_LIMIT = {far}"))


def test_limits_in_a_file_that_is_included_hold_too(ini) -> None:
    path = ini("[AXIS_X]", "MAX_LIMIT = 5", "#INCLUDE  more.inc\r", "#INCLUDE absent.inc")
    path.with_name("more.inc").write_text("[AXIS_X]\nMIN_LIMIT = -4\nMAX_LIMIT = 9\n")
    assert limits_of_ini(path).axes == ((-4.0, 5.0), *(None,) * 5)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("\nsetp a.b \\\n  5\r\na.c = 6", [("a.b", "5", 3), ("a.c", "6", 4)]),
        ("setp a.\\\nb 5\nDISPLAY = x --port 5", [("a.b", "5", 2)]),
        ("setp a.b '#'\nnet x a.c <= a.b", [("a.b", "'#'", 1)]),
    ],
)
def test_pins_of_hal_texts_are_those_that_halcmd_sets(text, expected) -> None:
    """As halcmd of LinuxCNC 2.9 says which of them it does not find."""
    found = list(HalText(text, None).pins)
    assert [(pin, value.text, value.line) for pin, value in found] == expected
    assert [text[value.start : value.end] for _, value in found] == [value.text for _, value in found]


@pytest.mark.parametrize(
    ("lines", "problem", "line"),
    [
        (("[AXIS_A]", "MIN_LIMIT = 5", "MAX_LIMIT = -5"), r"MAX_LIMIT of \[AXIS_A\] is not above", 3),
        (("[AXIS_A]", "MIN_LIMIT = much"), "'much' is not a number", 2),
        (("[AXIS_A]", "MIN_LIMIT = -5 # deg"), "behind MIN_LIMIT stands '# deg'", 2),
        (("[AXIS_A]", "MIN_LIMIT = -5", "MIN_LIMIT = -4"), "a second time", 3),
        (("[ AXIS_A ]", "MIN_LIMIT = -5"), "blanks within the brackets", 2),
        (("[AXIS_A]", "# deg \\\r", "MIN_LIMIT = -5"), "the line before ends with a backslash", 3),
        (("[AXIS_A]", "; deg \\ \t", "MIN_LIMIT = -5"), "the line before ends with a backslash", 3),
        (("# deg\\", "[AXIS_A]", "MIN_LIMIT = -5"), "the line before ends with a backslash", 2),
    ],
)
def test_what_linuxcnc_would_read_otherwise_is_refused_with_its_line(ini, lines, problem, line) -> None:
    with pytest.raises(FileError, match=problem) as caught:
        limits_of_ini(ini(*lines))
    assert caught.value.line == line


def test_the_narrowest_of_two_limits_hold() -> None:
    one = ControllerLimits(
        joints=((-1.0, 5.0),) * 6, axes=((-9.0, 9.0), None, (1.0, 2.0), None, None, None)
    )
    two = ControllerLimits(
        joints=((-3.0, 3.0),) * 6, axes=((-5.0, 20.0), (0.0, 4.0), None, None, None, None)
    )
    both = ControllerLimits(
        joints=((-1.0, 3.0),) * 6, axes=((-5.0, 9.0), (0.0, 4.0), (1.0, 2.0), None, None, None)
    )
    assert one.narrowed(two) == two.narrowed(one) == both
    assert one.narrowed(ControllerLimits()) == ControllerLimits().narrowed(one) == one
