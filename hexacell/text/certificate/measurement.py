"""The results with their uncertainty, and what they rest on: method, instruments, conditions."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np

from drivers.interfaces import DeviceIdentity
from hexacell.services.history.reported_run import ReportedRun
from hexacell.text.certificate.administration import add_software
from hexacell.text.certificate.elements import (
    DEGREE_CELSIUS,
    UNITS,
    add,
    add_identification,
    add_quantity,
    add_text,
)
from hexacell.text.report.provenance import (
    certificate_of,
    serial_number_of,
    temperature_ranges,
)
from hexacell.text.report.statement import MODES, method_sentences
from hexacell.uncertainty.statement import COVERAGE_FACTOR
from hexacell.verdict.verification import VerifiedAccuracy


def add_measurement_results(root: Element, run: ReportedRun, accuracy: VerifiedAccuracy) -> None:
    """The second ring of the certificate."""
    result = add(add(root, "measurementResults"), "measurementResult")
    add_text(result, "name", "Accuracy of the robot at the task poses")
    _add_method(result, run)
    name, _, version = run.started.software.partition(" ")
    add_software(add(result, "usedSoftware"), name, version)
    _add_instruments(result, run)
    _add_conditions(result, run)
    results = add(result, "results")
    _add_errors(results, run, accuracy)
    _add_parameters(results, run)


def _add_method(parent: Element, run: ReportedRun) -> None:
    method = add(add(parent, "usedMethods"), "usedMethod")
    add_text(method, "name", MODES[run.started.mode])
    add_text(method, "description", method_sentences(run))
    add(method, "norm", "JCGM 100:2008")
    add(method, "norm", "JCGM 101:2008")


def _add_instruments(parent: Element, run: ReportedRun) -> None:
    listed = add(parent, "measuringEquipments")
    for device in run.started.devices:
        _add_instrument(listed, run, device)


def _add_instrument(parent: Element, run: ReportedRun, device: DeviceIdentity) -> None:
    certificate, serial = certificate_of(run, device), serial_number_of(run, device)
    made = add(parent, "measuringEquipment")
    add_text(made, "name", device.name)
    due = None if certificate is None else certificate.due
    until = "" if due is None else f"; calibration due on {due.isoformat()}"
    add_text(made, "description", f"{device.description or device.protocol}{until}")
    if serial or certificate is not None:
        numbers = add(made, "identifications")
        if serial:
            add_identification(numbers, "manufacturer", serial, "serial number")
        if certificate is not None:
            add_identification(numbers, "other", certificate.number, "calibration certificate")
    if certificate is not None and certificate.expanded_um is not None:
        add_quantity(
            add(made, "measuringEquipmentQuantities"),
            "expanded uncertainty (k = 2) by its certificate",
            certificate.expanded_um,
            UNITS["um"],
            tag="measuringEquipmentQuantity",
        )


def _add_conditions(parent: Element, run: ReportedRun) -> None:
    conditions = add(parent, "influenceConditions")
    ranges = temperature_ranges(run)
    if not ranges:
        condition = add(conditions, "influenceCondition")
        add_text(condition, "name", "temperature")
        add_text(add(condition, "data"), "text", "not measured")
    for name, (lowest, highest) in ranges.items():
        condition = add(conditions, "influenceCondition")
        add_text(condition, "name", f"temperature, {name}")
        data = add(condition, "data")
        add_quantity(data, "lowest", lowest, DEGREE_CELSIUS)
        add_quantity(data, "highest", highest, DEGREE_CELSIUS)


def _add_errors(parent: Element, run: ReportedRun, accuracy: VerifiedAccuracy) -> None:
    result = add(parent, "result")
    add_text(result, "name", f"Largest errors at {accuracy.poses} task poses")
    data = add(result, "data")
    for name, unit, error in (
        ("position error", "mm", accuracy.position),
        ("orientation error", "deg", accuracy.orientation),
    ):
        add_quantity(data, name, error.value, UNITS[unit], error.expanded)
        add_quantity(data, f"limit of the {name}", error.limit, UNITS[unit])
    improvement = None if run.state.identified is None else run.state.identified.improvement
    if improvement is not None:
        add_quantity(data, "position error as found", improvement.now_mm, UNITS["mm"])


def _add_parameters(parent: Element, run: ReportedRun) -> None:
    rows = list(_parameters(run))
    if not rows:
        return
    result = add(parent, "result")
    has_identified = run.state.identified is not None
    add_text(result, "name", "Identified geometry" if has_identified else "Changes of the geometry")
    data = add(result, "data")
    for name, value, unit, expanded in rows:
        add_quantity(data, name, value, UNITS[unit], expanded)


def _parameters(run: ReportedRun) -> Iterator[tuple[str, float, str, float]]:
    """Name, value, unit and U of each parameter; of a check, of its change."""
    judged, identified = run.state.judged, run.state.identified
    if judged is not None and judged.check is not None:
        for one in judged.check.changes:
            yield one.name, one.change, one.unit, COVERAGE_FACTOR * one.sigma
    if identified is None:
        return
    parameters = run.settings.mechanism.parameters
    values = parameters.vector(identified.result.geometry)
    sigma = parameters.vector(identified.result.sigma)
    for row in np.flatnonzero(sigma > 0.0):
        parameter = parameters.parameters[row]
        yield parameter.name, values[row], parameter.kind.unit.value, COVERAGE_FACTOR * sigma[row]
