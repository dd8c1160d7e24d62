"""Text for what changed between runs: the watch over all of them."""

from __future__ import annotations

from hexacell.services.history.drift_history import DriftHistory, FoundChange, ParameterRate
from hexacell.text.history import TREND_DAYS
from hexacell.text.layout import wrapped

SMALLEST_SHOWN = 0.001
"""A standard deviation that is smaller has a further digit."""


def watch_text(found: DriftHistory) -> str:
    """What changed and when, and how near the largest sum is to an alarm; empty without runs."""
    if not found.runs:
        return ""
    lines = [wrapped(change_sentence(one), indent=2) for one in found.changes]
    name, share = max(found.shares, key=lambda one: one[1])
    since = "since then " if found.changes else ""
    first, last = (f"{at:%Y-%m-%d}" for at in (found.runs[0], found.runs[-1]))
    runs = f"{len(found.runs)} runs from {first} to {last}" if len(found.runs) > 1 else f"1 run of {first}"
    quiet = "" if found.changes else "no leg has moved: "
    rest = f"{runs}: {quiet}{since}the largest sum of innovations is {share:.0%} of its limit ({name})."
    shown = [one for one in found.celsius if one is not None]
    warmth = [f"Their thermometers showed {min(shown):.1f} to {max(shown):.1f} deg C."] if shown else []
    return "\n".join([*lines, wrapped(rest, indent=2), *_rate_lines(found), *warmth])


def _rate_lines(found: DriftHistory) -> list[str]:
    """The parameter that moves most surely by all runs since the last change."""
    if not found.rates:
        return []
    most = max(found.rates, key=lambda one: abs(one.per_day) / one.sigma_per_day)
    if most.is_steady:
        return [wrapped(f"Moving steadily: {_rate_words(most)}, if it alone moves.", indent=2)]
    return [wrapped(f"No parameter moves steadily; nearest to it is {_rate_words(most)}.", indent=2)]


def _rate_words(rate: ParameterRate) -> str:
    change = _in_thirty_days(rate.per_day, rate.sigma_per_day)
    return f"{rate.name} by {change} {rate.unit} in {TREND_DAYS:.0f} days"


def _in_thirty_days(per_day: float, sigma_per_day: float) -> str:
    change, sigma = TREND_DAYS * per_day, TREND_DAYS * sigma_per_day
    digits = 3 if sigma >= SMALLEST_SHOWN else 4
    return f"{change:+.{digits}f} +- {sigma:.{digits}f}"


def legs_text(found: FoundChange) -> str:
    """The leg that changed, or those of which one did."""
    return " or ".join(map(str, found.possible_legs))


def change_sentence(found: FoundChange) -> str:
    """A change that was found: which leg, by how much, when, and whether others changed as well."""
    unit = found.parameter.kind.unit.value
    others = " and ".join(str(leg) for leg in found.other_legs)
    size = f"{abs(found.change):.3f} +- {found.sigma:.3f} {unit}"
    rest = f"legs {others} moved as well" if len(found.other_legs) > 1 else f"leg {others} moved as well"
    return (
        f"leg {legs_text(found)} moved {size} (as {found.parameter.name} by {found.change:+.3f}) "
        f"between {found.after:%Y-%m-%d %H:%M} and {found.before:%Y-%m-%d %H:%M}"
        f"{_motion_since(found)}; {rest if others else 'the others did not'}. "
        f"Noticed {found.noticed:%Y-%m-%d}."
    )


def _motion_since(found: FoundChange) -> str:
    if not found.moves_on:
        return ""
    rate, unit = _in_thirty_days(found.per_day, found.sigma_per_day), found.parameter.kind.unit.value
    return f" and has moved on since by {rate} {unit} in {TREND_DAYS:.0f} days"
