"""The report of one run, put together; its last chapters: conditions, instruments, files, who answers."""

from collections.abc import Iterator
from dataclasses import dataclass

from drivers.interfaces import DeviceIdentity
from hexacell.cell.fields import CertificateSettings
from hexacell.errors import ReachError
from hexacell.lengths import MM
from hexacell.services.history.reported_run import ReportedRun
from hexacell.services.robot_view import view_of_run
from hexacell.text.measured_noise import measured_noise_sentences, reversal_sentence, worsening_sentence
from hexacell.text.report import results, statement
from hexacell.text.report.pages import Chapter, Facts, Paragraph, Picture, Report, Table, Tone
from hexacell.text.report.statement import NOT_STATED
from hexacell.text.robot import robot_picture
from hexacell.text.time_spent import spent_sentence
from procedures.run.readings import temperatures_shown

TITLES = {
    "optimise": "Calibration report",
    "quick": "Calibration report (quick level)",
    "check": "Report of a check",
    "length": "Report of a length check",
}


def report_of(run: ReportedRun, earlier: ReportedRun | None = None) -> Report:
    """The report of a run, the verdict first; with what has changed since an ``earlier`` run, if named.

    Raises:
        UsageError: the two cannot be compared.
    """
    verdict = run.state.verdict
    numbers = [
        (one.device.name.partition(" (")[0], one.serial_number or NOT_STATED) for one in instruments(run)
    ]
    chapters = (
        statement.statement_chapter(run),
        statement.method_chapter(run),
        results.uncertainty_chapter(run),
        results.parameter_chapter(run),
        results.terms_chapter(run),
        None if earlier is None else results.comparison_chapter(earlier, run),
        results.observability_chapter(run),
        conditions_chapter(run),
        traceability_chapter(run),
        integrity_chapter(run),
        authorisation_chapter(run),
    )
    return Report(
        title=TITLES[run.started.mode],
        identifier=run.identifier,
        issued=run.ended.date(),
        verdict=statement.NO_VERDICT if verdict is None else verdict.value.upper(),
        tone=Tone.OPEN if verdict is None else statement.TONES.get(verdict, Tone.OPEN),
        meaning=statement.meaning_of(run),
        cards=statement.cards_of(run),
        summary=statement.summary_of(run, "; ".join(map(": ".join, numbers))),
        chapters=tuple(chapter for chapter in chapters if chapter is not None),
        is_simulated=run.settings.simulation is not None,
        robot=_robot(run),
    )


def _robot(run: ReportedRun) -> Picture | None:
    """The robot with what was measured; None where its geometry reaches none of its poses."""
    try:
        return Picture(*robot_picture(view_of_run(run)))
    except ReachError:
        return None


def conditions_chapter(run: ReportedRun) -> Chapter:
    """Temperatures, records and noise."""
    state = run.state
    pairs = [("Records", str(sum(len(measured.samples) for measured in state.sets.values())))]
    pairs.append(("Time", spent_sentence(run.spent, run.settings, run.started.mode)))
    pairs += [
        (f"Temperature, {name}", f"{lowest:.1f} to {highest:.1f} deg C")
        for name, (lowest, highest) in temperature_ranges(run).items()
    ]
    if not temperature_ranges(run):
        pairs.append(("Temperature", "not measured"))
    pairs += [("Sets measured again", str(state.invalidated))] if state.invalidated else []
    noise = () if state.noise is None else measured_noise_sentences(state.noise.noise)
    if (found := state.identified) is not None:
        worse = "" if found.worsening is None else worsening_sentence(found.worsening)
        reversal = "" if found.reversal is None else reversal_sentence(found.reversal)
        noise += tuple(f"{one[:1].upper()}{one[1:]}." for one in (worse, reversal) if one)
    columns = ("Set of records", "records", "largest deviation, mm", "drift of the gauges, mm")
    # The sets whose reference was read again, with how far the gauges had drifted by then.
    rows = tuple(
        (
            key.name,
            str(len(measured.samples)),
            MM.number(max(abs(value) for one in measured.samples for value in one.deviation_mm)),
            MM.number(max(map(abs, measured.drift_mm))),
        )
        for key, measured in state.sets.items()
        if measured.drift_mm is not None and measured.samples
    )
    tables = (Table(columns, rows),) if rows else ()
    return Chapter("Conditions", (Facts(tuple(pairs)), *map(Paragraph, noise), *tables))


def traceability_chapter(run: ReportedRun) -> Chapter:
    """Every instrument with its serial number and certificate."""
    day, rows = run.began.date(), []
    for one in instruments(run):
        number, due = NOT_STATED, ""
        if (stated := one.certificate) is not None:
            number = stated.number
            number += "" if stated.expanded_um is None else f" (U {stated.expanded_um:g} um)"
            due = f"{stated.due or ''}{': EXPIRED' if stated.has_expired(day) else ''}"
        rows.append((one.device.name, one.device.description, one.serial_number or NOT_STATED, number, due))
    expired = ", ".join(run.settings.expired_on(day))
    note = (Paragraph(f"Expired on the day of the run: {expired}.", is_strong=True),) if expired else ()
    table = Table(("Instrument", "kind", "serial number", "certificate", "due"), tuple(rows), 5)
    return Chapter("Instruments and traceability", (table, *note))


def integrity_chapter(run: ReportedRun) -> Chapter:
    """The fingerprints of the files that everything above can be derived from."""
    text = (
        "Everything in this report can be derived again from these files of the run folder; "
        "`hexacell replay` repeats its decisions and results."
    )
    rows = tuple(sorted(run.fingerprints.items()))
    return Chapter("Files", (Paragraph(text), Table(("File", "SHA-256"), rows, 2)))


def authorisation_chapter(run: ReportedRun) -> Chapter:
    """Who answers for it."""
    named = run.settings.report.authorised_by or "not stated in the cell file"
    pairs = (("Authorised by", named), ("Date and signature", "_" * 40))
    text = (
        "This report may be copied as a whole only. Its results are of this robot alone, as it was when it "
        "was measured."
    )
    return Chapter("Authorisation", (Facts(pairs), Paragraph(text)))


def temperature_ranges(run: ReportedRun) -> dict[str, tuple[float, float]]:
    """The lowest and highest temperature that each thermometer showed with the records, deg C."""
    samples = (sample for measured in run.state.sets.values() for sample in measured.samples)
    shown = temperatures_shown(sample.reading for sample in samples)
    return {name: (min(values), max(values)) for name, values in shown.items()}


@dataclass(frozen=True, slots=True)
class Instrument:
    """An instrument of a run, and its certificate, if it has one."""

    device: DeviceIdentity
    serial_number: str
    certificate: CertificateSettings | None


def instruments(run: ReportedRun) -> Iterator[Instrument]:
    """The instruments: a gauge has a certificate of its own, the encoders have one together.

    A serial number is the one that the instrument reports, or else that of the cell file.
    """
    for device in run.started.devices:
        is_encoder = device.name.startswith("encoder")
        found = run.settings.certificates.get("encoders" if is_encoder else f"gauge {device.name}")
        stated = (gauge.serial_number for gauge in run.settings.gauges if gauge.name == device.name)
        serial_number = device.serial_number or next(stated, "")
        yield Instrument(device, serial_number, found)
