"""What a PLC does wrong while the robot moves is named; the robot rests, and goes on when all is right."""

from random import Random

import pytest

from drivers.controllers.opcua import nodes, program
from tests.drivers.controllers.opcua.faults import FAULTS, PlcFault, moved_in_spite_of
from tests.drivers.controllers.opcua.plc import PlcServer

pytestmark = pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning"  # asyncua leaves a socket to the end of its process
)


@pytest.fixture(autouse=True)
def _impatience(monkeypatch) -> None:
    monkeypatch.setattr(program, "ANSWER_S", 1.0)
    monkeypatch.setattr(nodes, "REQUEST_S", 1.0)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_in_motion(server: PlcServer, fault: PlcFault) -> None:
    assert fault.told in moved_in_spite_of(server, fault, 60.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_fault_at_any_moment_of_a_short_move(server: PlcServer, seed: int) -> None:
    """Of which a benchmark tries many more."""
    random = Random(seed)
    moved_in_spite_of(server, random.choice(FAULTS), 0.2, random.uniform(0.0, 0.2))
