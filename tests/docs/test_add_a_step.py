"""The page on adding a step: its step and its rule, in a copy of the program, with a run of its engine."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "add-a-step.md").read_text()
FILES = ("procedures/steps/read_temperatures.py", "procedures/guards/rules/controller_hot.py")

RUN = """
import asyncio, json, sys
from pathlib import Path
import pytest
from drivers.interfaces import ControllerStatus
from hexacell.errors import Interruption
from hexacell.text.line_face import activity, event_text
from procedures.engine.commands import Abort
from procedures.guards.polling import DevicePoller, PolledDevices
from procedures.guards.rules import first_trip
from procedures.journal.journal import read_journal
from procedures.run.state import fold
from procedures.steps.read_temperatures import TemperaturesRead
from tests.procedures.rig import new_rig

rig = new_rig(Path(sys.argv[1]))

def listener(event, state):
    if state.target is not None:
        rig.engine.queue.put(Abort())

with pytest.raises(Interruption):
    asyncio.run(rig.run(listener))
history = read_journal(rig.folder.journal)
place = [event.kind for event in history].index("temperatures read")
state = fold(history)

async def status():
    raise AssertionError

report = DevicePoller("controller", status, value=ControllerStatus(False, True, ("drive 2 is too hot",)))
trip = first_trip(PolledDevices(controller=report), None)
print(json.dumps({
    "begun": history[place - 1].step.key,
    "doing": history[place - 1].step.doing,
    "next": history[place + 1].kind,
    "state": state.latest(TemperaturesRead) == history[place],
    "text": event_text(history[place], state),
    "trip": trip.problem,
}))
"""


def edited(text: str, patch: str) -> str:
    """A file with the lines that a patch adds."""
    for part in patch.split("@@\n"):
        lines = part.splitlines(keepends=True)
        old = "".join(line[1:] for line in lines if line.startswith(" "))
        assert text.count(old) == 1, old
        text = text.replace(old, "".join(line[1:] for line in lines))
    return text


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """A copy of what is done to the robot, with what the page adds."""
    shutil.copytree(ROOT / "procedures", tmp_path / "procedures")
    codes = re.findall(r"^```python\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL)
    for name, code in zip(FILES, codes, strict=True):
        assert f"`{Path(name).name}`" in PAGE
        (tmp_path / name).write_text(code)
    for name, patch in re.findall(r"^```diff\n(\S+)\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL):
        path = tmp_path / name
        path.write_text(edited(path.read_text(), patch))
    return tmp_path


def test_the_step_is_journalled_kept_and_told_and_the_rule_trips(program: Path) -> None:
    paths = os.pathsep.join(map(str, (program, ROOT)))
    (program / "cell").mkdir()
    command = [sys.executable, "-c", RUN, str(program / "cell")]
    environment = os.environ | {"PYTHONPATH": paths}
    ran = subprocess.run(command, cwd=program, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout) == {
        "begun": "read temperatures",
        "doing": "reading the thermometers",
        "next": "begun",
        "state": True,
        "text": "0 thermometers read at the start",
        "trip": "says: drive 2 is too hot",
    }
