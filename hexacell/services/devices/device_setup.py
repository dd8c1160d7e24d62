"""The devices of a cell, real or simulated: the only module that knows which."""

from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from inspect import iscoroutinefunction
from pathlib import Path
from typing import Any

from drivers.errors import translated
from drivers.interfaces import Controller, DeviceIdentity, EncoderBank, Gauge, Thermometer
from drivers.serial.shared_port import SharedSerialPorts
from drivers.stop_input import stop_input_of
from drivers.wire_trace import WireTrace
from hexacell.cell.devices import EncoderSettings, GaugeSettings
from hexacell.cell.loader import Cell, config_paths, require_plugins
from hexacell.cell.measuring import NoiseSettings
from hexacell.cell.model import CellSettings
from hexacell.cell.passwords import with_passwords
from hexacell.clock import CellClock
from hexacell.config.layout import ConfigLayout, CurrentConfig
from hexacell.kinematics.mechanism import joint_zeros
from hexacell.plugins import Group, broken, created
from procedures.devices.device_set import Devices, MountedGauge, Thermometers
from procedures.run.cancellation import shielded


@contextmanager
def device_addresses(cell: Cell, *, other_processes: bool = False) -> Iterator[CellSettings]:
    """The cell's settings with an address for every device; within this context a simulated cell runs.

    Raises ``HexacellError``: a protocol without driver, an unreadable password, an impossible simulation.
    """
    require_plugins(cell)
    settings = _with_files(with_passwords(cell.settings, cell.path.parent), cell.path.parent)
    if settings.simulation is None:
        yield settings
        return
    # Imported here: a cell of real devices needs nothing of the simulation.
    from drivers.simulated.cell import SimulatedCell  # noqa: PLC0415
    from drivers.simulated.followed_controller import FollowedController  # noqa: PLC0415

    kind = FollowedController if settings.simulation.joints_command else SimulatedCell
    with kind(settings, cell.config_paths, other_processes=other_processes) as simulated:
        yield simulated.settings


def _with_files(settings: CellSettings, folder: Path) -> CellSettings:
    """The settings with the paths of what devices need, which are relative to the cell file."""
    described, eds = settings.encoders.dbc, settings.encoders.eds
    changes: dict[str, object] = {}
    if described is not None:
        changes["dbc"] = described.model_copy(update={"file": str(folder / described.file)})
    if eds is not None:
        changes["eds"] = str(folder / eds)
    options = {"options": settings.controller.options.beside(folder)}
    return settings.model_copy(
        update={
            "encoders": settings.encoders.model_copy(update=changes),
            "controller": settings.controller.model_copy(update=options),
        }
    )


AGREEMENT_SIGMAS = 5.0
AGREEMENT_STEPS = 2.5
USUAL_RESOLUTION_MM = 0.001
JUMP_SPEEDS = 10.0


@dataclass(frozen=True)
class Connected:
    """A cell's open devices, and the trace of their traffic."""

    settings: CellSettings
    devices: Devices
    identities: tuple[DeviceIdentity, ...]
    clock: CellClock
    trace: WireTrace
    thermometers: Thermometers


def devices_of(
    settings: CellSettings, links: SharedSerialPorts, trace: WireTrace, folder: Path | None = None
) -> Devices:
    """The drivers that the settings name, not yet connected; ``folder`` has the cell file.

    Raises:
        UsageError: a protocol has no driver.
    """
    gauges = tuple(
        MountedGauge(
            translated(
                _driver(Group.GAUGES, gauge.protocol, gauge_with_agreement(gauge, settings.noise), links),
                f"gauge {gauge.name}",
            ),
            gauge.mounting,
        )
        for gauge in settings.gauges
    )
    controller = translated(
        _driver(Group.CONTROLLERS, settings.controller.protocol, settings.controller, trace=trace),
        "controller",
    )
    wiring: dict[str, object] = {"trace": trace}
    if settings.encoders.are_of_controller:
        wiring = {"controller": controller}
        if settings.controller.joints_include_zeros:
            config = CurrentConfig(config_paths(settings, folder or Path()), ConfigLayout.of(settings))
            # By how much joints that include zeros exceed what the encoders show, by the current config.
            wiring["zeros"] = lambda: joint_zeros(settings.mechanism, config.geometry().geometry).tolist()
    encoders = _driver(Group.ENCODERS, settings.encoders.protocol, encoders_with_speed(settings), **wiring)
    return Devices(
        gauges,
        translated(encoders, "encoders"),
        controller,
        stop_input_of(settings.guards, folder or Path()),
    )


_INTERFACES: Mapping[Group, type] = {
    Group.GAUGES: Gauge,
    Group.ENCODERS: EncoderBank,
    Group.CONTROLLERS: Controller,
    Group.THERMOMETERS: Thermometer,
}


def _driver(group: Group, name: str, *arguments: object, **named: object) -> Any:  # noqa: ANN401
    """What ``created`` makes; raises ``PluginFailed`` too if it lacks a coroutine of its interface."""
    made, interface = created(group, name, *arguments, **named), _INTERFACES[group]
    for method in sorted(
        {one for base in interface.__mro__ for one in vars(base) if not one.startswith("_")}
    ):
        is_there = iscoroutinefunction(getattr(made, method, None))
        if iscoroutinefunction(getattr(interface, method)) and not is_there:
            raise broken(group, name, f"{type(made).__name__} has no 'async def {method}'")
    return made


def gauge_with_agreement(gauge: GaugeSettings, noise: NoiseSettings) -> GaugeSettings:
    """The gauge with the largest difference of two readings in a row that agree, if it has none.

    Five times its noise, but no less than its last digits differ by at rest: damage of a frame that is
    larger is found before it enters a record.
    """
    if gauge.agreement_mm is not None:
        return gauge
    sigma_mm = noise.gauge_at(gauge.mounting.index)
    least_mm = AGREEMENT_STEPS * (gauge.resolution_mm or USUAL_RESOLUTION_MM)
    return gauge.model_copy(update={"agreement_mm": max(AGREEMENT_SIGMAS * sigma_mm, least_mm)})


def encoders_with_speed(settings: CellSettings) -> EncoderSettings:
    """The encoders with the largest speed of a joint, if the cell file has none.

    Ten times that of a run, as the robot may be moved by others, in the time that its devices live in.
    """
    encoders, speed = settings.encoders, settings.speed
    if encoders.largest_speed is not None:
        return encoders
    fastest = JUMP_SPEEDS * settings.timing.clock_factor * max(speed.joint, speed.joint_at_gauges)
    return encoders.model_copy(update={"largest_speed": fastest})


@asynccontextmanager
async def open_devices(settings: CellSettings, folder: Path | None = None) -> AsyncIterator[Connected]:
    """Connect the cell's devices; they are closed at the end of this context.

    ``folder`` has the cell file; the path of its stop file is relative to it. Raises ``HexacellError``.
    """
    trace = WireTrace()
    links = SharedSerialPorts(trace=trace)
    devices = devices_of(settings, links, trace, folder)
    thermometers = Thermometers(
        [_driver(Group.THERMOMETERS, one.protocol, one) for one in settings.thermometers]
    )
    try:
        identities = (*await devices.open(), *await thermometers.open())
        clock = CellClock(settings.timing.clock_factor)
        yield Connected(settings, devices, identities, clock, trace, thermometers)
    finally:
        await shielded(_close(devices, links, thermometers))


async def _close(devices: Devices, links: SharedSerialPorts, thermometers: Thermometers) -> None:
    await thermometers.close()
    await devices.close()
    await links.close()
