"""A cell file made from a few answers: each is checked by the rules of the whole file."""

import tomllib
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path

import tomlkit

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import checked_cell, controller_options, require_plugins
from hexacell.cell.robot import DEFAULT_CONTROLLER, ControllerOptions, mechanism_of
from hexacell.config.toml_format import native_layout
from hexacell.errors import FileError, HexacellError, flatten_errors
from hexacell.kinematics.mechanism import Mechanism
from hexacell.plugins import Group, names
from hexacell.services.devices.cell_answers import (
    GAUGE_AXES,
    CellAnswer,
    Document,
    gauge_answers,
    number,
    numbers,
    one_of,
    option_answers,
    whole,
)
from hexacell.services.offline import require_stated_poses
from hexacell.storage.atomic_files import read_text
from hexacell.storage.output_files import NEW_CELL, OutputFile
from hexacell.storage.toml_document import TomlDocument

HEADER = "# Made from a few answers. `hexacell cell show` prints it with every default.\n\n"
CELLS = ("simulated-hexaglide", "gough-stewart", "linapod", "rotary-cranks")
"""A simulated cell of each mechanism that comes along; answers that are proposed are from there."""
KEPT_SECTIONS = ("robot", "tolerances", "limits", "speed")
"""Its sections in which every answer has a place, and limits are stated with care."""
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


def _put_tolerance(document: Document, given: str) -> None:
    lengths = [key for key in document["tolerances"] if key.endswith("_mm") and key != "ball_mm"]
    document["tolerances"] |= dict.fromkeys(lengths, number(given))


def _put_bus(document: Document, given: str) -> None:
    interface, channel, *bitrate = given.split() if len(given.split()) > 1 else (given, "")
    if not channel or len(bitrate) > 1:
        raise ValueError("name the interface and the channel, such as: socketcan can0")
    rate = whole(bitrate[0]) if bitrate else BITRATE
    document["encoders"]["bus"] = {"interface": interface, "channel": channel, "bitrate": rate}


