"""The plan for people: what to measure next, and what going on would gain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hexacell.campaign.decisions import Finished, Forecast, MeasurePose, StartPoint
from hexacell.campaign.dry_run import DryRunResult


def visit_words(decision: StartPoint | MeasurePose | Finished) -> str:
    """What to do now."""
    match decision:
        case Finished(reason=reason):
            return f"Done: {reason}."
        case StartPoint(point=point, pose=pose):
            return f"Begin point {point}: go to {pose}, put the gauges around the ball and zero them."
        case MeasurePose():
            expected = ", ".join(
                f"{axis} {value:+.3f} +- {sigma:.3f}"
                for axis, value, sigma in zip("xyz", decision.deviation, decision.sigma, strict=True)
            )
            way = "".join(f"go over {pose}, " for pose in decision.via)
            return (
                f"Point {decision.point}, orientation {decision.orientation}: {way}go to {decision.pose}. "
                f"The gauges should show {expected} mm (one sigma)."
            )


def outlook_words(outlook: Forecast | None) -> str:
    """How accurate the robot would be now, and what going on would change."""
    if outlook is None:
        return "The robot can take none of the task poses, so no accuracy is predicted."
    now = f"Predicted error at the task poses {outlook.now_mm:.3f} mm (one sigma, the worst)"
    if not outlook.records:
        return f"{now}."
    return (
        f"{now}; going on gains {outlook.gain_mm:.3f} mm in {outlook.records} records, about "
        f"{minutes_words(outlook.minutes)}."
    )


def foretold_words(
    foretold: DryRunResult, lost: Mapping[int, float], *, target_mm: float | None
) -> Iterator[str]:
    """What a plan will give, and for which robots it will not work."""
    if not foretold.robots:
        yield (
            f"None of {foretold.drawn} robots drawn within the tolerances could be calibrated like this: "
            "the run may have to be given up."
        )
    elif foretold.worst_sigma_mm is None:
        yield f"{outlook_words(None)} There will be about {foretold.records} records."
    else:
        yield (
            f"{foretold.records} records at {foretold.points} points will give about "
            f"{foretold.worst_sigma_mm:.3f} mm at the worst of your task poses (one sigma), in about "
            f"{minutes_words(foretold.minutes)}."
        )
        if target_mm is not None and foretold.worst_sigma_mm > target_mm:
            yield f"That is not the target of {target_mm:g} mm: allow more records, points or tilt."
    if 0 < foretold.robots < foretold.drawn:
        failed = foretold.drawn - foretold.robots
        yield f"{failed} of {foretold.drawn} simulated robots could not be calibrated like this."
    for point, share in lost.items():
        if share > 0.0:
            yield (
                f"Point {point}: {share:.0%} of the robots within the tolerances cannot stand there; "
                "if yours is one of them, the run will leave it out or stop."
            )


def minutes_words(minutes: float) -> str:
    """A duration, no more exact than it is known."""
    return f"{60.0 * minutes:.0f} seconds" if minutes < 1.5 else f"{minutes:.0f} minutes"
