"""The section of what the model has beside the geometry."""

from typing import Literal

from hexacell.cell.fields import Positive, Section, key

TermName = Literal["backlash", "play", "compliance"]


class ModelSettings(Section):
    """Terms of the model beside the geometry, which are taken where the records show them."""

    terms: tuple[TermName, ...] = key(
        ("backlash", "play", "compliance"),
        "terms that records are searched for; compliance with uncertainty.own_weight_n only; [] for none",
        max_length=3,
    )
    backlash: Positive = key(
        0.1, "what the backlash of a joint may be, 1 sigma before measuring", alias="backlash_mm"
    )
    play_mm: Positive = key(0.1, "what the play of a leg may be, mm, 1 sigma before measuring")
    compliance_um_n: Positive = key(
        0.3, "what the compliance of a leg may be, um/N, 1 sigma before measuring"
    )
