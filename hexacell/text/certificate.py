"""The calibration certificate of a run for programs: PTB's Digital Calibration Certificate, schema 3.3.0.

Sources: the schemas https://ptb.de/dcc/v3.3.0/dcc.xsd and https://ptb.de/si/v2.2.1/SI_Format.xsd.
"""

import re
from xml.etree.ElementTree import fromstring, indent, register_namespace, tostring

from markupsafe import Markup

from hexacell import __version__
from hexacell.errors import UsageError
from hexacell.printable import printable
from hexacell.services.history.reported_run import ReportedRun
from hexacell.text.parameters import rows_of_run
from hexacell.text.report.pages import rendered
from hexacell.text.report.report import instruments, temperature_ranges
from hexacell.text.report.statement import MODES, decision_rule, method_sentences, scope_sentences
from hexacell.text.verdict import VERDICT_MEANINGS
from hexacell.uncertainty.statement import COVERAGE, COVERAGE_FACTOR
from hexacell.verdict.decision import Verdict

TITLE = "Digital Calibration Certificate"

NEEDED = ("serial_number", "laboratory", "country", "customer", "authorised_by")
"""Keys of ``[report]`` without which there is no certificate."""

CONFORMITY = {
    Verdict.PASS: "pass",
    Verdict.CONDITIONAL_PASS: "conditionalPass",
    Verdict.CONDITIONAL_FAIL: "conditionalFail",
    Verdict.FAIL: "fail",
}
"""Verdicts as the schema has them; of one that is not evaluated nothing is stated."""

UNITS = {
    "mm": r"\milli\metre",
    "um": r"\micro\metre",
    "deg": r"\degree",
    "rad": r"\radian",
    "": r"\one",
    "deg C": r"\degreecelsius",
}
"""Units of the program, as D-SI writes them."""

# XML 1.0 allows no other characters, not even as escapes.
_NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

register_namespace("dcc", "https://ptb.de/dcc")
register_namespace("si", "https://ptb.de/si")


def certificate_of_run(run: ReportedRun) -> bytes:
    """The certificate as XML, unsigned; the same each time.

    Raises ``UsageError`` if nothing was found of the errors at the task poses, or the cell file left out
    who calibrates what for whom.
    """
    accuracy, stated = run.state.accuracy, run.settings.report
    if accuracy is None:
        raise UsageError(
            "the run has no result on the errors at the task poses, so that nothing can be certified",
            subject=run.name,
            action="Name a calibration or a check with a verdict; a report is made of any run",
        )
    absent = [key for key in NEEDED if not getattr(stated, key)]
    if absent:
        raise UsageError(
            f"a calibration certificate needs {', '.join(absent)}",
            subject=run.name,
            action="Write them in [report] of the cell file; runs that begin afterwards have them",
        )
    verdict = run.state.verdict or Verdict.NOT_EVALUATED
    program, _, program_version = run.started.software.partition(" ")
    text = rendered(
        "certificate.xml.j2",
        _in_one_line,
        run=run,
        stated=stated,
        accuracy=accuracy,
        identified=run.state.identified,
        verdict=verdict.value,
        meaning=VERDICT_MEANINGS[verdict],
        conformity=CONFORMITY.get(verdict),
        decision_rule=decision_rule(run),
        scope=scope_sentences(accuracy),
        mode=MODES[run.started.mode],
        method=method_sentences(run),
        version=_release(__version__),
        program=program,
        program_version=_release(program_version),
        instruments=instruments(run),
        temperatures=temperature_ranges(run),
        parameters=rows_of_run(run.state, run.settings),
        units=UNITS,
        coverage=COVERAGE,
        coverage_factor=COVERAGE_FACTOR,
    )
    root = fromstring(text)  # noqa: S314 - this program's own
    for element in root.iter():
        element.tail = None
        if len(element):
            element.text = None
    indent(root)
    made: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return made + b"\n"


def _release(version: str) -> str:
    """The numbers of a version, all that the schema's rules take."""
    numbers = re.match(r"\d{1,3}(\.\d{1,3}){0,3}", version)
    return numbers[0] if numbers else "0"


def _in_one_line(value: object) -> object:
    """A text in one line, as most types of the schema want it."""
    if isinstance(value, str) and not isinstance(value, Markup):
        return printable(" ".join(_NOT_IN_XML.sub("?", value).split()))
    return value
