"""A cell file made from a few answers: each is checked by the rules of the whole file."""

import tomllib
from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import tomlkit

from hexacell.cell.bundled import bundled_config
from hexacell.cell.by_mechanism import cell_model
from hexacell.cell.described_devices import DESCRIBED_GAUGES
from hexacell.cell.loader import load_cell, validated
from hexacell.cell.robot import mechanism_of
from hexacell.config.toml_format import native_layout
from hexacell.errors import FileError, HexacellError, flatten_errors
from hexacell.kinematics.mechanism import Mechanism
from hexacell.plugins import Group, names
from hexacell.services.offline import require_stated_poses
from hexacell.storage.atomic_files import read_text
from hexacell.storage.output_files import NEW_CELL, OutputFile
from hexacell.storage.toml_document import KeyPath, TomlDocument

HEADER = "# Made from a few answers. `hexacell cell show` prints it with every default.\n\n"
CELLS = ("simulated-hexaglide", "gough-stewart", "linapod", "rotary-cranks")
"""A simulated cell of each mechanism; answers that are proposed are from there."""
KEPT_SECTIONS = ("robot", "tolerances", "limits", "speed")
"""Its sections in which every answer has a place, and limits are stated with care."""
GAUGE_AXES = "xyz"
BITRATE = 500_000
"""Rate of a CAN bus for which none is stated, bit/s."""
POINT_OFFSETS = (
    (0.0, 0.0, 0.0),
    (0.0, -1.0, 0.0),
    (0.5, -0.5, -0.25),
    (0.5, 0.0, 0.25),
    (-0.5, 0.5, -0.25),
)
HELD_OUT_OFFSETS = ((-0.5, -0.25, -0.5), (0.5, 0.5, 0.0), (0.0, -0.5, 0.25))
"""Places of the ball, in units of its largest distance from the middle: as in Table 3 of the paper."""

Document = dict[str, Any]


@dataclass(frozen=True, slots=True)
class CellAnswer:
    """One thing that is asked.

    Attributes:
        path: where the answer belongs.
        read: makes the value at the path of it, or raises ``ValueError`` with what is expected.
        put: enters an answer with more than this one value into a document, instead.
    """

    name: str
    path: KeyPath
    default: str
    read: Callable[[str], object] = str.strip
    put: Callable[[Document, str], None] | None = None

    def enter(self, document: Document, given: str) -> None:
        """Put an answer into a document; raises ``ValueError`` with what is expected."""
        if self.put is not None:
            self.put(document, given)
            return
        place: Any = document
        for key in self.path[:-1]:
            place = place[key]
        place[self.path[-1]] = self.read(given)


def _number(given: str) -> float:
    try:
        return float(given)
    except ValueError:
        raise ValueError(f"{given!r} is no number") from None


def _whole(given: str) -> int:
    try:
        return int(given)
    except ValueError:
        raise ValueError(f"{given!r} is no whole number") from None


def _numbers(given: str, count: int, names: str) -> list[float]:
    words = given.replace(",", " ").split()
    if len(words) != count:
        raise ValueError(f"{count} numbers are expected: {names}")
    return [_number(word) for word in words]


def _protocol(given: str) -> str:
    known = [name for name in names(Group.GAUGES) if name not in DESCRIBED_GAUGES]
    if given.strip() not in known:
        raise ValueError(f"it is one of {', '.join(known)}")
    return given.strip()


def _sign(given: str) -> int:
    signs = {"yes": 1, "y": 1, "no": -1, "n": -1}
    if given.strip().lower() not in signs:
        raise ValueError("answer yes or no")
    return signs[given.strip().lower()]


def _put_tolerance(document: Document, given: str) -> None:
    lengths = [key for key in document["tolerances"] if key.endswith("_mm") and key != "ball_mm"]
    document["tolerances"] |= dict.fromkeys(lengths, _number(given))


def _put_bus(document: Document, given: str) -> None:
    interface, channel, *bitrate = given.split() if len(given.split()) > 1 else (given, "")
    if not channel or len(bitrate) > 1:
        raise ValueError("name the interface and the channel, such as: socketcan can0")
    rate = _whole(bitrate[0]) if bitrate else BITRATE
    document["encoders"]["bus"] = {"interface": interface, "channel": channel, "bitrate": rate}


def _put_points(document: Document, given: str) -> None:
    *middle, reach = _numbers(given, 4, "x y z of the middle, and how far the ball may go from it")
    for section, offsets in (("identification", POINT_OFFSETS), ("verification", HELD_OUT_OFFSETS)):
        points = [[m + reach * o for m, o in zip(middle, offset, strict=True)] for offset in offsets]
        document[section]["points"] = points


def _gauge_answers(number: int) -> Iterator[CellAnswer]:
    axis, place = GAUGE_AXES[number], ("gauges", number)
    yield CellAnswer(f"protocol {axis}", (*place, "protocol"), "sylvac", _protocol)
    yield CellAnswer(f"port {axis}", (*place, "port"), f"/dev/ttyUSB{number}")
    yield CellAnswer(f"sign {axis}", (*place, "sign"), "yes", _sign)


