"""Parameters in the words of people at the machine."""

from __future__ import annotations

from hexacell.kinematics.mechanism import FrameConvention


def display_name(name: str, convention: FrameConvention | None = None) -> str:
    """``l3`` is "leg 3 length", ``B3z`` is "B3 z".

    With a convention that makes several parameters equal, the first of them stands for all:
    "B2/B3/B5 z".
    """
    if name[0] == "l":
        return f"leg {name[1:]} length"
    equal = convention.equal if convention else ()
    group = next((group for group in equal if group[0] == name), (name,))
    return f"{'/'.join(member[:-1] for member in group)} {name[-1]}"
