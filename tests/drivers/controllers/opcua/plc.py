"""A PLC as docs/controller-opcua.md has it: an OPC UA server, and a program that runs in cycles.

``python -m tests.drivers.controllers.opcua.plc CELL SERVED`` serves a simulated cell with such a PLC, and
writes SERVED beside it: the cell file by which hexacell runs with them.
"""

import asyncio
import logging
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import astuple
from pathlib import Path
from typing import Any

from asyncua import ua
from asyncua.server.server import Server
from asyncua.server.user_managers import UserManager

from drivers.controllers.opcua.options import NODES, Kind, OpcUaOptions
from drivers.simulated.cell import SimulatedCell
from drivers.simulated.linuxcnc.state import Machine, MotionRefused
from drivers.simulated.served_device import Closeable
from hexacell.cell.loader import dump, load_cell
from hexacell.cell.model import CellSettings
from hexacell.errors import HexacellError
from hexacell.kinematics.pose import Pose
from hexacell.storage.opcua_certificate import ensure_certificate

CYCLE_S = 0.005
CLIENT_S = 1.0
"""So long client_heartbeat may stand while the robot moves."""
VT = ua.VariantType
TYPES = {Kind.SWITCH: VT.Boolean, Kind.INTEGER: VT.Int16, Kind.TEXT: VT.String}
ZEROS: dict[Kind, Any] = {Kind.SWITCH: False, Kind.INTEGER: 0, Kind.REAL: 0.0, Kind.TEXT: ""}
INPUTS = ("command", "number", "target", "duration", "execute", "stop", "client_heartbeat")
URI = "urn:plc:server"
CONNECTIONS = 10


