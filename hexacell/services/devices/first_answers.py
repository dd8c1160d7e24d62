"""What is asked for a first cell file: the name of each answer, where it belongs, and how it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from hexacell.plugins import Group, names
from hexacell.storage.toml_locations import KeyPath

GAUGE_AXES = "xyz"
POINT_OFFSETS = (
    (0.0, 0.0, 0.0),
    (0.0, -1.0, 0.0),
    (0.5, -0.5, -0.25),
    (0.5, 0.0, 0.25),
    (-0.5, 0.5, -0.25),
)
HELD_OUT_OFFSETS = ((-0.5, -0.25, -0.5), (0.5, 0.5, 0.0), (0.0, -0.5, 0.25))
"""Of the ball, in units of its largest distance from the middle: as in Table 3 of the paper."""

DESCRIBED = frozenset({"request", "stream", "visa", "modbus"})
"""Protocols of gauges of which the cell file must say more than one answer does."""

Document = dict[str, Any]
Setting = Callable[[Document, str], None]
"""Puts an answer into a document; raises ``ValueError`` with what is expected."""


@dataclass(frozen=True, slots=True)
class CellAnswer:
    """One thing that is asked: where its answer belongs, how it gets there, and what it is by default."""

    name: str
    path: KeyPath
    put: Setting
    default: str


def machine_answers() -> Iterator[CellAnswer]:
    """The robot and its controller; its config comes before."""
    yield CellAnswer("tolerance", ("tolerances", "S_mm"), _put_tolerance, "7")
    yield CellAnswer("host", ("controller", "host"), putting(("controller", "host")), "127.0.0.1")
    yield CellAnswer("port", ("controller", "port"), putting(("controller", "port"), _whole), "5007")
    yield CellAnswer("sliders", ("limits", "joint_min_mm"), _put_sliders, "-800 800")


def gauge_answers(number: int) -> Iterator[CellAnswer]:
    """One gauge: what it speaks, where, and which way it counts."""
    axis, place = GAUGE_AXES[number], ("gauges", number)
    yield CellAnswer(
        f"protocol {axis}", (*place, "protocol"), putting((*place, "protocol"), _protocol), "sylvac"
    )
    yield CellAnswer(f"port {axis}", (*place, "port"), putting((*place, "port")), f"/dev/ttyUSB{number}")
    yield CellAnswer(f"sign {axis}", (*place, "sign"), putting((*place, "sign"), _sign), "yes")


def other_answers() -> Iterator[CellAnswer]:
    """Encoders, gauges' plates, and where to measure."""
    yield CellAnswer("bus", ("encoders", "bus"), _put_bus, "socketcan can0")
    yield CellAnswer("nodes", ("encoders", "nodes"), putting(("encoders", "nodes"), _six), "1 2 3 4 5 6")
    yield CellAnswer(
        "plates", ("limits", "gauge_travel_mm"), putting(("limits", "gauge_travel_mm"), _number), "5"
    )
    yield CellAnswer("points", ("identification", "points"), _put_points, "0 0 550 200")


def putting(path: KeyPath, read: Callable[[str], object] = str.strip) -> Setting:
    """A setting that reads an answer and puts it at a path."""

    def put(document: Document, given: str) -> None:
        place: Any = document
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = read(given)

    return put


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


def _six(given: str) -> list[int]:
    return [int(number) for number in _numbers(given, 6, "the node of each leg")]


def _protocol(given: str) -> str:
    known = [name for name in names(Group.GAUGES) if name not in DESCRIBED]
    if given.strip() not in known:
        raise ValueError(f"it is one of {', '.join(known)}")
    return given.strip()


def _sign(given: str) -> int:
    signs = {"yes": 1, "y": 1, "no": -1, "n": -1}
    if given.strip().lower() not in signs:
        raise ValueError("answer yes or no")
    return signs[given.strip().lower()]


def _put_tolerance(document: Document, given: str) -> None:
    document["tolerances"] = {key: _number(given) for key in ("S_mm", "B_mm", "l_mm")}


def _put_sliders(document: Document, given: str) -> None:
    low, high = _numbers(given, 2, "the smallest and the largest position")
    document["limits"] |= {"joint_min_mm": low, "joint_max_mm": high}


def _put_bus(document: Document, given: str) -> None:
    interface, channel, *bitrate = given.split() if len(given.split()) > 1 else (given, "")
    if not channel or len(bitrate) > 1:
        raise ValueError("name the interface and the channel, such as: socketcan can0")
    rate = _whole(bitrate[0]) if bitrate else 500_000
    document["encoders"]["bus"] = {"interface": interface, "channel": channel, "bitrate": rate}


def _put_points(document: Document, given: str) -> None:
    *middle, reach = _numbers(given, 4, "x y z of the middle, and how far the ball may go from it")
    for section, offsets in (("identification", POINT_OFFSETS), ("verification", HELD_OUT_OFFSETS)):
        points = [[m + reach * o for m, o in zip(middle, offset, strict=True)] for offset in offsets]
        document[section]["points"] = points
