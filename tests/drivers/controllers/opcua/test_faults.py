"""What a PLC does wrong while the robot moves is named; the robot rests, and goes on when all is right."""

import threading
from collections.abc import Iterator

import pytest

from drivers.controllers.adapter.served_robot import FailedError
from drivers.controllers.opcua import nodes, program
from drivers.controllers.opcua.program import Plc
from tests.drivers.conformance.test_encoders import MachineInTime
from tests.drivers.controllers.opcua.faults import FAULTS, PlcFault, repair
from tests.drivers.controllers.opcua.plc import PlcServer
from tests.waiting import wait_until

FAR, NEAR = [0.0, 0.0, 500.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 5.0]


@pytest.fixture(autouse=True)
def _impatience(monkeypatch) -> None:
    monkeypatch.setattr(program, "ANSWER_S", 1.0)
    monkeypatch.setattr(nodes, "REQUEST_S", 1.0)


@pytest.fixture
def server() -> Iterator[PlcServer]:
    with PlcServer(MachineInTime()) as running:
        yield running


def connected(server: PlcServer) -> Plc:
    plc = Plc()
    plc.hello(server.options.model_dump(mode="json"))
    for action in ("reset-estop", "switch-on", "home"):
        plc.start_up(action)
    return plc


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_in_motion(server: PlcServer, fault: PlcFault) -> None:
    plc = connected(server)
    failures: list[FailedError] = []

    def move() -> None:
        with pytest.raises(FailedError, match=fault.told) as raised:
            plc.move(FAR, 60.0, lambda _: None)
        failures.append(raised.value)

    moving = threading.Thread(target=move)
    moving.start()
    wait_until(lambda: server.program.outputs["moving"])
    fault.inject(server)
    moving.join()
    assert failures
    wait_until(lambda: not server.program.outputs["moving"] or server.stands)
    at_rest = server.machine.pose()
    repair(server)
    plc.close()
    plc = connected(server)
    assert server.machine.pose() == at_rest
    plc.move(NEAR, 0.05, lambda _: None)
    assert plc.position()["pose"] == pytest.approx(NEAR)
    plc.close()
