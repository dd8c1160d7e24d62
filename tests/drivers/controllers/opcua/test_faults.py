"""What a PLC does wrong while the robot moves is named; the robot rests, and goes on when all is right."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest

from drivers.controllers.adapter.served_robot import FailedError
from drivers.controllers.opcua import nodes, program
from drivers.controllers.opcua.program import Plc
from tests.drivers.controllers.opcua.faults import FAULTS, PlcFault, repair
from tests.drivers.controllers.opcua.plc import PlcServer
from tests.waiting import wait_until

pytestmark = pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning"  # asyncua leaves a socket to the end of its process
)
FAR, NEAR = [0.0, 0.0, 500.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 5.0]


@pytest.fixture(autouse=True)
def _impatience(monkeypatch) -> None:
    monkeypatch.setattr(program, "ANSWER_S", 1.0)
    monkeypatch.setattr(nodes, "REQUEST_S", 1.0)


@contextmanager
def prepared(server: PlcServer) -> Iterator[Plc]:
    plc = Plc()
    plc.hello(server.options.model_dump(mode="json"))
    try:
        for action in ("reset-estop", "switch-on", "home"):
            plc.start_up(action)
        yield plc
    finally:
        plc.close()


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_in_motion(server: PlcServer, fault: PlcFault) -> None:
    with prepared(server) as plc, ThreadPoolExecutor(1) as pool:
        move = pool.submit(plc.move, FAR, 60.0, lambda _: None)
        wait_until(lambda: bool(server.program.outputs["moving"]))
        fault.inject(server)
        with pytest.raises(FailedError, match=fault.told):
            move.result()
        wait_until(lambda: server.stands or not server.program.outputs["moving"])
        at_rest = server.machine.pose()
        repair(server)
    with prepared(server) as plc:
        assert server.machine.pose() == at_rest
        plc.move(NEAR, 0.05, lambda _: None)
        assert plc.position()["pose"] == pytest.approx(NEAR)
