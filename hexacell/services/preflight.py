"""Before a run: exclusions written into the cell file, one at a time, and warnings about the cell."""

import ipaddress
import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from hexacell.addresses import address_of
from hexacell.cell.limits import NEAR_DEG, NEAR_MM
from hexacell.cell.loader import Cell, checked_cell
from hexacell.cell.operation import scheme_of
from hexacell.dry_run.campaign import VisitedPose
from hexacell.errors import FileError, UsageError
from hexacell.kinematics.pose import Pose
from hexacell.storage.atomic_files import BYTE_ORDER_MARK, read_bytes, read_if_present, write_atomically

TABLES = (Path("/proc/net/tcp"), Path("/proc/net/tcp6"))
"""The kernel's tables of the connections and the open ports of this computer."""
_LISTENING = "0A"
_LATENCY_TIMERS = Path("/sys/bus/usb-serial/devices")


def toggle_exclusion(cell: Cell, name: str, planned: Sequence[VisitedPose]) -> Cell:
    """Exclude a point (``3``) or a planned pose (``3.2``), or remove the first exclusion (``e1``).

    Gives the cell as its file states it now. Raises ``UsageError`` if nothing has this name, or it is the
    reference of a point, and ``FileError`` if too little would be left, or the file has changed or cannot
    be edited.
    """
    stated = [(one.point, one.pose) for one in cell.settings.exclusions]
    if name.startswith("e") and name[1:].isdecimal() and 0 < int(name[1:]) <= len(stated):
        number = int(name[1:]) - 1
        del stated[number]
        return _rewritten(cell, _text_without(cell, number), stated)
    new = _exclusion_of(cell, name, planned)
    newline = "\r\n" if "\r\n" in cell.text else "\n"
    lines = ["", "[[exclusions]]", *(f"{key} = {value}" for key, value in new.items()), ""]
    text = cell.text if cell.text.endswith("\n") else cell.text + newline
    pose = tuple(new["pose"]) if "pose" in new else None
    return _rewritten(cell, text + newline.join(lines), [*stated, (new.get("point"), pose)])


def _exclusion_of(cell: Cell, name: str, planned: Sequence[VisitedPose]) -> Mapping[str, Any]:
    points = cell.settings.identification.points
    if name.isdecimal() and 0 < int(name) <= len(points):
        return {"point": int(name)}
    poses = {f"{point}.{orientation}": (orientation, pose) for point, orientation, pose in planned}
    if name not in poses:
        raise UsageError(
            f"there is no {name} in the plan", action="Name a point like 3, or a pose like 3.2"
        )
    orientation, pose = poses[name]
    if orientation == 1:
        problem = f"{name} is the reference of its point, from which the gauges measure"
        raise UsageError(problem, action=f"Exclude the whole point: {name.partition('.')[0]}")
    if cell.settings.identification.poses is not None:  # a list has this pose, and perhaps others near it
        return {"pose": list(pose.as_tuple()), "within_mm": 0.0, "within_deg": 0.0}
    # Poses are selected as a run goes, so it never commands exactly what was planned: those near count.
    references = [one for _, number, one in planned if number == 1]
    references += [Pose(*point) for point in (*points, *cell.settings.verification.points)]
    angles = [
        float(np.degrees(pose.angle_to(one)))
        for one in references
        if np.linalg.norm(one.position - pose.position) <= NEAR_MM
    ]
    nearest = min(angles, default=2.0 * NEAR_DEG)
    within_deg = min(NEAR_DEG, round(0.5 * nearest, 3))
    return {"pose": list(pose.as_tuple()), "within_mm": NEAR_MM, "within_deg": within_deg}


def _text_without(cell: Cell, number: int) -> str:
    """The cell file without one of its exclusions; comments stay, one blank line before it goes."""
    text, place = cell.text, ("exclusions", number)
    spans = [span for path, span in cell.document.spans.items() if path[:2] == place]
    first = text.count("\n", 0, min(span.start for span in spans))
    last = text.count("\n", 0, max(span.stop for span in spans))
    lines = [f"{line}\n" for line in text.split("\n")]
    comments = [line for line in lines[first : last + 1] if line.lstrip().startswith("#")]
    before = lines[: first - 1] if first and not lines[first - 1].strip() else lines[:first]
    return "".join([*before, *comments, *lines[last + 1 :]]).removesuffix("\n")


