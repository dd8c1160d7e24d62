"""The Digital Calibration Certificate of one run: XML by PTB's schema 3.3.0, from its folder alone."""

from __future__ import annotations

from xml.etree.ElementTree import Element, indent, tostring

from hexacell.errors import UsageError
from hexacell.services.history.history import judged_accuracy
from hexacell.services.history.reported_run import ReportedRun
from hexacell.text.certificate.administration import (
    add_administrative_data,
    require_stated,
)
from hexacell.text.certificate.elements import DCC
from hexacell.text.certificate.measurement import add_measurement_results

TITLE = "Digital Calibration Certificate"
SCHEMA_VERSION = "3.3.0"


def certificate_of_run(run: ReportedRun) -> bytes:
    """The certificate as XML, unsigned; the same each time.

    Raises:
        UsageError: nothing was found of the errors at the task poses, or the cell file left out who
            calibrates what for whom.
    """
    accuracy = judged_accuracy(run.state.judged)
    if accuracy is None:
        raise UsageError(
            "the run says nothing of the errors at the task poses, so that nothing can be certified",
            subject=run.name,
            action="Name a calibration or a check with a verdict; a report is made of any run",
        )
    require_stated(run)
    root = Element(f"{{{DCC}}}digitalCalibrationCertificate", schemaVersion=SCHEMA_VERSION)
    add_administrative_data(root, run, accuracy)
    add_measurement_results(root, run, accuracy)
    indent(root)
    text: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