def _put_points(document: Document, given: str) -> None:
    *middle, reach = numbers(given, 4, "x y z of the middle, and how far the ball may go from it")
    for section, offsets in (("identification", POINT_OFFSETS), ("verification", HELD_OUT_OFFSETS)):
        points = [[m + reach * o for m, o in zip(middle, offset, strict=True)] for offset in offsets]
        document[section]["points"] = points


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
        """The one that was named, or that whose geometry the controller's config has."""
        return self._like[1]

    @property
    def _like(self) -> tuple[Document, Mechanism]:
        if (name := self.given.get("mechanism", "").strip()) in names(Group.MECHANISMS):
            return _cell_of(name), mechanism_of(name, encoder_scales=False)
        return _cell_like(self.path.parent / (self.given.get("config", "").strip() or self._likely_config))

    def answers(self) -> tuple[CellAnswer, ...]:
        """All that may be answered, in order; raises ``UsageError`` if a plug-in is broken."""
        like, mechanism = self._like
        joints = _joint_limits(mechanism)
        (tolerance, size), *_ = like["tolerances"].items()
        travel = " ".join(f"{like['limits'][key]:g}" for key in joints if key in like["limits"])
        middle, aside, *_ = like["identification"]["points"] or ([], [])
        points = " ".join(f"{one:g}" for one in (*middle, *(middle[1:2] and [middle[1] - aside[1]])))
        controllers, protocol = names(Group.CONTROLLERS), self.given.get("controller", "").strip()
        # The usual driver has no options, and takes a while to be imported.
        is_usual = protocol == DEFAULT_CONTROLLER or protocol not in controllers
        options = ControllerOptions if is_usual else controller_options(protocol)
        by_address = options is ControllerOptions
        mechanisms, place = names(Group.MECHANISMS), ("controller",)
        return (
            CellAnswer("name", ("name",), self.path.stem[:40]),
            CellAnswer("config", (*place, "config"), self._likely_config, put=self._put_config),
            CellAnswer("mechanism", ("robot", "mechanism"), mechanism.name, one_of(mechanisms)),
            CellAnswer("tolerance", ("tolerances", tolerance), f"{size:g}", put=_put_tolerance),
            CellAnswer("controller", (*place, "protocol"), DEFAULT_CONTROLLER, one_of(controllers)),
            *option_answers(options),
            CellAnswer(
                "host", (*place, "host"), "127.0.0.1", is_asked=by_address, is_optional=not by_address
            ),
            CellAnswer(
                "port", (*place, "port"), "5007", whole, is_asked=by_address, is_optional=not by_address
            ),
            CellAnswer("joints", ("limits", joints[0]), travel, put=self._put_joints),
            *(answer for number in range(len(GAUGE_AXES)) for answer in gauge_answers(number)),
            CellAnswer("bus", ("encoders", "bus"), "socketcan can0", put=_put_bus),
            CellAnswer(
                "nodes",
                ("encoders", "nodes"),
                "1 2 3 4 5 6",
                lambda given: numbers(given, 6, "the node of each leg", whole),
            ),
            CellAnswer("plates", ("limits", "gauge_travel_mm"), "5", number),
            CellAnswer("points", ("identification", "points"), points, put=_put_points),
        )

    def problem(self, name: str, given: str) -> str:
        """Why an answer cannot be taken; empty if it can."""
        if not given.isprintable():
            return "it has characters that cannot be shown; type it again"
        draft = replace(self, given={**self.given, name: given})
        try:
            answers, text = draft.answers(), draft._text()
            document = TomlDocument.parse(text, self.path)
        except (ValueError, HexacellError) as error:
            return str(error)
        [answer] = [one for one in answers if one.name == name]
        if answer.is_optional and not given.strip():
            return ""
        try:
            checked_cell(self.path, text)
        except HexacellError as error:
            # What it says of this answer, or of its section, by their lines; if no answer is missing there.
            section = answer.path[:-1]
            lines = {document.line_of(answer.path)}
            needed = (one for one in answers if one.is_asked and not one.default)
            if all(one.name in draft.given or one.path[: len(section)] != section for one in needed):
                lines.add(document.line_of(section))
            for one in flatten_errors(error):
                if isinstance(one, FileError) and one.line in lines:
                    return one.problem if one.action is None else f"{one.problem}. {one.action}"
        return ""

    def write(self) -> None:
        """Write the file; after a ``HexacellError`` there is no new one.

        The file is there already, it cannot be written, it would not be valid, or a pose is out of reach.
        """
        text, file = self._text(), OutputFile(self.path, NEW_CELL)
        file.require()
        cell = checked_cell(self.path, text)
        require_plugins(cell)
        require_stated_poses(cell)
        file.write(text.encode())

    def _text(self) -> str:
        """The file; raises ``ValueError`` where an answer cannot be read."""
        like, _ = self._like
        document: Document = {
            "version": 1,
            "name": "",
            "controller": {"config": "robot.toml"},
            "gauges": [{"name": axis, "axis": axis, "protocol": "sylvac"} for axis in GAUGE_AXES],
            "encoders": {"protocol": "cia406"},
            "identification": {"points": []},
            "verification": {"points": []},
            **{name: like[name] for name in KEPT_SECTIONS},
        }
        for gauge, keys in zip(document["gauges"], self.found_gauges, strict=False):
            gauge.update(keys)
        document["encoders"] |= self.found_encoders
        for answer in self.answers():
            if answer.name in self.given:
                answer.enter(document, self.given[answer.name])
            elif answer.is_asked:
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
        limits = numbers(given, 2, "the smallest and the largest position")
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
    """A cell of the mechanism that has most of the parameters which a controller's config names."""
    named = set[str]()
    with suppress(HexacellError, ValueError, LookupError, TypeError):  # told when it is read
        named = {*tomllib.loads(read_text(config))["geometry"]}
    found = list[tuple[int, str]]()
    for name in (*_bundled_cells(), *names(Group.MECHANISMS)):  # of equal ones the first
        with suppress(HexacellError):  # a broken plug-in is told once it is chosen
            kinds = mechanism_of(name, encoder_scales=False).parameters.kinds
            found.append((len(named and named ^ {kind.symbol for kind in kinds}), name))
    name = min(found, key=lambda one: one[0])[1]
    return _cell_of(name), mechanism_of(name, encoder_scales=False)


def _cell_of(mechanism: str) -> Document:
    """Sections of a mechanism's cell: of the one that comes along, or what the mechanism says itself."""
    if mechanism in _bundled_cells():
        return deepcopy(_bundled_cells()[mechanism])
    kinds = mechanism_of(mechanism, encoder_scales=False).parameters.kinds
    sizes = {kind.tolerance_key: kind.default_tolerance or kind.unit.like_a_mm for kind in kinds}
    robot = {"mechanism": mechanism, "nominal": {}}
    return {
        "robot": robot,
        "tolerances": sizes,
        "limits": {},
        "speed": {},
        "identification": {"points": []},
    }


@cache
def _bundled_cells() -> dict[str, Document]:
    cells = (tomllib.loads(read_text(bundled_config(name))) for name in CELLS)
    return {cell["robot"]["mechanism"]: cell for cell in cells}