def _rewritten(cell: Cell, text: str, exclusions: Sequence[tuple[int | None, object]]) -> Cell:
    """Write the text, if it states these exclusions and nothing else has changed."""
    changed = checked_cell(cell.path, text)
    wanted = cell.settings.model_copy(update={"exclusions": changed.settings.exclusions})
    stated = [(one.point, one.pose) for one in changed.settings.exclusions]
    if changed.settings != wanted or stated != exclusions:
        raise FileError(
            "the exclusions in this file cannot be changed by the program",
            subject=cell.path,
            line=cell.document.line_of(("exclusions",)),
            action="Edit [[exclusions]] yourself",
        )
    mark = BYTE_ORDER_MARK if read_bytes(cell.path).startswith(BYTE_ORDER_MARK.encode()) else ""
    write_atomically(cell.path, (mark + text).encode(), expected=(mark + cell.text).encode())
    return changed


IN_CLEAR = ("http", "mqtt")


def certificate_warnings(cell: Cell) -> Iterator[str]:
    """One for each instrument whose certificate has expired today."""
    for name in cell.settings.expired_on(datetime.now(UTC).date()):
        due = cell.settings.certificates[name].due
        yield (
            f"the certificate of {name} expired on {due}: a person must approve what is found with it. "
            "Have it calibrated, and state its new certificate"
        )


def telling_warnings(cell: Cell) -> Iterator[str]:
    """Notifications whose password crosses a network in clear."""
    for one in cell.settings.notifications:
        if one.url is None or one.password_file is None:
            continue
        host, scheme = address_of(one.url).hostname, scheme_of(one.url)
        if host and scheme in IN_CLEAR and not is_loopback(host):
            yield (
                f"notification {one.name}: its password goes over the network in clear. Write {scheme}s:// "
                f"instead of {scheme}://"
            )


def exposure_warnings(cell: Cell) -> Iterator[str]:
    """A controller that others may reach: across a network, or on a port that is open to it."""
    controller = cell.settings.controller
    if cell.settings.simulation is not None or controller.port is None:
        return
    where = f"controller {controller.host}:{controller.port}"
    if not is_loopback(controller.host):
        yield (
            f"{where}: passwords and commands go there over the network in clear, and whoever reaches that "
            "port may move the robot. Keep it in a network of its own, or use a tunnel to 127.0.0.1"
        )
    elif accepts_from_network(controller.port):
        yield (
            f"{where}: it accepts connections from the network too, and whoever reaches that port may move "
            "the robot. Let it listen on 127.0.0.1 alone, or close the port in the firewall"
        )


def port_warnings(cell: Cell, timers: Path = _LATENCY_TIMERS) -> Iterator[str]:
    """Adapters that hand on bytes late, and names that another adapter may get."""
    gauges = () if cell.settings.simulation is not None else cell.settings.gauges
    for port, name in {gauge.port: gauge.name for gauge in gauges if gauge.port}.items():
        device = Path(os.path.realpath(port)).name
        if (wait := int(read_if_present(timers / device / "latency_timer") or 0)) > 1:
            yield f"gauge {name}: its adapter keeps bytes for {wait} ms: docs/howto-host.md, Latency timers"
        if port.startswith(("/dev/ttyUSB", "/dev/ttyACM")):
            yield f"gauge {name}: tomorrow {port} may be another: docs/howto-host.md, Names that stay"


def accepts_from_network(port: int, tables: Sequence[Path] = TABLES) -> bool:
    """Whether something listens at ``port`` beyond the loopback addresses; False if that is not known."""
    return any(
        own_port == port and columns[3] == _LISTENING and not ipaddress.ip_address(address).is_loopback
        for (address, own_port), _, columns in kernel_connections(tables)
    )


def kernel_connections(
    tables: Sequence[Path] = TABLES,
) -> Iterator[tuple[tuple[bytes, int], tuple[bytes, int], list[str]]]:
    """This end and the other of each row of the tables, as packed address and port, and all its columns."""
    for table in tables:
        with suppress(OSError, ValueError, LookupError, struct.error):
            for line in table.read_text(encoding="ascii").splitlines()[1:]:
                columns = line.split()
                yield _end(columns[1]), _end(columns[2]), columns


def _end(written: str) -> tuple[bytes, int]:
    """As the kernel writes it: the address in words of four bytes, each in the computer's own order."""
    address, _, port = written.partition(":")
    words = [int(address[start : start + 8], 16) for start in range(0, len(address), 8)]
    return struct.pack(f"={len(words)}I", *words), int(port, 16)


def is_loopback(host: str) -> bool:
    """Whether a network name or address is this computer's own."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"
