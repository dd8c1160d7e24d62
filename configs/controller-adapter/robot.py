"""Makes LinuxCNC's network shell, or that of a simulated cell, a controller by the adapter protocol."""

import json
import socket
import sys
import threading
import time


class Failed(Exception): ...


class Robot:
    def __init__(self):
        self.asking, self.telling, self.stopped = threading.Lock(), threading.Lock(), threading.Event()

    def answer(self, request):
        do = request["do"]
        try:
            done = self.order(*ORDERS[do]) if do in ORDERS else getattr(self, do)(request)
            self.tell(request, done=done or {})
        except Exception as error:
            kind, reason = error.args if isinstance(error, Failed) else ("fault", repr(error))
            self.tell(request, failed={"kind": kind, "reason": reason})

    def tell(self, request, **what):
        with self.telling:
            print(json.dumps({"id": request["id"], **what}), flush=True)

    def hello(self, told):
        connection = socket.create_connection((told["host"], told.get("port", 5007)), timeout=3.0)
        self.lines = connection.makefile("rwb", buffering=0)
        self.lines.write(b"hello EMC adapter 1\r\nset echo off\r\nset verbose on\r\nset enable EMCTOO\r\n")
        self.ask("set set_wait received")
        return {"version": 1, "length": "mm", "angle": "deg", "name": "LinuxCNC by its network shell"}

    def ask(self, command):
        verb, name = command.upper().split()[:2]
        with self.asking:
            self.lines.write(command.encode() + b"\r\n")
            while (line := self.lines.readline().decode()) and line.split() != [verb, name, "NAK"]:
                if (words := line.split())[:1] == [name] or words == [verb, name, "ACK"]:
                    return " ".join(words[1:])
        raise Failed("fault", f"it refuses '{command}', or is gone")

    def numbers(self, what):
        return [float(word) for word in self.ask(f"get {what}").split()[:6]]

    def status(self, _=None):
        before = self.numbers("joint_pos")
        found = {key: not {"OFF", "NO"} & {*self.ask(f"get {of}").split()} for key, of in STATES.items()}
        return found | {"moving": self.numbers("joint_pos") != before, "heartbeat": str(before)}

    def position(self, _):
        pose = self.numbers("abs_act_pos") if self.status()["homed"] else None
        return {"pose": pose, "joints": self.numbers("joint_pos")}

    def order(self, key, value, *commands):
        self.stopped.clear()
        for command in commands:
            self.ask(command)
        self.wait(lambda: self.status()[key] is value)

    def wait(self, is_done):
        while not is_done():
            if self.stopped.is_set():
                raise Failed("interrupted", "it was stopped")
            if said := "; ".join(iter(lambda: self.ask("get error"), "OK")):
                raise Failed("pose" if "exceed" in said or "kinematics" in said else "fault", said)
            time.sleep(0.002)

    def move(self, asked):
        def is_there():
            self.tell(asked, at=(here := self.numbers("abs_act_pos")))
            return max(abs(a - b) for a, b in zip(here, asked["pose"])) < 1e-4

        rate = 60.0 / asked["duration_s"]
        words = " ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZABCF", (*asked["pose"], rate)))
        self.order("remote", True, "set mode mdi", f"set mdi G21 G53 G93 G1 {words}")
        self.wait(lambda: is_there() or not self.status()["enabled"])
        if not is_there():
            raise Failed("interrupted", "it was switched off")

    def stop(self, _=None):
        self.stopped.set()
        if self.status()["enabled"]:
            self.ask("set abort")


STATES = {"estop": "estop", "enabled": "machine", "remote": "enable", "homed": "joint_homed"}
ORDERS = {"reset-estop": ("estop", False, "set estop off"), "reload": ("enabled", False)}
ORDERS |= {f"switch-{word}": ("enabled", word == "on", f"set machine {word}") for word in ("on", "off")}
ORDERS |= {"home": ("homed", True, "set mode manual", "set home -1")}

if __name__ == "__main__":
    robot = Robot()
    for line in sys.stdin:
        threading.Thread(target=robot.answer, args=(json.loads(line),), daemon=True).start()
    robot.stop()  # nobody is there any more who could
