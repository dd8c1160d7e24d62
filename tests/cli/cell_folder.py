"""A folder with the demo's cell, and what makes it quick or short."""

import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from hexacell.config.write_record import RECORDS
from procedures.journal.journal import Journal, read_journal
from procedures.steps import events

CONFIGS = Path(__file__).parents[2] / "configs"
CELL = "simulated-hexaglide.toml"
CONTROLLER = "simulated-hexaglide.controller.toml"

# Fewer records and wide limits, on a cell that lives fast: the whole job in a few seconds.
QUICK = (
    ("clock_factor = 150.0", "clock_factor = 600.0"),
    ("give_up_s = 60.0", "give_up_s = 6000.0"),
    ("orientations = 17", "orientations = 7"),
    ("orientations = 6", "orientations = 2"),
    ("position_mm = 0.3 ", "position_mm = 20.0"),
    ("orientation_deg = 0.08", "orientation_deg = 5.0"),
    # Large rotations: few records identify it.
    ("turn_deg = 60.0", "turn_deg = 180.0"),
    ("leg_distance_mm = 30.0", "leg_distance_mm = 0.0"),
    ("base_cone_deg = 45.0", "base_cone_deg = 180.0"),
    ("platform_cone_deg = 45.0", "platform_cone_deg = 180.0"),
    ("[stations]\n", "[stations]\ntrial_mm = 0.0\n"),
    ("provisional = true", "provisional = false"),
    # Each test of the model fails one healthy run in a thousand, and the suite has hundreds of runs.
    ("encoder_mm = 0.01\ngauge_mm = 0.01", "encoder_mm = 0.014\ngauge_mm = 0.014"),
)

ASK = ('approval = "automatic"', 'approval = "ask"')
BY_HAND = ('placement = "fixed"', 'placement = "by-hand"')

# A busy machine may leave a simulated device waiting longer than a real one ever takes.
PATIENT = (
    *(
        (f"{place}\ntimeout_s = 3.0", f"{place}\ntimeout_s = 20.0")
        for place in (
            "omit it if its display does not tell",
            "the multiplexer's input\nmiddle_mm = 0.0",
            "Starrett with RS-232\nmiddle_mm = 0.0",
            "the paper's encoders had about 2.4",
        )
    ),
    ("heartbeat_ms = 3000", "heartbeat_ms = 5000"),
)

# As few records as identify it.
SHORT = (
    (
        """points = [
  [0.0, 0.0, 550.0],
  [0.0, -200.0, 550.0],
  [100.0, -100.0, 500.0],
  [100.0, 0.0, 600.0],
  [-100.0, 100.0, 500.0],
]
orientations = 17""",
        """points = [
  [100.0, -100.0, 500.0],
  [-100.0, 100.0, 500.0],
]
orientations = 7""",
    ),
)

Edits = tuple[tuple[str, str], ...]


def changed(text: str, edits: Edits) -> str:
    """``text`` with each edit made, at the one place where it can be."""
    for old, new in edits:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


@dataclass
class CellFolder:
    """A folder with a cell in it, its controller's config, and nothing else."""

    path: Path

    @property
    def cell(self) -> Path:
        return self.path / CELL

    @property
    def controller(self) -> Path:
        return self.path / CONTROLLER

    def edit(self, *edits: tuple[str, str]) -> None:
        self.cell.write_text(changed(self.cell.read_text(), edits))

    def without_simulation(self, bus: str = '{ interface = "virtual" }') -> None:
        """The same cell with devices of its own, which are not there."""
        text = self.cell.read_text()
        text = text[: text.index("[simulation]")].replace("[encoders]", f"[encoders]\nbus = {bus}")
        self.cell.write_text(re.sub(r'protocol = "(sylvac|mux10|cdi)"', r'\g<0>\nport = "/dev/\1"', text))

    def wait_long_for_devices(self) -> None:
        """Let a busy machine take its time."""
        self.edit(*PATIENT)

    def snapshot(self) -> dict[str, bytes | None]:
        """Everything in it except the lock, whose content has no meaning."""
        return {
            str(path.relative_to(self.path)): path.read_bytes() if path.is_file() else None
            for path in self.path.rglob("*")
            if not path.name.endswith(".hexacell-lock")
        }

    def runs(self) -> list[Path]:
        found = (self.path / "runs" / "simulated-hexaglide").glob("*")
        return sorted(path for path in found if path.name != RECORDS)

    def rewound(self, run: Path, before: str, text: str = "") -> Path:
        """A run of this cell, or of one of this ``text``, that got as far as ``run`` before a step."""
        history = read_journal(run / "journal.jsonl")
        steps = [event.step.key if isinstance(event, events.StepBegun) else "" for event in history]
        started = history[0].model_copy(update={"cell_text": text or self.cell.read_text()})
        journal = self.path / "runs" / "simulated-hexaglide" / "rewound" / "journal.jsonl"
        journal.parent.mkdir(parents=True)
        with Journal(journal) as new:
            new.append(started)
        lines = (run / "journal.jsonl").read_bytes().splitlines(keepends=True)
        with journal.open("ab") as stream:
            stream.writelines(lines[1 : steps.index(before)])
        for event in history[: steps.index(before)]:
            if isinstance(event, events.ProvisionalApplied):
                self._copy_write_back(run / event.folder, journal.parent / event.folder)
        return journal.parent

    def _copy_write_back(self, folder: Path, copy: Path) -> None:
        """A write to another cell's config as one to this cell's."""
        shutil.copytree(folder, copy)
        note = copy / "write-back.json"
        noted = {"path": str(self.controller), "backup_folder": str(copy)}
        note.write_text(json.dumps(json.loads(note.read_bytes()) | noted))


def copy_cell(folder: Path) -> CellFolder:
    for name in (CELL, CONTROLLER):
        (folder / name).write_bytes((CONFIGS / name).read_bytes())
    return CellFolder(folder)
