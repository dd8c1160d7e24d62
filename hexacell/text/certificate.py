"""The calibration certificate of a run for programs: PTB's Digital Calibration Certificate, schema 3.3.0.

Sources: the schemas https://ptb.de/dcc/v3.3.0/dcc.xsd and https://ptb.de/si/v2.2.1/SI_Format.xsd.
"""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from drivers.interfaces import DeviceIdentity
from hexacell import __version__
from hexacell.errors import UsageError
from hexacell.services.history.reported_run import ReportedRun
from hexacell.services.history.run_summary import judged_accuracy
from hexacell.text.parameters import rows_of_run
from hexacell.text.report.report import certificate_of, serial_number_of, temperature_ranges
from hexacell.text.report.statement import MODES, decision_rule, method_sentences, scope_sentences
from hexacell.text.verdict import VERDICT_MEANINGS
from hexacell.uncertainty.statement import COVERAGE, COVERAGE_FACTOR
from hexacell.verdict.decision import Verdict, VerifiedAccuracy

TITLE = "Digital Calibration Certificate"
SCHEMA_VERSION = "3.3.0"

NEEDED = ("serial_number", "laboratory", "country", "customer", "authorised_by")
"""Keys of ``[report]`` without which there is no certificate."""

CONFORMITY = {
    Verdict.PASS: "pass",
    Verdict.CONDITIONAL_PASS: "conditionalPass",
    Verdict.CONDITIONAL_FAIL: "conditionalFail",
    Verdict.FAIL: "fail",
}
"""Verdicts as the schema has them; of one that is not evaluated nothing is stated."""

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
LANGUAGE = "en"
UNITS = {"mm": r"\milli\metre", "um": r"\micro\metre", "deg": r"\degree", "rad": r"\radian", "": r"\one"}
"""Units of the program, as D-SI writes them."""

DEGREE_CELSIUS = r"\degreecelsius"
DECIMALS = 6

# XML 1.0 allows no other characters, not even as escapes.
_NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

register_namespace("dcc", DCC)
register_namespace("si", SI)


def certificate_of_run(run: ReportedRun) -> bytes:
    """The certificate as XML, unsigned; the same each time.

    Raises:
        UsageError: nothing was found of the errors at the task poses, or the cell file left out who
            calibrates what for whom.
    """
    accuracy = judged_accuracy(run.state.judged)
    if accuracy is None:
        raise UsageError(
            "the run has no result on the errors at the task poses, so that nothing can be certified",
            subject=run.name,
            action="Name a calibration or a check with a verdict; a report is made of any run",
        )
    absent = [key for key in NEEDED if not getattr(run.settings.report, key)]
    if absent:
        raise UsageError(
            f"a calibration certificate needs {', '.join(absent)}",
            subject=run.name,
            action="Write them in [report] of the cell file; runs that begin afterwards have them",
        )
    root = Element(f"{{{DCC}}}digitalCalibrationCertificate", schemaVersion=SCHEMA_VERSION)
    _add_administrative_data(root, run, accuracy)
    _add_measurement_results(root, run, accuracy)
    indent(root)
    text: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _add_administrative_data(root: Element, run: ReportedRun, accuracy: VerifiedAccuracy) -> None:
    """The first ring of the certificate."""
    data = _add(root, "administrativeData")
    stated = run.settings.report
    _add_software(_add(data, "dccSoftware"), "hexacell", __version__)
    core = _add(data, "coreData")
    _add(core, "countryCodeISO3166_1", stated.country)
    _add(core, "usedLangCodeISO639_1", LANGUAGE)
    _add(core, "mandatoryLangCodeISO639_1", LANGUAGE)
    _add(core, "uniqueIdentifier", run.identifier)
    _add(core, "beginPerformanceDate", run.began.date().isoformat())
    _add(core, "endPerformanceDate", run.ended.date().isoformat())
    _add(core, "performanceLocation", "other" if stated.place else "laboratory")
    _add(core, "issueDate", run.ended.date().isoformat())
    item = _add(_add(data, "items"), "item")
    _add_text(item, "name", stated.machine or run.settings.robot.mechanism)
    if stated.place:
        _add_text(item, "description", f"Stands at: {stated.place}")
    numbers = _add(item, "identifications")
    _add_identification(numbers, "manufacturer", stated.serial_number, "serial number")
    _add_contact(_add(data, "calibrationLaboratory"), "contact", stated.laboratory, stated.country)
    person = _add(_add(data, "respPersons"), "respPerson")
    _add_text(_add(person, "person"), "name", stated.authorised_by)
    _add(person, "mainSigner", "true")
    _add_contact(data, "customer", stated.customer)
    _add_statements(data, run, accuracy)


