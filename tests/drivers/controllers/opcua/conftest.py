"""A PLC for each test, in an address space that is made once."""

from collections.abc import Iterator

import pytest

from tests.drivers.conformance.test_controllers import MachineInTime
from tests.drivers.controllers.opcua.faults import repair
from tests.drivers.controllers.opcua.plc import PlcServer


@pytest.fixture(scope="module")
def address_space() -> Iterator[PlcServer]:
    """Made once, as it takes more than a second."""
    with PlcServer(MachineInTime()) as running:
        yield running


@pytest.fixture
def server(address_space: PlcServer) -> Iterator[PlcServer]:
    address_space.restart(MachineInTime())
    yield address_space
    repair(address_space)
    address_space.program.close()
