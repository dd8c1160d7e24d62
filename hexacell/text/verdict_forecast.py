"""Text for the probability of each verdict on a healthy machine, and what to do about limits it fails."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hexacell.dry_run.verdict_forecast import NOISE, WANTED, VerdictForecast
from hexacell.verdict.decision import Verdict

DIGITS = 2
"""Of a limit that is proposed."""


def verdict_forecast_lines(forecast: VerdictForecast) -> Iterator[str]:
    """How likely a healthy machine passes; if it is not, why, and what would help."""
    others = ", ".join(
        f"{verdict} {_percent(share)}"
        for verdict, share in forecast.probabilities.items()
        if verdict is not Verdict.PASS and share >= 0.005
    )
    rest = f" ({others})" if others else ""
    yield (
        f"A healthy machine of this cell passes with a probability of "
        f"{_percent(forecast.probabilities[Verdict.PASS])}{rest}."
    )
    if not forecast.is_wanted:
        yield _warning(forecast)


def _warning(forecast: VerdictForecast) -> str:
    limits = " and ".join(_limits(forecast)) or "the limits"
    part = f"{forecast.largest_part} ({forecast.largest_part_mm:.3f} of {forecast.standard_mm:.3f} mm)"
    return (
        f"That is too little: a good machine fails these limits. {WANTED:.0%} would pass {limits} in "
        f"[acceptance]. The largest part of the uncertainty at the worst task pose is the {part}: "
        f"{_help(forecast)}."
    )


def _limits(forecast: VerdictForecast) -> Iterator[str]:
    """The limits that are too small, with the value that would do."""
    wanted, present = forecast.passing, forecast.limits
    if wanted.position_mm > present.position_mm:
        yield f"position_mm = {_rounded_up(wanted.position_mm):g}"
    if wanted.orientation_deg > present.orientation_deg:
        yield f"orientation_deg = {_rounded_up(wanted.orientation_deg):g}"


def _help(forecast: VerdictForecast) -> str:
    if forecast.largest_part == NOISE:
        return "more records, or means of more readings, reduce it"
    return "have it calibrated, or measure it, and state its size in [uncertainty]"


def _rounded_up(limit: float) -> float:
    step = 10.0 ** (math.floor(math.log10(limit)) - DIGITS + 1)
    return float(f"{step * math.ceil(limit / step):.{DIGITS}g}")


def _percent(share: float) -> str:
    return f"{share:.0%}" if share < 0.995 else f"{share:.1%}"
