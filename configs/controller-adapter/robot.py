"""Makes LinuxCNC's network shell, or that of a simulated cell, a controller by the adapter protocol."""

import socket
import threading
import time

from drivers.controllers.adapter.served_robot import FailedError, serve


class Robot:
    """A connection on which one line at a time is answered, also while the robot moves."""

    def __init__(self):
        self.lock, self.stopped = threading.Lock(), threading.Event()

    def hello(self, told):
        connection = socket.create_connection((told["host"], told.get("port", 5007)), timeout=3.0)
        self.lines = connection.makefile("rwb", buffering=0)
        self.lines.write(b"hello EMC adapter 1.0\r\nset echo off\r\nset verbose on\r\n")
        self.ask("set enable EMCTOO")
        self.ask("set set_wait received")
        return {"name": "LinuxCNC", "description": "by its network shell"}

    def ask(self, command):
        """What follows the name of what is asked for; a refusal is a failure with the reason."""
        verb, name = command.upper().split()[:2]
        with self.lock:
            self.lines.write(command.encode() + b"\r\n")
            while (line := self.lines.readline().decode()) and line.split() != [verb, name, "NAK"]:
                words = line.split()
                if words[:1] == [name] or words == [verb, name, "ACK"]:
                    return " ".join(words[1:])
        raise FailedError("fault", f"it refuses '{command}'")

    def is_on(self, what):
        return self.ask(f"get {what}") == "ON"

    def is_homed(self):
        return "NO" not in self.ask("get joint_homed")

    def numbers(self, what):
        return [float(word) for word in self.ask(f"get {what}").split()[:6]]

    def status(self):
        joints, later = self.numbers("joint_pos"), self.numbers("joint_pos")
        found = {"homed": self.is_homed(), "moving": joints != later, "heartbeat": str(later)}
        found |= {"estop": self.is_on("estop"), "enabled": self.is_on("machine")}
        return {**found, "remote": self.is_on("enable")}

    def position(self):
        pose = self.numbers("abs_act_pos") if self.is_homed() else None
        return {"pose": pose, "joints": self.numbers("joint_pos")}

    def until(self, is_done):
        while not is_done():
            if self.stopped.is_set():
                raise FailedError("interrupted", "it was stopped")
            if said := "; ".join(iter(lambda: self.ask("get error"), "OK")):
                is_out = "exceed" in said or "kinematics" in said
                raise FailedError("pose" if is_out else "fault", said)
            time.sleep(0.002)

    def start_up(self, action):  # nothing to do for "reload": it reads its geometry when switched on
        self.stopped.clear()
        match action:
            case "reset-estop":
                self.ask("set estop off")
                self.until(lambda: not self.is_on("estop"))
            case "switch-on" | "switch-off":
                self.ask(f"set machine {action[7:]}")
                self.until(lambda: self.is_on("machine") == (action == "switch-on"))
            case "home":
                self.ask("set mode manual")
                self.ask("set home -1")
                self.until(self.is_homed)

    def move(self, pose, duration_s, report):
        self.stopped.clear()
        self.ask("set mode mdi")
        words = " ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZABCF", (*pose, 60.0 / duration_s)))
        self.ask(f"set mdi G21 G53 G93 G1 {words}")
        self.until(lambda: self.is_at(pose, report) or not self.is_on("machine"))
        if not self.is_at(pose, report):
            raise FailedError("interrupted", "it was switched off")

    def is_at(self, pose, report):
        report(here := self.numbers("abs_act_pos"))
        return max(abs(a - b) for a, b in zip(here, pose)) < 1e-4

    def stop(self):
        self.stopped.set()
        if self.is_on("machine"):
            self.ask("set abort")


if __name__ == "__main__":
    serve(Robot())