def _add_software(parent: Element, name: str, version: str) -> None:
    """A program with its version, which the schema's rules want after a letter."""
    made = _add(parent, "software")
    _add_text(made, "name", name)
    numbers = re.match(r"\d{1,3}(\.\d{1,3}){0,3}", version)
    _add(made, "release", f"v{numbers[0] if numbers else 0}")


def _add_statements(data: Element, run: ReportedRun, accuracy: VerifiedAccuracy) -> None:
    verdict = run.state.judged.verdict if run.state.judged is not None else Verdict.NOT_EVALUATED
    statements = _add(data, "statements")
    conformity = _add(statements, "statement")
    _add_text(conformity, "name", "Statement of conformity")
    _add_text(conformity, "description", decision_rule(accuracy))
    _add(conformity, "norm", "ILAC-G8:09/2019")
    _add_text(conformity, "declaration", f"{verdict.value}: {VERDICT_MEANINGS[verdict]}")
    if verdict in CONFORMITY:
        _add(conformity, "conformity", CONFORMITY[verdict])
    scope = _add(statements, "statement")
    _add_text(scope, "name", "Scope")
    _add_text(scope, "declaration", scope_sentences(accuracy))


def _add_measurement_results(root: Element, run: ReportedRun, accuracy: VerifiedAccuracy) -> None:
    """The second ring of the certificate."""
    result = _add(_add(root, "measurementResults"), "measurementResult")
    _add_text(result, "name", "Accuracy of the robot at the task poses")
    method = _add(_add(result, "usedMethods"), "usedMethod")
    _add_text(method, "name", MODES[run.started.mode])
    _add_text(method, "description", method_sentences(run))
    _add(method, "norm", "JCGM 100:2008")
    _add(method, "norm", "JCGM 101:2008")
    name, _, version = run.started.software.partition(" ")
    _add_software(_add(result, "usedSoftware"), name, version)
    listed = _add(result, "measuringEquipments")
    for device in run.started.devices:
        _add_instrument(listed, run, device)
    _add_conditions(result, run)
    results = _add(result, "results")
    _add_errors(results, run, accuracy)
    _add_parameters(results, run)


def _add_instrument(parent: Element, run: ReportedRun, device: DeviceIdentity) -> None:
    certificate, serial = certificate_of(run, device), serial_number_of(run, device)
    made = _add(parent, "measuringEquipment")
    _add_text(made, "name", device.name)
    due = None if certificate is None else certificate.due
    until = "" if due is None else f"; calibration due on {due.isoformat()}"
    _add_text(made, "description", f"{device.description or device.protocol}{until}")
    if serial or certificate is not None:
        numbers = _add(made, "identifications")
        if serial:
            _add_identification(numbers, "manufacturer", serial, "serial number")
        if certificate is not None:
            _add_identification(numbers, "other", certificate.number, "calibration certificate")
    if certificate is not None and (expanded := certificate.expanded_um) is not None:
        listed = _add(made, "measuringEquipmentQuantities")
        name, tag = "expanded uncertainty (k = 2) by its certificate", "measuringEquipmentQuantity"
        _add_quantity(listed, name, expanded, UNITS["um"], tag=tag)


