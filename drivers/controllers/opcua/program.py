"""Serves a PLC by the adapter protocol: the handshake of docs/controller-opcua.md."""

import json
import logging
import random
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from drivers.controllers.adapter.served_robot import FailedError, Report, Told, serve
from drivers.controllers.opcua.nodes import PlcNodes, Values, fault, same
from drivers.controllers.opcua.options import OpcUaOptions

ANSWER_S = 3.0
"""Longest wait until a PLC takes a command over, resets its answer, or rests after a stop."""
POLL_S, BEAT_S, REPORT_S = 0.01, 0.2, 0.1
"""Pauses between two reads while something is waited for, two counts, two reports of a place."""
LARGEST = 2**15 - 1
"""Largest integer that is written: that of 16 bits with a sign."""
LONGEST_TEXT = 500
COMMANDS = {"move": 1, "reset-estop": 2, "switch-on": 3, "switch-off": 4, "home": 5, "reload": 6}
KINDS = {1: "pose", 2: "refused", 3: "interrupted"}
"""What an error number means; any other is a fault."""
ANSWERS = ("busy", "done", "error")


class Plc:
    """A PLC as a robot that is served."""

    def __init__(self) -> None:
        # The last numbers and counts that were written: a read may be from before the latest.
        self._numbers = deque([random.randint(1, LARGEST)], maxlen=5)  # noqa: S311 - no secret
        self._counts = deque([0], maxlen=5)
        self._stops = self._stopping = 0
        self._edges, self._closing = threading.Lock(), threading.Event()
        self._heartbeat: int | None = None
        self._is_connected = False

    def hello(self, told: Told) -> Told:
        """Connect, and see that nobody else commands this PLC."""
        options = OpcUaOptions.model_validate_json(json.dumps(told["settings"]))
        self._nodes = PlcNodes(options)
        self._nodes.connect()
        first = self._nodes.read()
        time.sleep(2 * BEAT_S)
        if self._nodes.read()["client_heartbeat"] != first["client_heartbeat"]:
            self._nodes.close()
            reason = "another program commands this PLC: client_heartbeat counts"
            raise FailedError("refused", reason, action="End it, and open the controller again")
        self._heard_s, self._longest_s = time.monotonic(), options.heartbeat_s
        self._counts.append(first["client_heartbeat"] % LARGEST + 1)
        own = {"number": self._numbers[-1], "client_heartbeat": self._counts[-1]}
        self._nodes.write(execute=False, stop=False, **own)
        self._beating = threading.Thread(target=self._beat, daemon=True)
        self._beating.start()
        self._is_connected = True
        return {"name": options.endpoint, "description": "PLC with an OPC UA server"}

    def status(self) -> Told:
        """What the PLC shows."""
        seen = self._seen()
        shown = {name: seen[name] for name in ("estop", "enabled", "homed", "moving")}
        return {**shown, "remote": seen["remote"] is not False, "heartbeat": str(seen["heartbeat"])}

    def position(self) -> Told:
        """Where it has the robot."""
        seen = self._seen()
        return {"pose": seen["pose"], "joints": seen["joints"]}

    def start_up(self, action: str) -> None:
        """One of its commands; whether it has any effect is seen by the status."""
        self._command(action)

    def move(self, pose: Sequence[float], duration_s: float, report: Report) -> None:
        """Its command with a pose."""
        self._command("move", report, target=list(pose), duration=duration_s)

    def stop(self) -> None:
        """Stop the motion, and the command; where it does not come to rest, it stays told to stop."""
        if not self._is_connected:
            return
        beats: set[int] = set()

        def rests(seen: Values) -> bool:
            beats.add(seen["heartbeat"])  # of three cycles one was whole, and has seen it
            return len(beats) > 2 and not (seen["moving"] or seen["busy"])

        self._stopping += 1
        try:
            with self._edges:
                self._stops += 1
                self._nodes.write(stop=True, execute=False)
            self._until(rests, "does not rest after a stop")
            self._nodes.write(stop=False)
        finally:
            self._stopping -= 1

    def close(self) -> None:
        """Log out."""
        self._closing.set()
        if self._is_connected:
            self._beating.join()
            self._nodes.close()

    def _seen(self) -> Values:
        """What the PLC shows now, once it is known that its program runs and obeys nobody else."""
        if not self._beating.is_alive():
            raise fault("client_heartbeat cannot be written")
        found, now = self._nodes.read(), time.monotonic()
        if found["heartbeat"] != self._heartbeat:
            self._heartbeat, self._heard_s = found["heartbeat"], now
        elif now - self._heard_s > self._longest_s:
            raise fault(f"the PLC's program stands: no heartbeat for {now - self._heard_s:.1f} s")
        for name, own in (("number", self._numbers), ("client_heartbeat", self._counts)):
            if found[name] not in own:
                raise fault(f"{name} is {found[name]}, not {own[-1]}: the PLC restarted, or another client")
        return found

    def _beat(self) -> None:
        with suppress(FailedError):
            while not self._closing.wait(BEAT_S):
                self._counts.append(self._counts[-1] % LARGEST + 1)
                self._nodes.write(client_heartbeat=self._counts[-1])
                with suppress(FailedError):  # to have heard of the PLC when somebody asks
                    self._seen()

    def _command(self, do: str, report: Report | None = None, **more: Any) -> None:  # noqa: ANN401
        """Have one command carried out; where it fails otherwise than refused, the robot is stopped."""
        stops = self._stops
        self._until(
            lambda seen: not (self._stopping or any(map(seen.get, (*ANSWERS, "moving")))),
            "is busy with another command, or moves",
        )
        self._numbers.append(self._numbers[-1] % LARGEST + 1)
        written = {"command": COMMANDS[do], "number": self._numbers[-1], "stop": False, **more}
        self._write_unless_stopped(stops, **written)
        kept = self._seen()  # before the edge, as a PLC may take arrays over in pieces
        self._require_not_stopped(stops)
        if wrong := next((name for name, value in written.items() if not same(value, kept[name])), None):
            raise fault(f"{wrong} is {kept[wrong]} in the PLC, not {written[wrong]} as it was written")
        try:
            self._write_unless_stopped(stops, execute=True)
            self._wait(stops, report)
            self._reset()
        except Exception as error:
            with suppress(FailedError):
                if not isinstance(error, FailedError) or error.answer["kind"] not in {"pose", "refused"}:
                    self.stop()
                self._reset()
            raise

    def _write_unless_stopped(self, stops: int, **values: Any) -> None:  # noqa: ANN401 - as the nodes are
        with self._edges:
            self._require_not_stopped(stops)
            self._nodes.write(**values)

    def _require_not_stopped(self, stops: int) -> None:
        if self._stops != stops:
            raise FailedError("interrupted", "stopped")

    def _wait(self, stops: int, report: Report | None) -> None:
        """Until the PLC says done of the last command; raises what else it says."""
        number, is_taken, lapses = self._numbers[-1], False, 0
        begun_s = reported_s = time.monotonic()
        while True:
            seen, now = self._seen(), time.monotonic()
            self._require_not_stopped(stops)
            if not seen["execute"]:
                raise fault("execute is false: the PLC restarted, or another client")
            if seen["answered"] == number:
                is_taken = True
                if seen["done"] or seen["error"]:
                    return self._judge(seen, stops)
                lapses = 0 if seen["busy"] else lapses + 1
                if lapses > 1:  # one is a read between two cycles
                    raise FailedError("interrupted", "the PLC ended it, and says neither done nor error")
            elif is_taken or now - begun_s > ANSWER_S:
                raise fault(f"the PLC answers command {seen['answered']}, not {number} as it was told")
            if report is not None and seen["pose"] and now - reported_s > REPORT_S:
                reported_s = now
                report(seen["pose"])
            time.sleep(POLL_S)

    def _judge(self, seen: Values, stops: int) -> None:
        if seen["error"]:
            code, text = seen["error_number"], seen["error_text"] or "no text"
            raise FailedError(KINDS.get(code, "fault"), f"error {code} of the PLC: {text[:LONGEST_TEXT]}")
        again = self._seen()
        self._require_not_stopped(stops)
        if again["moving"] or again["busy"] or not again["done"]:
            raise fault("the PLC says done, but is busy or moves")

    def _reset(self) -> None:
        self._nodes.write(execute=False)
        self._until(lambda seen: not any(map(seen.get, ANSWERS)), "keeps its answer without execute")

    def _until(self, is_so: Callable[[Values], bool], otherwise: str) -> None:
        end_s = time.monotonic() + ANSWER_S
        while not is_so(self._seen()):
            if time.monotonic() > end_s:
                raise fault(f"the PLC {otherwise}, within {ANSWER_S:g} s")
            time.sleep(POLL_S)


def main() -> None:
    """Serve on stdin and stdout until they end."""
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # what it says is in the failures
    plc = Plc()
    try:
        serve(plc)
    finally:
        plc.close()


if __name__ == "__main__":
    main()
