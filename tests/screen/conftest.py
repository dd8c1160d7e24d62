"""A cell, a recorded run, an application over them, and pictures that must stay the same."""

import asyncio
import os
import re
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter
from textual.pilot import Pilot

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.screen.app import TechnicianApp
from hexacell.screen.model import ScreenModel
from hexacell.screen.preferences import ScreenPreferences
from hexacell.screen.widgets import Table, TextList
from hexacell.screen.workplace import Workplace
from procedures.run.cancellation import cancel_and_wait
from procedures.steps.events import Event
from tests.screen.drawing import is_all_drawn
from tests.screen.told_run import ToldWorkplace
from tests.waiting import until

HERE = Path(__file__).parent
SNAPSHOTS = HERE / "snapshots"
UPDATE = "HEXACELL_UPDATE_SNAPSHOTS"
"""In the environment: pictures are written instead of compared."""

Opened = Callable[..., AbstractAsyncContextManager[Pilot[int]]]


@pytest.fixture(autouse=True)
def nobodys_preferences(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a developer has chosen changes no picture."""
    for name in ("XDG_CONFIG_HOME", "NO_COLOR"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session")
def history() -> tuple[Event, ...]:
    """A whole calibration, as a simulated cell recorded it, without raw readings."""
    lines = (HERE / "recorded" / "events.jsonl").read_text().splitlines()
    event: TypeAdapter[Any] = TypeAdapter(Event)
    return tuple(event.validate_json(line) for line in lines)


@pytest.fixture(scope="session")
def cell() -> Cell:
    """The cell that recorded it."""
    return load_cell(bundled_config("simulated-hexaglide"))


@pytest.fixture
def opened() -> Opened:
    """An application over a workplace, once its backend is loaded; its clock stands still."""

    @asynccontextmanager
    async def opened_app(
        workplace: ToldWorkplace,
        size: tuple[int, int] = (80, 24),
        preferences: ScreenPreferences | None = None,
    ) -> AsyncIterator[Pilot[int]]:
        app = TechnicianApp(lambda: ScreenModel(workplace, lambda: 0.0), preferences)
        async with app.run_test(size=size) as pilot:
            await until(lambda: app.model is not None)
            await settled(pilot)
            yield pilot

    return opened_app


@asynccontextmanager
async def attended(workplace: Workplace) -> AsyncIterator[ScreenModel]:
    """The model over a workplace, without an application; its clock stands still."""
    model = ScreenModel(workplace, lambda: 0.0)
    attending = asyncio.create_task(model.attend())
    try:
        yield model
    finally:
        await cancel_and_wait(attending)


async def settled(pilot: Pilot[int]) -> None:
    """Until everything that was said and pressed is drawn."""
    app = pilot.app
    assert isinstance(app, TechnicianApp)
    await pilot.pause()
    app.draw()
    await _until_drawn(pilot)
    # At its anchor a list moves its scroll bar without drawing it; a table does not move one that is new.
    for screen in app.screen_stack:
        for one in (*screen.query(TextList), *screen.query(Table)):
            one.vertical_scrollbar.position = one.scroll_y
            one.vertical_scrollbar.refresh()
    await _until_drawn(pilot)


async def _until_drawn(pilot: Pilot[int]) -> None:
    await pilot.pause()
    while not (is_all_drawn(pilot.app) or pilot.app._exit):
        await pilot.pause()


def picture_of(app: TechnicianApp) -> str:
    """The screen as SVG, without what differs between two equal ones."""
    return re.sub(r"terminal-\d+", "terminal", without_fonts(app.export_screenshot(simplify=True)))


def without_fonts(svg: str) -> str:
    """A terminal as SVG that loads nothing."""
    return re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL)


async def compare_with_snapshot(name: str, pilot: Pilot[int]) -> None:
    """Compare what is shown with the picture that was kept; keep it where that is asked for."""
    compare_with_kept(SNAPSHOTS / f"{name}.svg", await settled_picture(pilot))


async def settled_picture(pilot: Pilot[int]) -> str:
    """What is shown once it does not change any more."""
    assert isinstance(pilot.app, TechnicianApp)
    await settled(pilot)
    before = ""
    while before != (now := picture_of(pilot.app)):  # what was just made is drawn next
        before = now
        await settled(pilot)
    return now


def compare_with_kept(path: Path, picture: str) -> None:
    """Compare a picture with the one that was kept; keep it where that is asked for."""
    if UPDATE in os.environ:
        path.write_text(picture)
    elif picture != path.read_text():
        now = path.with_suffix(".now.svg")
        now.write_text(picture)
        pytest.fail(f"{path.stem} looks different, see {now.name}; {UPDATE}=1 keeps it so")