class PlcProgram:
    """What is called once a cycle: it sees what the client has written, and gives what the PLC writes."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.outputs = {
            name: ZEROS.get(kind, [0.0] * 6) for name, kind in NODES.items() if name not in INPUTS
        }
        self.outputs.update(estop=True, remote=True)
        self._job: Future[None] | None = None
        self._executed = self._is_stopped = False
        self._client, self._client_s = 0, time.monotonic()
        self._too_late: int | None = None
        self.is_late = False
        self._motion = ThreadPoolExecutor(1, thread_name_prefix="PLC motion")

    def cycle(self, seen: dict[str, Any]) -> None:
        """One cycle."""
        out = dict(self.outputs, heartbeat=self.outputs["heartbeat"] % 32767 + 1)
        if seen["client_heartbeat"] != self._client:
            self._client, self._client_s = seen["client_heartbeat"], time.monotonic()
        if time.monotonic() - self._client_s > CLIENT_S:
            self._too_late = seen["number"]
        self.is_late = seen["number"] == self._too_late
        may_move = not (seen["stop"] or out["estop"] or self.is_late)
        if seen["execute"] and not self._executed and self._job is None:
            out.update(
                answered=seen["number"], busy=True, done=False, error=False, error_number=0, error_text=""
            )
            self._is_stopped = False
            self._begin(seen, out, may_move=may_move)
        elif self._job is not None:
            if not may_move:
                self._is_stopped = True
                self.machine.stop()
            if self._job.done():
                self._end(self._job, out)
        elif not seen["execute"]:
            out.update(done=False, error=False)
        self._executed = seen["execute"]
        out.update(pose=list(astuple(self.machine.pose())), joints=list(self.machine.joints()))
        out["moving"] = self._job is not None
        self.outputs = out  # at once, as a cycle's outputs are

    def _begin(self, seen: dict[str, Any], out: dict[str, Any], *, may_move: bool) -> None:
        match seen["command"]:
            case 1 if may_move and out["enabled"] and out["homed"]:
                self._job = self._motion.submit(self.machine.move, Pose(*seen["target"]), seen["duration"])
            case 2:
                out.update(estop=False, busy=False, done=True)
            case 3 if not out["estop"]:
                try:
                    self.machine.switch_on()
                except HexacellError as error:
                    self._fail(out, 17, str(error))
                else:
                    out.update(enabled=True, busy=False, done=True)
            case 4 | 6:
                out.update(enabled=False, busy=False, done=True)
            case 5 if may_move and out["enabled"]:
                self._job = self._motion.submit(self.machine.home)
                out["homed"] = True
            case _:
                self._fail(out, 2, "not now")

    def _end(self, job: Future[None], out: dict[str, Any]) -> None:
        self._job = None
        if isinstance(error := job.exception(), MotionRefused):
            self._fail(out, 1, str(error))
        elif error is not None:
            self._fail(out, 16, str(error))
        elif self._is_stopped:
            self._fail(out, 16 if out["estop"] else 3, "emergency stop" if out["estop"] else "stopped")
        else:
            out.update(busy=False, done=True)

    def _fail(self, out: dict[str, Any], number: int, text: str) -> None:
        out.update(busy=False, error=True, error_number=number, error_text=text)

    def press_estop(self) -> None:
        """Somebody presses the emergency stop."""
        self.outputs = dict(self.outputs, estop=True, enabled=False)

    def close(self) -> None:
        """Stop the machine, and wait for it."""
        while self._job is not None and not self._job.done():
            self.machine.stop()
        self._motion.shutdown()


class PlcServer(Closeable):
    """Serves until it is closed.

    Attributes:
        forced: what some nodes hold, whatever the program says.
        cycle_s: duration of a cycle.
        stands: whether the program stands, as that of a PLC in STOP; its server goes on.
    """

    def __init__(
        self,
        machine: Machine,
        *,
        real: ua.VariantType = VT.Double,
        port: int = 0,
        folder: Path | None = None,
        users: UserManager | None = None,
    ) -> None:
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)
        self.machine = machine
        self.program = PlcProgram(machine)
        self.forced: dict[str, ua.DataValue] = {}
        self.cycle_s, self.stands = CYCLE_S, False
        self._cycle = threading.Lock()
        self._types = TYPES | {Kind.REAL: real, Kind.SIX: real}
        self._folder, self._users = folder, users
        self._answering, self._closing = threading.Event(), threading.Event()
        self._answering.set()
        self._loop = asyncio.new_event_loop()
        self._threads = [
            threading.Thread(target=self._loop.run_forever),
            threading.Thread(target=self._work),
        ]
        self._threads[0].start()
        self._do(self._start(port))
        self._threads[1].start()

    @property
    def options(self) -> OpcUaOptions:
        """Where and how a client reaches it."""
        pattern = f"ns={self._namespace};s=hexacell.{{name}}"
        secure: dict[str, Any] = (
            {"security": "none"} if self._folder is None else {"folder": str(self._folder / "client")}
        )
        return OpcUaOptions(endpoint=f"opc.tcp://127.0.0.1:{self._listener.port}/", node=pattern, **secure)

    def write(self, **values: Any) -> None:
        """Write inputs as another client does, or a restart of the PLC."""
        for name, value in values.items():
            self._do(self._server.write_attribute_value(self._id(name), self._data(name, value)))

    def restart(self, machine: Machine | None = None) -> None:
        """As after a loss of power, perhaps at another machine: all that was written is lost."""
        self.set_unplugged(on=True)
        with self._cycle:
            self.program.close()
            self.machine = machine or self.machine
            self.program = PlcProgram(self.machine)
            self.write(**{name: ZEROS.get(NODES[name], [0.0] * 6) for name in INPUTS})
        self.set_unplugged(on=False)

    def stand(self) -> None:
        """As a PLC in STOP: the program stands, and its outputs are off."""
        self.stands = True
        self.machine.stop()

    def set_unplugged(self, *, on: bool) -> None:
        """Cut all connections and accept none, or accept them again; the program goes on."""
        self._server.iserver.max_connections = 0 if on else CONNECTIONS

        async def cut() -> None:
            for client in tuple(self._listener.clients):
                if client.transport is not None:
                    client.transport.close()

        if on:
            self._do(cut())

    def set_silent(self, *, on: bool) -> None:
        """Answer nothing, or answer again; the program goes on."""
        if on:
            self._answering.clear()
            self._loop.call_soon_threadsafe(self._answering.wait)
        else:
            self._answering.set()

    def close(self) -> None:
        self._answering.set()
        self._closing.set()
        self._threads[1].join()
        self.program.close()
        self._do(self._server.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._threads[0].join()
        self._loop.close()

    async def _start(self, port: int) -> None:
        self._server = Server(user_manager=self._users)
        await self._server.init()
        self._server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/")
        await self._server.set_application_uri(URI)
        policies = [ua.SecurityPolicyType.NoSecurity]
        if self._folder is not None:
            certificate, key = ensure_certificate(self._folder, URI, "127.0.0.1")
            await self._server.load_certificate(certificate)
            await self._server.load_private_key(key)
            policies = [ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt]
        self._server.set_security_policy(policies)
        if self._users is not None:
            self._server.set_identity_tokens([ua.UserNameIdentityToken])
        self._namespace = await self._server.register_namespace("urn:plc:hexacell")
        block = await self._server.nodes.objects.add_object(self._namespace, "hexacell")
        for name, kind in NODES.items():
            zero = ZEROS.get(kind, [0.0] * 6)
            node = await block.add_variable(
                self._id(name), f"{self._namespace}:{name}", zero, self._types[kind]
            )
            await node.set_writable()
            if name not in INPUTS:
                self._server.set_attribute_value_callback(node.nodeid, self._shown(name))
        await self._server.start()
        assert self._server.bserver is not None
        self._listener = self._server.bserver

    def _shown(self, name: str) -> Callable[..., ua.DataValue]:
        return lambda *_: self.forced.get(name) or self._data(name, self.program.outputs[name])

    def _id(self, name: str) -> ua.NodeId:
        return ua.NodeId.from_string(f"ns={self._namespace};s=hexacell.{name}")

    def _data(self, name: str, value: Any) -> ua.DataValue:
        return ua.DataValue(ua.Variant(value, self._types[NODES[name]]))

    def _work(self) -> None:
        while not self._closing.wait(self.cycle_s):
            with self._cycle:
                if not self.stands:
                    seen = {name: self._server.read_attribute_value(self._id(name)) for name in INPUTS}
                    self.program.cycle({name: one.Value.Value for name, one in seen.items() if one.Value})

    def _do(self, work: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()


def with_plc(settings: CellSettings, plc: PlcServer) -> CellSettings:
    """The settings of a cell whose robot this PLC moves."""
    controller = settings.controller.model_copy(update={"protocol": "opcua", "options": plc.options})
    return settings.model_copy(update={"controller": controller})


def main(cell_file: str, served_file: str) -> None:
    """Serve a cell until Ctrl-C."""
    cell = load_cell(Path(cell_file))
    with (
        SimulatedCell(cell.settings, cell.config_paths, other_processes=True) as simulated,
        PlcServer(simulated.machine) as plc,
        suppress(KeyboardInterrupt),
    ):
        Path(served_file).write_text(dump(with_plc(simulated.settings, plc)))
        print(
            f"{plc.options.endpoint} is served; in another terminal: hexacell run {served_file}", flush=True
        )
        threading.Event().wait()


if __name__ == "__main__":
    main(*sys.argv[1:])
