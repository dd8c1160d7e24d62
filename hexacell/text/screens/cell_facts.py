"""What a cell file states, in a few lines: robot, controller, devices, plan and limits."""

from collections.abc import Iterator

from hexacell.cell.loader import Cell


def cell_facts(cell: Cell) -> Iterator[str]:
    """A line each: what there is, what is measured, and what must be reached."""
    settings = cell.settings
    controller, plan, limits = settings.controller, settings.identification, settings.acceptance
    yield f"robot       {settings.robot.mechanism}"
    yield f"controller  {controller.protocol}"
    yield f"its config  {', '.join(one.name for one in cell.config_paths)}"
    gauges = ", ".join(
        f"{'+' if one.sign > 0 else '-'}{one.axis} {one.protocol}" for one in settings.gauges
    )
    yield f"gauges      {gauges}"
    yield f"encoders    {settings.encoders.protocol}"
    yield f"plan        {len(plan.points)} points, {plan.orientations} orientations each"
    yield f"limit       {limits.position_mm:g} mm and {limits.orientation_deg:g} deg at the task poses"
