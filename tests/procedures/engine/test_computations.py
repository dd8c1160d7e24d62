"""What a run computes beside its steps: an identification whose held-out poses cannot be measured."""

from __future__ import annotations

from typing import Any

import pytest

from hexacell.errors import ExitCode, LimitError
from procedures.steps import events

FAR_AWAY = ((0.0, 0.0, 9000.0), (100.0, 100.0, 9000.0))
STATED_TOO_SMALL = {"noise__encoder": 2e-4, "noise__gauge_mm": 2e-4}


@pytest.mark.parametrize(
    ("noise", "verdict"), [({}, "Good: the records"), (STATED_TOO_SMALL, "Doubtful: ")]
)
async def test_where_no_held_out_pose_can_be_measured_the_verdict_is_told_first(
    recording, replayed, noise: dict[str, Any], verdict: str
) -> None:
    """A geometry that is wrong has no poses either: a person must not look for them at the points."""
    measured = recording.until(events.SetClosed, count=2)
    rig = replayed(measured, verification__points=FAR_AWAY, **noise)
    with pytest.raises(LimitError) as ended:
        await rig.run()
    assert ended.value.exit_code is ExitCode.OUT_OF_LIMITS
    told = str(ended.value)
    assert told.startswith(verdict)
    assert "With this geometry no held-out pose can be measured: the untilted platform" in told
    assert rig.folder.result.exists(), "the result can be looked at"
