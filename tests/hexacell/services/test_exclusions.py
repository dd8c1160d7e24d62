"""What the cell file excludes is never commanded; the screen writes and removes exclusions in the file."""

from collections.abc import Callable
from typing import Any

import pytest

from hexacell.campaign.pose_list import pose_list_of
from hexacell.cell.limits import ExclusionSettings
from hexacell.cell.loader import Cell, load_cell
from hexacell.errors import FileError, Interruption, UsageError
from hexacell.kinematics.pose import Pose
from hexacell.services.preflight import toggle_exclusion
from hexacell.services.run.calibration_run import calibrate
from hexacell.services.run.replay_run import replay
from hexacell.text.screens.checklist import exclusions_text, plan_rows
from procedures.engine.commands import Abort, CommandQueue
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase
from procedures.run.state import fold
from procedures.steps import events
from procedures.steps.move import Move
from tests.hexacell.services.conftest import Approver

THREE_POINTS = ((100.0, -100.0, 500.0), (0.0, 150.0, 520.0), (-100.0, 100.0, 500.0))
"""The first and the last are the points of the cell that was calibrated."""


@pytest.mark.slow
async def test_others_are_measured_in_their_place_and_points_are_left(make_site, finished):
    samples = fold(finished.history).samples(Phase.IDENTIFY)
    poses = [one.pose for one in samples if one.orientation in {3, 6}]
    assert len(poses) == 4
    # Half the smallest angle to a reference at most, as the screen writes them.
    exclusions = (
        ExclusionSettings(point=2),
        *(ExclusionSettings(pose=pose, within_deg=min(5.0, 0.5 * tilt_deg(pose))) for pose in poses),
    )
    site = make_site(identification__points=THREE_POINTS, exclusions=exclusions)
    queue = CommandQueue()

    def stop_early(event: events.Event, _: Any) -> None:
        if isinstance(event, events.SetClosed):
            queue.put(Abort())

    changes = {"operator": Approver(), "unattended": False}
    for resume in (False, True):
        with pytest.raises(Interruption):
            await calibrate(site.order(resume=resume, **changes), [stop_early], queue)
    begun = site.happened(events.StepBegun)
    commanded = [event.step.pose for event in begun if isinstance(event.step, Move)]
    assert commanded
    assert all(map(site.cell.settings.excluded_commands.allows, commanded))
    records = fold(read_journal(site.folder.journal)).samples(Phase.IDENTIFY)
    assert len(records) == len(samples)
    assert {one.at.point for one in records} == {1, 3}
    report = await replay(site.folder.path)
    assert not report.differences, "a replay decides alike"


def tilt_deg(pose: Any) -> float:
    return float(Pose(*pose[:3]).angle_to(Pose(*pose)) * 57.29577951308232)


def test_what_leaves_too_little_is_refused_with_its_line(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(identification__points=THREE_POINTS[::2])
    line = cell.text.count("\n") + 2
    for text, said in (
        ("point = 2\n", "1 of 2 points would be left"),
        ("point = 9\n", "there is no point 9"),
        ("", "an exclusion is of a point or of a pose"),
        ("pose = [100.0, -100.0, 500.0, 4.0, 0.0, 0.0]\n", "the reference of a point"),
    ):
        cell.path.write_text(f"{cell.text}\n[[exclusions]]\n{text}")
        with pytest.raises(FileError, match=said) as refused:
            load_cell(cell.path)
        assert refused.value.line == line


def test_of_a_list_the_pose_itself_is_left_out_and_no_other(make_cell, tmp_path) -> None:
    rows = [
        f"{point},{row},{x},{y},{z},{tilt},0,0"
        for point, (x, y, z) in enumerate(THREE_POINTS, start=1)
        for row, tilt in enumerate((0.0, 10.0, 11.0), start=1)
    ]
    (tmp_path / "list.csv").write_text("\n".join(["point,orientation,x,y,z,a,b,c", *rows]) + "\n")
    cell = make_cell(identification__points=THREE_POINTS, identification__poses="list.csv")
    listed = pose_list_of(cell)
    assert listed is not None
    planned = [
        (point, row, pose) for point in (1, 2, 3) for row, pose in enumerate(listed.at(point), start=1)
    ]
    left = pose_list_of(toggle_exclusion(cell, "2.2", planned))
    assert left is not None
    assert [pose.a for pose in left.at(2)] == [0.0, 11.0]
    assert len(left) == len(listed) - 1


@pytest.fixture
def cell(make_cell: Callable[..., Cell]) -> Cell:
    made = make_cell(identification__points=THREE_POINTS)
    made.path.write_text(f"# A robot.\n{made.text}# The end.\n")
    return load_cell(made.path)


PLANNED = [
    (point, row, Pose(*at, *angles))
    for point, at in enumerate(THREE_POINTS, start=1)
    for row, angles in enumerate(((), (12.0, 4.0, -7.5), (1.0, 4.0, -7.5)), start=1)
]


def test_a_key_excludes_and_removes_and_keeps_the_rest_of_the_file(cell: Cell) -> None:
    before = cell.path.read_text()
    one = toggle_exclusion(cell, "1.2", PLANNED)
    two = toggle_exclusion(one, "3", PLANNED)
    assert two.settings.excluded_points == {3}
    [refused] = two.settings.excluded_commands.commands
    assert (refused.pose, refused.within_mm, refused.within_deg) == (PLANNED[1][2].as_tuple(), 30.0, 5.0)
    assert exclusions_text(two.settings) == "Excluded by the cell file: 1 pose, point 3."
    rows = dict(plan_rows(two.settings, PLANNED))
    assert list(rows) == ["e1", "e2", "1", "1.1", "1.3", "2", "2.1", "2.2", "2.3"]
    assert rows["e1"].startswith("OUT")
    assert "within 30 mm, 5 deg" in rows["e1"]
    assert cell.path.read_text().startswith(before)
    three = toggle_exclusion(two, "e1", PLANNED)
    assert three.settings.excluded_points == {3}
    assert not three.settings.excluded_commands.commands
    toggle_exclusion(three, "e1", PLANNED)
    assert cell.path.read_text() == before
    near = [(1, 1, Pose(*THREE_POINTS[0])), (1, 2, Pose(*THREE_POINTS[0], 4.0))]
    [refused] = toggle_exclusion(cell, "1.2", near).settings.excluded_commands.commands
    assert refused.within_deg == pytest.approx(2.0, abs=1e-3), "nothing near a reference is excluded"


def test_what_is_not_there_or_changed_meanwhile_cannot_be_excluded(cell: Cell) -> None:
    for name, said in (("9", "there is no 9"), ("1.1", "is the reference"), ("e1", "no e1")):
        with pytest.raises(UsageError, match=said):
            toggle_exclusion(cell, name, PLANNED)
    cell.path.write_text(f"{cell.text}# mine\n")
    with pytest.raises(FileError):
        toggle_exclusion(cell, "3", PLANNED)
    assert cell.path.read_text().endswith("# mine\n")


def test_an_exclusion_among_a_persons_own_is_removed_with_its_comments_kept(cell: Cell) -> None:
    cell.path.write_text(
        f"{cell.text}\n[[exclusions]] # a cable\n# of the spindle\npose = [\n  0.0, 150.0, 520.0,\n"
        "  20.0, 0.0, 0.0,\n]\n\n[[exclusions]]\npoint = 3\n"
    )
    left = toggle_exclusion(load_cell(cell.path), "e1", ())
    assert left.settings.excluded_points == {3}
    assert left.text.endswith("# The end.\n# of the spindle\n\n[[exclusions]]\npoint = 3\n")
