"""The cell of the documentation is calibrated, by its program and behind the adapter itself."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[4] / "configs" / "controller-adapter"


@pytest.mark.slow
@pytest.mark.parametrize("where", ['command = ["python3", "robot.py"]', 'address = "127.0.0.1:6001"'])
def test_it_passes(where: str, tmp_path: Path) -> None:
    folder = shutil.copytree(EXAMPLE, tmp_path / "cell")
    cell = folder / "cell.toml"
    cell.write_text(cell.read_text().replace('command = ["python3", "robot.py"]', where))
    command = (sys.executable, "-m", "hexacell", "run", str(cell), "--unattended", "--mode", "optimise")
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "(limit 0.3): pass" in ended.stdout
