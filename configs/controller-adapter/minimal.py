"""The whole adapter protocol, without help: a robot that only remembers where it is, as a TCP server.

Started as `python3 minimal.py 6001`; the cell file then has address = "127.0.0.1:6001".
"""

import json
import socket
import sys
import threading
import time

STEP_S = 0.01


class Robot:
    def __init__(self):
        self.state = {"estop": True, "enabled": False, "homed": False, "remote": True, "moving": False}
        self.pose, self.is_stopped = [0.0, -200.0, 550.0, 0.0, 0.0, 0.0], False

    def done(self, do, request, tell):
        """What `done` has for a request; None where it fails, after its failure was told."""
        match do:
            case "hello":
                return {"version": 1, "length": "mm", "angle": "deg", "name": "a robot that remembers"}
            case "status":
                return self.state
            case "position":
                return {"pose": self.pose if self.state["homed"] else None, "joints": None}
            case "reset-estop":
                self.state["estop"] = False
            case "switch-on" | "switch-off":
                self.state["enabled"] = do == "switch-on"
            case "home":
                self.state["homed"] = True
            case "stop":
                self.is_stopped = True
                while self.state["moving"]:
                    time.sleep(STEP_S)
            case "move" if request["pose"][2] > 1000.0:
                tell(failed={"kind": "pose", "reason": "too high", "axis": "z", "highest": True})
                return None
            case "move":
                return self.move(request["pose"], request["duration_s"], tell)
        return {}

    def move(self, target, duration_s, tell):
        begun, start = time.monotonic(), self.pose
        self.state["moving"], self.is_stopped, share = True, False, 0.0
        while share < 1.0 and not self.is_stopped:
            time.sleep(STEP_S)
            share = min(1.0, (time.monotonic() - begun) / duration_s)
            self.pose = [a + share * (b - a) for a, b in zip(start, target)]
            tell(at=self.pose)
        self.state["moving"] = False
        if share < 1.0:
            tell(failed={"kind": "interrupted", "reason": "it was stopped"})
            return None
        return {}


def serve(robot, connection):
    """Answer one client until it goes; what takes time is done in a thread of its own."""
    writing = threading.Lock()
    lines = connection.makefile("rw", encoding="utf-8", newline="\n")

    def answer(request):
        def tell(**what):
            with writing:
                lines.write(json.dumps({"id": request["id"], **what}) + "\n")
                lines.flush()

        done = robot.done(request["do"], request, tell)
        if done is not None:
            tell(done=done)

    for line in lines:
        threading.Thread(target=answer, args=(json.loads(line),), daemon=True).start()
    robot.is_stopped = True  # nobody is there any more who could stop it


if __name__ == "__main__":
    with socket.create_server(("127.0.0.1", int(sys.argv[1]))) as server:
        print(server.getsockname()[1], flush=True)
        robot = Robot()
        while True:
            serve(robot, server.accept()[0])
