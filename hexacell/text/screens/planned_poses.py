"""Text for the list of planned poses, in which a key excludes what the robot must not be sent to."""

from collections.abc import Iterator, Sequence

from hexacell.cell.model import CellSettings
from hexacell.dry_run.campaign import VisitedPose
from hexacell.text.screens.live import PLAN_UNKNOWN, TRYING

NOT_TRIED = "v in 2 Preflight tries the plan; then its poses are here."
EVERYTHING = "These poses were measured on a simulated robot; a real one is sent to others near them."


def plan_note(planned: Sequence[VisitedPose], *, is_trying: bool) -> str:
    """Where the poses of the plan come from, or why there are none."""
    notes = [EVERYTHING] if planned else [] if is_trying else [NOT_TRIED]
    return " ".join([*notes, *([TRYING] if is_trying else [])])


def plan_rows(settings: CellSettings, planned: Sequence[VisitedPose]) -> Iterator[tuple[str, str]]:
    """Name and line of each exclusion of the cell file and, once the plan was tried, of its poses."""
    points = settings.identification.points
    for number, one in enumerate(settings.exclusions, start=1):
        if one.pose is None:
            what = f"point {one.point}, {_place(points[(one.point or 1) - 1])}"
        else:
            what = " ".join(f"{axis} {value:.1f}" for axis, value in zip("xyzabc", one.pose, strict=True))
            what += f", within {one.within_mm:g} mm, {one.within_deg:g} deg" if one.within_deg else ""
        yield f"e{number}", f"OUT  e{number}  {what}"
    if planned:
        yield from _poses(settings, planned)


def plan_lines(settings: CellSettings, tried: Sequence[str], *, is_trying: bool) -> list[str]:
    """How much the cell file excludes, and what the plan is expected to give."""
    lines = (exclusions_text(settings), *([TRYING] if is_trying else tried))
    return list(filter(None, lines)) or [PLAN_UNKNOWN]


def exclusions_text(settings: CellSettings) -> str:
    """How much the cell file excludes; empty if nothing."""
    points = [f"point {point}" for point in sorted(settings.excluded_points)]
    poses = len(settings.excluded_commands.commands)
    parts = [*([f"{poses} pose{'s' * (poses > 1)}"] if poses else []), *points]
    return f"Excluded by the cell file: {', '.join(parts)}." if parts else ""


def _poses(settings: CellSettings, planned: Sequence[VisitedPose]) -> Iterator[tuple[str, str]]:
    """A row for each point that is measured, and below it one for each of its poses."""
    excluded = settings.excluded_commands
    for number, position in enumerate(settings.identification.points, start=1):
        if number in settings.excluded_points:
            continue
        here = [one for one in planned if one[0] == number and excluded.allows(one[2].as_tuple())]
        yield str(number), f"     point {number}, {_place(position)}: {len(here)} records"
        for _, orientation, pose in here:
            name = f"{number}.{orientation}"
            reference = "  reference" if orientation == 1 else ""
            angles = zip("abc", pose.as_tuple()[3:], strict=True)
            shown = "  ".join(f"{axis} {value:6.1f}" for axis, value in angles)
            yield name, f"     {name:>7}  {shown} deg{reference}"


def _place(pose: Sequence[float]) -> str:
    return "  ".join(f"{axis} {value:.1f}" for axis, value in zip("xyz", pose[:3], strict=True))
