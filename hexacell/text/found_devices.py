"""Devices that were found, in words and as text for a cell file; and one that was watched."""

from collections.abc import Iterator
from typing import Any

import tomlkit

from drivers.discovery.encoders import BusFindings, FoundFrame, FoundNode
from drivers.discovery.gauges import PortFindings
from drivers.serial.opening import SerialPortFound
from hexacell.kinematics.parameters import CONSTRAINTS, JointUnit
from hexacell.services.devices import device_search
from hexacell.services.devices.device_diagnosis import DeviceDiagnosis, Failure
from hexacell.text.layout import counted
from hexacell.text.planning import device_line

AXES = "xyz"
MOST_FRAMES = 12


def search_lines(found: device_search.SearchFindings) -> Iterator[str]:
    """What was found, in words."""
    if not found.ports:
        yield "No serial port: plug a gauge's cable or adapter in, or name a port."
    for port, on_it in zip(found.ports, found.gauges, strict=True):
        yield from _port_lines(port, on_it, found.buses)
    if any(not (one.gauges or one.problem or _is_can_adapter(one, found.buses)) for one in found.gauges):
        others = ", ".join(found.untried)
        yield f"Not tried where nothing answers: {others}, which the cell file describes (docs/drivers.md)."
    if not found.buses:
        yield "No CAN adapter: plug it in, or name a bus with --can."
    for bus in found.buses:
        yield from _bus_lines(bus)
    if found.controller is None:
        yield "No controller: LinuxCNC answers if linuxcncrsh is its display (--controller)."
    else:
        yield f"Controller at {found.controller.host}:{found.controller.port}: {found.controller.greeting}"


def cell_text(found: device_search.SearchFindings) -> str:
    """The sections of a cell file for what was found, and what is guessed in them; empty for nothing."""
    notes: list[str] = []
    document: dict[str, Any] = {}
    if gauges := device_search.found_gauges(found)[: len(AXES)]:
        notes.append("axis: the base axis along which a gauge's plunger moves. Press it, and correct this.")
        notes.append("sign: -1 if the gauge shows less when the ball moves along that axis.")
        document["gauges"] = [
            {"name": axis, "axis": axis, "sign": 1, "protocol": gauge.protocol, "port": gauge.port}
            | device_search.gauge_keys(gauge)
            for axis, gauge in zip(AXES, gauges, strict=False)
        ]
    if bank := device_search.found_bank(found):
        bus, encoders = bank
        nodes = [node.node for node in encoders]
        notes.append(
            f"nodes: those of legs 1 to 6{'' if len(nodes) == CONSTRAINTS else ': six are needed'}."
        )
        document["encoders"] = {"protocol": "cia406", "bus": bus.bus, "nodes": nodes}
        document["encoders"] |= device_search.encoder_keys(encoders)
    elif unknown := next((bus for bus in found.buses if bus.frames), None):  # of no CANopen node
        frames = ", ".join(map(_number, unknown.frames[:MOST_FRAMES]))
        notes.append("encoders.dbc: the file of their maker; a count is no coarser than its steps.")
        notes.append(f"signals: Message.Signal of legs 1 to 6, from the messages among {frames}.")
        signals = [f"ENC{leg}.Position" for leg in range(1, CONSTRAINTS + 1)]
        document["encoders"] = {"protocol": "dbc", "bus": unknown.bus, "measuring_step_nm": 1000}
        document["encoders"]["dbc"] = {"file": "encoders.dbc", "signals": signals}
    if (controller := found.controller) is not None:
        document["controller"] = {"protocol": "linuxcncrsh", "host": controller.host}
        document["controller"]["port"] = controller.port
    return "".join(f"# {note}\n" for note in notes) + tomlkit.dumps(document)


def _port_lines(
    port: SerialPortFound, on_it: PortFindings, buses: tuple[BusFindings, ...]
) -> Iterator[str]:
    name = port.port if port.port == port.device else f"{port.port} (now {port.device})"
    adapter = f", {port.adapter}" if port.adapter else ""
    if on_it.problem:
        yield f"{name}{adapter}: {on_it.problem}"
    elif _is_can_adapter(on_it, buses):
        yield f"{name}{adapter}: a CAN adapter"
    elif on_it.heard:
        yield (
            f"{name}{adapter}: what comes is in no protocol that is tried: {on_it.heard}. Its baud rate or "
            "parity may be another: try them with serial and its protocol in a cell file (docs/drivers.md)"
        )
    elif not on_it.gauges:
        yield f"{name}{adapter}: nothing answers; is the gauge on, and is its cable a duplex one?"
    for gauge in on_it.gauges:
        where = "" if gauge.channel is None else f", channel {gauge.channel}"
        what = f"{gauge.description}, shows {gauge.shown}" if gauge.shown else gauge.problem
        rate = "" if gauge.baudrate is None else f" at {gauge.baudrate} baud"
        yield f"{name}{adapter}{where}: {gauge.protocol}{rate}: {what}"


