"""Which terms beside the geometry records show: by evidence, at a stated error of the first kind.

The evidence of a model is the density of all records under it, with what is known beforehand of geometry
and terms integrated out. A term is taken where the ratio of the evidence with it and without it, the Bayes
factor, is at least m / ``ERROR_OF_FIRST_KIND`` with m terms offered: of a machine without any of them the
mean of that ratio is one, so that it is as large for one of them in at most that share of all cases
(Markov's inequality; Vovk & Wang, E-values, Annals of Statistics 49, 2021). Beside that each point's
records must be predicted better by those of all others with the term than without it.

Two terms that do the same to the records cannot be told apart: where exchanging them costs less than
``DISTINCT`` in the logarithm, neither is taken.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

from hexacell.identification.placement import RecordPlacement
from hexacell.identification.solver.linear_model import LinearCosts
from hexacell.identification.solver.result import Identification
from hexacell.identification.terms.taken import deformed, spread_of
from hexacell.identification.terms.term import Finding, ModelTerm, TermFinding

ERROR_OF_FIRST_KIND = 0.01
"""Probability that any term is taken of a machine that has none."""

SHARES = (1.0, 0.3, 0.1)
"""Sizes of a term as shares of the stated one, each equally probable beforehand."""

DISTINCT = log(20.0)
"""Logarithm of the Bayes factor from which two terms are told apart."""


@dataclass(frozen=True, slots=True, eq=False)
class ChosenTerms:
    """The terms taken, and what was found of each that was offered and that records can show."""

    taken: tuple[ModelTerm, ...] = ()
    findings: tuple[TermFinding, ...] = ()
    offered: tuple[ModelTerm, ...] = ()


def choose_terms(found: Identification) -> ChosenTerms:
    """Choose among the terms that the problem of an identification offers.

    One that acts by the direction of arrival takes part only where records know it, and it is not always
    the same: then what it does is another zero of the encoders.
    """
    problem = found.problem
    up, down = (problem.directions > 0.0).any(axis=0), (problem.directions < 0.0).any(axis=0)
    left = () if (up & down).any() else tuple(term for term in problem.offered if term.needs_directions)
    one_sided = left if (up | down).any() else ()
    findings = tuple(TermFinding(term.name, Finding.ONE_SIDE, 0.0) for term in one_sided)
    offered = tuple(term for term in problem.offered if term not in left)
    if not offered:
        return ChosenTerms(findings=findings)
    chosen = _Search.of(found, offered).chosen()
    return replace(chosen, findings=(*findings, *chosen.findings), offered=offered)


Model = tuple[ModelTerm, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """Stepwise selection among some terms.

    Attributes:
        without: the linear model of the records without terms.
        records: where they were taken, with the platform as the terms that the identification has bend it.
        offered: the terms, by their names.
        least: logarithm of the Bayes factor from which one is taken.
        scale: squared factor by which residuals exceed the noise with all terms.
    """

    without: LinearCosts
    records: RecordPlacement
    offered: Mapping[str, ModelTerm]
    least: float
    scale: float = 1.0

    @classmethod
    def of(cls, found: Identification, offered: Sequence[ModelTerm]) -> "_Search":
        without = LinearCosts.at(replace(found.problem, terms=None), found.prediction)
        least = log(len(offered) / ERROR_OF_FIRST_KIND)
        records = found.placement
        if found.terms is not None:
            records = deformed(found.terms.terms, records, found.terms.values)
        search = cls(without, records, {term.name: term for term in offered}, least)
        with_all = search._model(tuple(offered)).residual_test(found.active_prior)
        return replace(search, scale=with_all.noise_factor**2)

    def chosen(self) -> ChosenTerms:
        """Take the term of most evidence, then the best beside it, and so on."""
        taken: Model = ()
        findings = dict[str, TermFinding]()
        while left := self._beside(taken):
            beside = {name: self._gain(name, taken) for name in left}
            for name, (gain, _) in beside.items():
                findings[name] = TermFinding(name, Finding.NOT_SHOWN, gain)
            best = max(left, key=lambda name: beside[name][0])
            gain, term = beside[best]
            if gain < self.least:
                break
            predicted = self._predicted((*taken, term)) - self._predicted(taken)
            if predicted <= 0.0:
                findings[best] = TermFinding(best, Finding.NOT_PREDICTED, gain, predicted)
                break
            findings[best] = TermFinding(best, Finding.TAKEN, gain, predicted)
            taken = (*taken, term)
        for term in taken:
            if rival := self._rival(term, taken):
                taken, one = tuple(one for one in taken if one is not term), findings[term.name]
                told_by = dict.fromkeys(filter(None, (term.shown_by, self.offered[rival].shown_by)))
                findings[term.name] = replace(
                    one, finding=Finding.NOT_DISTINCT, rival=rival, told_by=", or ".join(told_by)
                )
        return ChosenTerms(taken, tuple(findings[name] for name in self.offered))

    def _gain(self, name: str, taken: Model) -> tuple[float, ModelTerm]:
        """Logarithm of the Bayes factor of a term beside others, and the term with its likeliest size."""
        term = self.offered[name]
        sizes = [replace(term, size=share * term.size) for share in SHARES]
        gains = np.array([self._evidence((*taken, one)) for one in sizes]) - self._evidence(taken)
        best = int(gains.argmax())
        mean = gains[best] + np.log(np.mean(np.exp(gains - gains[best])))
        return float(mean), sizes[best]

    def _rival(self, term: ModelTerm, taken: Model) -> str:
        """A term that in the place of a taken one explains the records nearly as well."""
        others = tuple(one for one in taken if one is not term)
        own, _ = self._gain(term.name, others)
        for name in self._beside(taken):
            instead, _ = self._gain(name, others)
            if instead >= self.least and own - instead < DISTINCT:
                return name
        return ""

    def _beside(self, taken: Model) -> list[str]:
        names = [term.name for term in taken]
        return [name for name in self.offered if name not in names]

    def _model(self, terms: Model) -> LinearCosts:
        each = (term.pose_errors(self.records, self.records.directions)[:, :3] for term in terms)
        by_coefficients = np.concatenate([np.empty((len(self.records), 3, 0)), *each], axis=-1)
        return self.without.with_causes(by_coefficients @ spread_of(terms))

    def _evidence(self, terms: Model) -> float:
        return self._model(terms).log_evidence(np.ones(len(self.records), dtype=bool), self.scale)

    def _predicted(self, terms: Model) -> float:
        """Sum of the logarithms of the densities of each point's records, given all others."""
        everything = self._evidence(terms)
        if self.without.problem.points < 2:
            return everything
        model, points = self._model(terms), self.without.problem.labels[:, 0]
        others = (model.log_evidence(points != point, self.scale) for point in np.unique(points))
        return float(sum(everything - one for one in others))