def _add_conditions(parent: Element, run: ReportedRun) -> None:
    conditions = _add(parent, "influenceConditions")
    ranges = temperature_ranges(run)
    if not ranges:
        condition = _add(conditions, "influenceCondition")
        _add_text(condition, "name", "temperature")
        _add_text(_add(condition, "data"), "text", "not measured")
    for name, (lowest, highest) in ranges.items():
        condition = _add(conditions, "influenceCondition")
        _add_text(condition, "name", f"temperature, {name}")
        data = _add(condition, "data")
        _add_quantity(data, "lowest", lowest, DEGREE_CELSIUS)
        _add_quantity(data, "highest", highest, DEGREE_CELSIUS)


def _add_errors(parent: Element, run: ReportedRun, accuracy: VerifiedAccuracy) -> None:
    result = _add(parent, "result")
    _add_text(result, "name", f"Largest errors at {accuracy.poses} task poses")
    data = _add(result, "data")
    for name, unit, error in accuracy.errors:
        _add_quantity(data, f"{name} error", error.value, UNITS[unit], error.expanded)
        _add_quantity(data, f"limit of the {name} error", error.limit, UNITS[unit])
    improvement = None if run.state.identified is None else run.state.identified.improvement
    if improvement is not None:
        _add_quantity(data, "position error as found", improvement.now_mm, UNITS["mm"])


def _add_parameters(parent: Element, run: ReportedRun) -> None:
    rows = rows_of_run(run.state, run.settings)
    if not rows:
        return
    result = _add(parent, "result")
    has_identified = run.state.identified is not None
    _add_text(result, "name", "Identified geometry" if has_identified else "Changes of the geometry")
    data = _add(result, "data")
    for one in rows:
        value = one.change if one.new is None else one.new
        _add_quantity(data, one.name, value, UNITS[one.unit], one.expanded)


def _add(parent: Element, name: str, text: str | None = None) -> Element:
    """A new child; its text in one line, as most types of the schema want it."""
    made = SubElement(parent, f"{{{DCC}}}{name}")
    if text is not None:
        made.text = " ".join(_NOT_IN_XML.sub("?", text).split())
    return made


def _add_text(parent: Element, name: str, text: str) -> Element:
    """A child that holds text for people."""
    made = _add(parent, name)
    _add(made, "content", text).set("lang", LANGUAGE)
    return made


def _add_identification(parent: Element, issuer: str, value: str, name: str) -> None:
    """A number of an item or instrument, by whom it was given, and what it is."""
    made = _add(parent, "identification")
    _add(made, "issuer", issuer)
    _add(made, "value", value)
    _add_text(made, "name", name)


def _add_contact(parent: Element, name: str, text: str, country: str | None = None) -> None:
    """A name with its address, which is one text in the cell file."""
    made = _add(parent, name)
    _add_text(made, "name", text)
    location = _add(made, "location")
    if country is not None:
        _add(location, "countryCode", country)
    _add_text(location, "further", text)


def _add_quantity(
    parent: Element,
    name: str,
    value: float,
    unit: str,
    expanded: float | None = None,
    tag: str = "quantity",
) -> None:
    """A value with its unit in D-SI and, if there is one, its expanded uncertainty."""
    made = _add(parent, tag)
    _add_text(made, "name", name)
    real = SubElement(made, f"{{{SI}}}real")
    _add_si(real, "value", f"{value:.{DECIMALS}f}")
    _add_si(real, "unit", unit)
    if expanded is None:
        return
    uncertainty = _add_si(_add_si(real, "measurementUncertaintyUnivariate"), "expandedMU")
    _add_si(uncertainty, "valueExpandedMU", f"{expanded:.{DECIMALS}f}")
    _add_si(uncertainty, "coverageFactor", f"{COVERAGE_FACTOR:.1f}")
    _add_si(uncertainty, "coverageProbability", f"{COVERAGE:g}")


def _add_si(parent: Element, name: str, text: str | None = None) -> Element:
    made = SubElement(parent, f"{{{SI}}}{name}")
    made.text = text
    return made
