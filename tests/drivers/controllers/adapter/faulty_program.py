"""A robot by the adapter protocol that fails as it is told: a fault at the nth request of a kind.

It writes what it does to a file: ``move`` when it begins one, ``rest`` when that has ended or was stopped.
"""

import json
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

POSE = [0.0, -200.0, 550.0, 0.0, 0.0, 0.0]
state = {"estop": True, "enabled": False, "homed": False, "remote": True, "moving": False}
pose, writing, stopped = POSE, threading.Lock(), threading.Event()
told: dict[str, Any] = {}
counts: dict[str, int] = {}


def note(what):
    with Path(told["log"]).open("a") as log:
        log.write(f"{what}\n")


def write(data):
    with writing:
        sys.stdout.buffer.write(data)
        sys.stdout.flush()


def say(number, **answer):
    write(json.dumps({"id": number, **answer}).encode() + b"\n")


def move(number, target, duration_s):
    global pose  # noqa: PLW0603
    start, steps = pose, max(2, int(duration_s / 0.01))
    state["moving"] = True
    note("move")
    stopped.clear()
    for step in range(1, steps + 1):
        if stopped.wait(0.01):
            break
        pose = [a + step / steps * (b - a) for a, b in zip(start, target, strict=True)]
        say(number, at=pose)
    state["moving"] = False
    note("rest")
    return pose == target


def done_of(request):
    do = request["do"]
    if do == "hello":
        told.update(request["settings"])
        return {"version": 1, "length": "mm", "angle": "deg", "name": "faulty"}
    if do == "status":
        return dict(state)
    if do == "position":
        return {"pose": pose if state["homed"] else None, "joints": POSE}
    if do == "stop":
        stopped.set()
        while state["moving"]:
            time.sleep(0.002)
    if do == "reset-estop":
        state["estop"] = False
    if do in {"switch-on", "switch-off"}:
        state["enabled"] = do == "switch-on"
    if do == "home":
        state["homed"] = True
    return {}


def answer(request):
    do, number = request["do"], request["id"]
    counts[do] = counts.get(do, 0) + 1
    is_faulty = told.get("at") == do and told.get("nth", 1) in {0, counts[do]}
    fault = told.get("fault") if is_faulty else None
    if do == "hello":
        told.update(request["settings"])
        fault = told["fault"] if told.get("at") == "hello" else None
    if fault == "silence":
        return
    if do == "move" and fault not in {"early", "refused", "pose", "fault", "interrupted"}:
        if not move(number, request["pose"], request["duration_s"]):
            say(number, failed={"kind": "interrupted", "reason": "it was stopped"})
            return
        done = {}
    else:
        done = done_of({**request, "do": ""} if fault == "no effect" else request)
    send = FAULTS.get(str(fault), lambda number, done: say(number, done=done))
    send(number, done)
    if fault == "early":
        move(number, request.get("pose", POSE), 0.2)


def line(text):
    return lambda number, done: write(text.replace("ID", str(number)).encode() + b"\n")


def jump(number, done):
    global pose  # noqa: PLW0603
    say(number, done=done)
    pose = [value + 5.0 for value in pose]


FAULTS = {
    "garbage": line("\x00\x7f@@@"),
    "text": line("ready"),
    "list": line("[1, 2]"),
    "empty": line(""),
    "nan": line('{"id": ID, "done": {"pose": [NaN, 0, 0, 0, 0, 0], "joints": null}}'),
    "infinite": line('{"id": ID, "at": [1e999, 0, 0, 0, 0, 0]}'),
    "aside": line('{"id": ID, "at": [300, 0, 0, 0, 0, 0]}'),
    "five numbers": line('{"id": ID, "at": [0, 0, 0, 0, 0]}'),
    "no answer in it": line('{"id": ID}'),
    "two answers in it": line('{"id": ID, "done": {}, "failed": {"kind": "fault", "reason": "x"}}'),
    "number as text": line('{"id": "ID", "done": {}}'),
    "done is no table": line('{"id": ID, "done": true}'),
    "unknown kind": line('{"id": ID, "failed": {"kind": "tired", "reason": "x"}}'),
    "no reason": line('{"id": ID, "failed": {"kind": "fault"}}'),
    "nested": line('{"id": ID, "done": ' + '{"a":' * 5000 + "1" + "}" * 5000 + "}"),
    "no text": lambda number, done: write(b'{"id": 1, "done": "\xff\xfe"}\n'),
    "long": lambda number, done: write(b"x" * 200_000 + b"\n"),
    "endless": lambda number, done: write(b"x" * 200_000),
    "another number": lambda number, done: say(number + 7, done=done),
    "an earlier number": lambda number, done: say(max(number - 1, 0), done=done),
    "twice": lambda number, done: (say(number, done=done), say(number, done=done)),
    "no keys": lambda number, done: say(number, done={}),
    "inch": lambda number, done: say(number, done={**done, "length": "inch"}),
    "version 2": lambda number, done: say(number, done={**done, "version": 2}),
    "not remote": lambda number, done: say(number, done={**done, "remote": False}),
    "estop": lambda number, done: say(number, done={**done, "estop": True}),
    "words for truth": lambda number, done: say(number, done={**done, "estop": "no"}),
    "elsewhere": lambda number, done: say(number, done={**done, "pose": [9.0] * 6}),
    "nowhere": lambda number, done: say(number, done={**done, "pose": None}),
    "still moving": lambda number, done: say(number, done={**done, "moving": True}),
    "half": lambda number, done: (write(b'{"id": 3, "do'), os._exit(0)),
    "exit": lambda number, done: (print("out of oil", file=sys.stderr, flush=True), os._exit(3)),
    "flood": lambda number, done: (sys.stderr.write("x" * 300_000), say(number, done=done)),
    "jump": jump,
    **{
        kind: lambda number, done, kind=kind: say(number, failed={"kind": kind, "reason": "so it is"})
        for kind in ("pose", "refused", "interrupted", "fault")
    },
}
NAMES = ("silence", "early", "no effect", *FAULTS)

if __name__ == "__main__":
    for request in map(json.loads, sys.stdin):
        if request["do"] == "hello":
            answer(request)
        else:
            threading.Thread(target=answer, args=(request,), daemon=True).start()
    stopped.set()
    while state["moving"]:
        time.sleep(0.002)