def _is_can_adapter(on_it: PortFindings, buses: tuple[BusFindings, ...]) -> bool:
    return any(bus.bus.get("channel") == on_it.port for bus in buses)


def _bus_lines(bus: BusFindings) -> Iterator[str]:
    name = " ".join(str(bus.bus[key]) for key in ("interface", "channel", "bitrate") if key in bus.bus)
    if bus.problem:
        yield f"CAN {name}: {bus.problem}"
    elif bus.frames and not bus.nodes:
        yield f"CAN {name}: no CANopen node answers, but there are frames"
    elif not bus.nodes:
        yield f"CAN {name}: no node answers; check supply and termination, or try another --bitrate"
    for node in bus.nodes:
        yield f"CAN {name}, node {node.node}: {_node_words(node)}"
    for frame in bus.frames[:MOST_FRAMES]:
        what = f"{frame.length} bytes, {frame.per_second:.0f} a second"
        data = "its data change" if frame.changes else "its data stay the same"
        yield f"CAN {name}, frame {_number(frame)}: {what}, {data}"
    if len(bus.frames) > MOST_FRAMES:
        yield f"CAN {name}: frames with {len(bus.frames) - MOST_FRAMES} further identifiers"
    if bus.frames:
        yield (
            f"CAN {name}: no CANopen node that answers sends these frames. If they are of encoders, name "
            'the DBC file of their maker, with protocol = "dbc" (docs/drivers.md)'
        )


def _node_words(node: FoundNode) -> str:
    words = [node.description]
    if node.step is not None:
        words.append(f"{node.step} {'counts a turn' if node.unit is JointUnit.DEG else 'nm a count'}")
    if node.serial_number is not None:
        words.append(f"serial number {node.serial_number}")
    return ", ".join(words)


def _number(frame: FoundFrame) -> str:
    """An identifier in the format of candump: 11 bits in three digits, 29 in eight."""
    return f"{frame.identifier:0{8 if frame.is_extended else 3}X}"


MEANING = {
    Failure.DAMAGED: "Answers are damaged: check its cable, its shield and its serial settings.",
    Failure.MISSING: "Answers are missing: check its cable and its supply.",
    Failure.AT_END: "Its plunger is at an end of its travel: move the gauge or the ball.",
    Failure.INVALID: "The device itself says that positions are invalid: look at its magnet or scale.",
}
NOISY = 3.0
"""A scatter of so many times what the cell file states is reported."""


def diagnosis_lines(found: DeviceDiagnosis) -> Iterator[str]:
    """The figures in words, then what is wrong."""
    for identity in found.identities:
        yield device_line(identity)
    rate = found.readings / found.seconds if found.seconds else 0.0
    yield f"{counted(found.readings, 'reading')} in {found.seconds:.1f} s, {rate:.1f} a second"
    for series in found.series:
        scatter = "" if series.scatter is None else f", scatter {_micro(series.scatter, series.unit)}"
        span = f"{series.lowest:.4f} to {series.highest:.4f} {series.unit}"
        yield f"{series.name}: {span}, {counted(series.distinct, 'distinct value')}{scatter}"
    if not found.failures:
        yield "No answer was damaged or missing."
    for failure in found.failures:
        was = "was" if failure.count == 1 else "were"
        yield f"{counted(failure.count, 'answer')} {was} {failure.kind}, at last: {failure.latest}"
    yield from _meaning(found)


def _meaning(found: DeviceDiagnosis) -> Iterator[str]:
    if found.problem:
        yield f"It cannot be used like this: {found.problem}"
    for failure in found.failures:
        yield MEANING[failure.kind]
    for series in found.series:
        if series.distinct == 1 and found.readings > 1:
            yield f"{series.name} showed one value only: move it by hand to see that it follows."
        elif series.scatter is not None and series.scatter > NOISY * found.stated_noise:
            stated = _micro(found.stated_noise, series.unit)
            yield f"{series.name} scatters more than the {stated} that [noise] states, or it moved."
    if found.is_usable and not found.failures:
        yield "It can be used."


def _micro(value: float, unit: str) -> str:
    return f"{1000.0 * value:.2g} um" if unit == "mm" else f"{value:.2g} {unit}"
