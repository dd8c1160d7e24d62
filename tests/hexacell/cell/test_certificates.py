"""Certificates of instruments, and what a report says of the machine, in the cell file."""

from datetime import date

import pytest

from hexacell.errors import FileError


@pytest.fixture
def load_due(load_changed):
    """A cell with a certificate of gauge x that holds until a day, and a machine named for reports."""
    gauge = 'name = "x"\naxis = "x"\n'
    report = '[report]\nmachine = "Hexaglide HX 3"\nserial_number = "0017"\n'

    def load(due: str):
        certificate = f'serial_number = "4711"\ncertificate = {{number = "D-K 17", due = {due}}}\n'
        return load_changed((gauge, gauge + certificate), ("[simulation]", f"{report}[simulation]"))

    return load


def test_a_certificate_holds_until_the_day_that_is_stated(load_due) -> None:
    settings = load_due('"2027-03-31"').settings
    assert settings.certificates["gauge x"].number == "D-K 17"
    assert settings.expired_on(date(2027, 3, 31)) == ()
    assert settings.expired_on(date(2027, 4, 1)) == ("gauge x",)
    assert (settings.report.machine, settings.report.serial_number) == ("Hexaglide HX 3", "0017")


@pytest.mark.parametrize("due", ['"2027-02-30"', '"soon"', '""', '"31.3.2027"', "20270331", "true"])
def test_what_is_no_day_is_refused_with_its_line(load_due, due) -> None:
    with pytest.raises(FileError, match="day") as refusal:
        load_due(due)
    assert refusal.value.line is not None
