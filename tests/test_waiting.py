"""No test waits for a fixed time, because a busy machine may take longer."""

import re
from pathlib import Path

HERE = Path(__file__).parent
CLOCK = re.compile(
    r"time\.sleep\((?!0\))|asyncio\.sleep\((?!0\))|\btime\.(monotonic|perf_counter)|asyncio\.(wait_for|timeout)\b"
    r"|\.(wait|join|communicate)\((timeout=)?\d|^from time import",
    flags=re.MULTILINE,
)

ALLOWED = {
    "cli/test_run_stopped.py": "compares a moment with those in a journal",
    "conftest.py": "how long a test's remains may last before the test fails",
    "drivers/controllers/adapter/faulty_program.py": "is a robot, whose moves take time",
    "drivers/controllers/opcua/plc.py": "is a PLC, which works in cycles",
    "drivers/encoders/test_lifetime.py": "cancels at sixty different moments",
    "drivers/simulated/test_followed_controller.py": "has programs that show where a robot is by now",
    "drivers/simulated/linuxcnc/conftest.py": "how fast a fake machine moves, and that nothing is said",
    "faults/conftest.py": "how long a whole run takes, of which moments are drawn",
    "faults/driver.py": "kills at a drawn moment",
    "hexacell/api/test_run.py": "computes meanwhile as a notebook does",
    "linuxcnc/conftest.py": "how long LinuxCNC may take before it is started again",
    "linuxcnc/test_module.py": "compares how long moves take",
    "packages/hexapod_box/hexacell_hexapod_box.py": "is a driver, with limits of waiting",
    "packages/hexapod_box/hexacell_hexapod_box_twin.py": "is a robot, whose moves take time",
    "packages/scale_box/hexacell_scale_box.py": "is a driver, which waits for no answer longer than it may",
    "procedures/journal/test_journal.py": "compares a moment with those in a journal",
    "test_harness.py": "is about tests that wait",
    "waiting.py": "waits for everybody",
}


def test_no_test_waits_for_a_time() -> None:
    files = (path.relative_to(HERE) for path in HERE.rglob("*.py") if path != Path(__file__))
    found = {
        file.as_posix()
        for file in files
        if file.parts[0] != "benchmarks" and CLOCK.search((HERE / file).read_text())
    }
    assert found - set(ALLOWED) == set()
