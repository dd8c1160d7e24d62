"""Who calibrated what, for whom and when, and the statement of conformity: the administrative data."""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element

from hexacell import __version__
from hexacell.errors import UsageError
from hexacell.services.history.reported_run import ReportedRun
from hexacell.text.certificate.elements import (
    LANGUAGE,
    add,
    add_contact,
    add_identification,
    add_text,
)
from hexacell.text.report.statement import MEANINGS, decision_rule, scope_sentences
from hexacell.verdict.decision import Verdict
from hexacell.verdict.verification import VerifiedAccuracy

NEEDED = ("serial_number", "laboratory", "country", "customer", "authorised_by")
"""Keys of ``[report]`` without which there is no certificate."""

CONFORMITY = {
    Verdict.PASS: "pass",
    Verdict.CONDITIONAL_PASS: "conditionalPass",
    Verdict.CONDITIONAL_FAIL: "conditionalFail",
    Verdict.FAIL: "fail",
}
"""Verdicts as the schema has them; of one that is not evaluated nothing is stated."""


def require_stated(run: ReportedRun) -> None:
    """Refuse a run whose cell file left out what a certificate must have; raises ``UsageError``."""
    absent = [key for key in NEEDED if not getattr(run.settings.report, key)]
    if absent:
        raise UsageError(
            f"a calibration certificate needs {', '.join(absent)}",
            subject=run.name,
            action="Write them in [report] of the cell file; runs that begin afterwards have them",
        )


def add_administrative_data(root: Element, run: ReportedRun, accuracy: VerifiedAccuracy) -> None:
    """The first ring of the certificate."""
    data = add(root, "administrativeData")
    stated = run.settings.report
    add_software(add(data, "dccSoftware"), "hexacell", __version__)
    _add_core_data(data, run)
    _add_item(data, run)
    add_contact(add(data, "calibrationLaboratory"), "contact", stated.laboratory, stated.country)
    person = add(add(data, "respPersons"), "respPerson")
    add_text(add(person, "person"), "name", stated.authorised_by)
    add(person, "mainSigner", "true")
    add_contact(data, "customer", stated.customer)
    _add_statements(data, run, accuracy)


def add_software(parent: Element, name: str, version: str) -> None:
    """A program with its version, which the schema's rules want after a letter."""
    made = add(parent, "software")
    add_text(made, "name", name)
    numbers = re.match(r"\d{1,3}(\.\d{1,3}){0,3}", version)
    add(made, "release", f"v{numbers[0] if numbers else 0}")


def _add_core_data(data: Element, run: ReportedRun) -> None:
    core = add(data, "coreData")
    add(core, "countryCodeISO3166_1", run.settings.report.country)
    add(core, "usedLangCodeISO639_1", LANGUAGE)
    add(core, "mandatoryLangCodeISO639_1", LANGUAGE)
    add(core, "uniqueIdentifier", run.identifier)
    add(core, "beginPerformanceDate", run.began.date().isoformat())
    add(core, "endPerformanceDate", run.ended.date().isoformat())
    add(core, "performanceLocation", "other" if run.settings.report.place else "laboratory")
    add(core, "issueDate", run.ended.date().isoformat())


def _add_item(data: Element, run: ReportedRun) -> None:
    stated = run.settings.report
    item = add(add(data, "items"), "item")
    add_text(item, "name", stated.machine or run.settings.robot.mechanism)
    if stated.place:
        add_text(item, "description", f"Stands at: {stated.place}")
    add_identification(add(item, "identifications"), "manufacturer", stated.serial_number, "serial number")


def _add_statements(data: Element, run: ReportedRun, accuracy: VerifiedAccuracy) -> None:
    verdict = run.state.judged.verdict if run.state.judged is not None else Verdict.NOT_EVALUATED
    statements = add(data, "statements")
    conformity = add(statements, "statement")
    add_text(conformity, "name", "Statement of conformity")
    add_text(conformity, "description", decision_rule(accuracy))
    add(conformity, "norm", "ILAC-G8:09/2019")
    add_text(conformity, "declaration", f"{verdict.value}: {MEANINGS[verdict]}")
    if verdict in CONFORMITY:
        add(conformity, "conformity", CONFORMITY[verdict])
    scope = add(statements, "statement")
    add_text(scope, "name", "Scope")
    add_text(scope, "declaration", scope_sentences(accuracy))
