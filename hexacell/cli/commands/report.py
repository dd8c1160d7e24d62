"""``hexacell report``: a run as a page that can be filed."""

import argparse
from pathlib import Path

from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.history.reported_run import ReportedRun, reported_run
from hexacell.storage.atomic_files import write_atomically
from hexacell.text import certificate
from hexacell.text.report.pages import Report, html_of, pdf_of
from hexacell.text.report.report import report_of

CERTIFICATE = ".xml"
"""How the name of a file ends that is to be one."""

KINDS = (".html", ".htm", ".pdf", CERTIFICATE)


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Write the report; the run folder is only read, unless the report goes into it."""
    target = options.output or options.run / "report.html"
    _require_possible(target, is_comparison=options.compare is not None)
    earlier = None if options.compare is None else reported_run(options.compare)
    run = reported_run(options.run)
    report = report_of(run, earlier)
    write_atomically(target, _written(target.suffix, run, report))
    console.document({"report": str(target), "identifier": report.identifier, "verdict": report.verdict})
    title = certificate.TITLE if target.suffix == CERTIFICATE else report.title.lower()
    console.print(f"{target}: {title}, {report.verdict}")
    return ExitCode.DONE


def _require_possible(target: Path, *, is_comparison: bool) -> None:
    if target.suffix not in KINDS:
        action = "Name one that ends in .html, .pdf or .xml"
        raise UsageError("reports of this kind are not made", subject=target, action=action)
    if is_comparison and target.suffix == CERTIFICATE:
        raise UsageError(
            "a certificate compares nothing",
            action="Leave --compare away, or name a file that ends in .pdf",
        )


def _written(suffix: str, run: ReportedRun, report: Report) -> bytes:
    match suffix:
        case ".pdf":
            return pdf_of(report)
        case ".xml":
            return certificate.certificate_of_run(run)
        case _:
            return html_of(report).encode()
