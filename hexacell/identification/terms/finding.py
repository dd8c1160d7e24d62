"""What records say of a term that was offered."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np


class Finding(StrEnum):
    """What the records say of a term."""

    TAKEN = "taken"
    KNOWN = "known from an earlier result"
    NOT_SHOWN = "not shown"
    NOT_PREDICTED = "does not predict the records of other points better"
    FAULTS = "faults of records explain them better"
    ONE_SIDE = "is the same at every stop, as all were reached from one side"
    NOT_DISTINCT = "cannot be told apart from another"


@dataclass(frozen=True, slots=True)
class TermFinding:
    """A term that was tried.

    Attributes:
        log_factor: logarithm of the Bayes factor, beside the terms that were taken before it.
        predicted: by how much the logarithm of the density of points' records, predicted from all other
            points, is higher with it; NaN where that was not asked.
        rival: the term that it cannot be told from.
        told_by: the records that would tell, in words.
    """

    name: str
    finding: Finding
    log_factor: float
    predicted: float = np.nan
    rival: str = ""
    told_by: str = ""
