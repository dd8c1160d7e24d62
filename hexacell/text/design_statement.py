"""How much the records know beside those of the best design, as a sentence for people."""

from __future__ import annotations

from hexacell.design.design_efficiency import DesignEfficiency


def design_sentence(design: DesignEfficiency) -> str:
    """What the records hold at least of the information that the best poses would."""
    task = ""
    if design.i is not None:
        task = f", and {100 * design.i.certified:.0f} % for the task poses (I-efficiency)"
    return (
        f"The records hold {100 * design.d.certified:.0f} % of the information that the best poses would, "
        f"had the robot been known beforehand (D-efficiency){task}; certified to "
        f"{100 * (1.0 - design.certificate):.0f} %."
    )