@dataclass
class CellDraft:
    """A cell file that is being made at ``path``; ``given`` are the answers so far, by name.

    ``found_gauges`` and ``found_encoders`` are keys whose values devices reported, and nobody is asked.
    """

    path: Path
    given: dict[str, str] = field(default_factory=dict)
    found_gauges: tuple[Document, ...] = ()
    found_encoders: Document = field(default_factory=dict)

    @property
    def mechanism(self) -> Mechanism:
        """That whose geometry the controller's config has."""
        return self._like[1]

    @property
    def _like(self) -> tuple[Document, Mechanism]:
        return _cell_like(self.path.parent / (self.given.get("config", "").strip() or self._likely_config))

    def answers(self) -> tuple[CellAnswer, ...]:
        """All that is asked, in order."""
        bundled, mechanism = self._like
        joints = _joint_limits(mechanism)
        (tolerance, size), *_ = bundled["tolerances"].items()
        travel = " ".join(f"{bundled['limits'][key]:g}" for key in joints)
        middle, aside, *_ = bundled["identification"]["points"]
        points = " ".join(f"{one:g}" for one in (*middle, middle[1] - aside[1]))
        return (
            CellAnswer("name", ("name",), self.path.stem[:40]),
            CellAnswer("config", ("controller", "config"), self._likely_config, put=self._put_config),
            CellAnswer("tolerance", ("tolerances", tolerance), f"{size:g}", put=_put_tolerance),
            CellAnswer("host", ("controller", "host"), "127.0.0.1"),
            CellAnswer("port", ("controller", "port"), "5007", _whole),
            CellAnswer("joints", ("limits", joints[0]), travel, put=self._put_joints),
            *(answer for number in range(len(GAUGE_AXES)) for answer in _gauge_answers(number)),
            CellAnswer("bus", ("encoders", "bus"), "socketcan can0", put=_put_bus),
            CellAnswer(
                "nodes",
                ("encoders", "nodes"),
                "1 2 3 4 5 6",
                lambda given: [int(number) for number in _numbers(given, 6, "the node of each leg")],
            ),
            CellAnswer("plates", ("limits", "gauge_travel_mm"), "5", _number),
            CellAnswer("points", ("identification", "points"), points, put=_put_points),
        )

    def problem(self, name: str, given: str) -> str:
        """Why an answer cannot be taken; empty if it can."""
        if not given.isprintable():
            return "it has characters that cannot be shown; type it again"
        draft = replace(self, given={**self.given, name: given})
        try:
            document = TomlDocument.parse(draft._text(), self.path)
        except ValueError as error:
            return str(error)
        try:
            validated(document, cell_model(draft.mechanism.name, encoder_scales=False), self.path)
        except HexacellError as error:
            [answer] = [one for one in draft.answers() if one.name == name]
            # What it says of this answer, or of its section, by their lines.
            lines = {document.line_of(answer.path), document.line_of(answer.path[:-1])}
            for one in flatten_errors(error):
                if isinstance(one, FileError) and one.line in lines:
                    return one.problem if one.action is None else f"{one.problem}. {one.action}"
        return ""

    def write(self) -> None:
        """Write the file; after a ``FileError``, or ``SeveralErrors``, there is no new one.

        The file is there already, it cannot be written, or a pose is out of reach.
        """
        OutputFile(self.path, NEW_CELL).write(self._text().encode())
        try:
            require_stated_poses(load_cell(self.path))
        except HexacellError:
            self.path.unlink()
            raise

    def _text(self) -> str:
        """The file; raises ``ValueError`` where an answer cannot be read."""
        bundled, _ = self._like
        document: Document = {
            "version": 1,
            "name": "",
            "controller": {"config": "robot.toml"},
            "gauges": [{"name": axis, "axis": axis, "protocol": "sylvac"} for axis in GAUGE_AXES],
            "encoders": {"protocol": "cia406"},
            "identification": {"points": []},
            "verification": {"points": []},
            **{name: bundled[name] for name in KEPT_SECTIONS},
        }
        for gauge, keys in zip(document["gauges"], self.found_gauges, strict=False):
            gauge.update(keys)
        document["encoders"] |= self.found_encoders
        for answer in self.answers():
            if answer.name in self.given:
                answer.enter(document, self.given[answer.name])
            else:
                with suppress(ValueError):  # it is asked later
                    answer.enter(document, answer.default)
        return HEADER + tomlkit.dumps(document)

    def _put_config(self, document: Document, given: str) -> None:
        """Before it is calibrated, a controller has the geometry of the drawing."""
        document["controller"]["config"] = given.strip()
        try:
            read = native_layout(self.mechanism.parameters).read(self.path.parent / given.strip())
        except HexacellError as error:
            raise ValueError(str(error)) from error
        document["robot"]["nominal"] = read.geometry.document()

    def _put_joints(self, document: Document, given: str) -> None:
        limits = _numbers(given, 2, "the smallest and the largest position")
        document["limits"] |= zip(_joint_limits(self.mechanism), limits, strict=True)

    @cached_property
    def _likely_config(self) -> str:
        """The only file beside it that is a controller's config, or a usual name."""
        found = []
        for path in sorted(self.path.parent.glob("*.toml")):
            with suppress(HexacellError):
                native_layout(_cell_like(path)[1].parameters).read(path)
                found.append(path.name)
        return found[0] if len(found) == 1 else "robot.toml"


def _joint_limits(mechanism: Mechanism) -> tuple[str, str]:
    unit = mechanism.words.joint_unit
    return f"joint_min_{unit}", f"joint_max_{unit}"


def _cell_like(config: Path) -> tuple[Document, Mechanism]:
    """The simulated cell whose drawing has most of what a controller's config names."""
    named = set[str]()
    with suppress(HexacellError, ValueError, LookupError, TypeError):  # told when it is read
        named = {*tomllib.loads(read_text(config))["geometry"]}
    found = deepcopy(min(_cells(), key=lambda one: len(named ^ {*one["robot"]["nominal"]})))
    return found, mechanism_of(found["robot"]["mechanism"], encoder_scales=False)


@cache
def _cells() -> list[Document]:
    return [tomllib.loads(read_text(bundled_config(name))) for name in CELLS]
