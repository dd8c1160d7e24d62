"""What a report says of the machine, of who calibrated it, and of the instruments' own calibration."""

from __future__ import annotations

from datetime import date

from pydantic import Field

from hexacell.cell.fields import Day, Section, Text


class CertificateSettings(Section):
    """The certificate of an instrument, to which its readings are traceable."""

    number: Text = Field(min_length=1, description="of the certificate, with who issued it")
    due: Day | None = Field(
        None, description='day, as "2027-03-31", after which a person must approve what rests on it'
    )
    expanded_um: float | None = Field(
        None, gt=0, le=1000, allow_inf_nan=False, description="expanded uncertainty, k = 2, as certified"
    )

    def has_expired(self, day: date) -> bool:
        """Whether it holds no longer on a day."""
        return self.due is not None and day > self.due


class ReportSettings(Section):
    """What a report of a run says beside what was measured; all of it may be left out."""

    machine: Text = Field("", description="maker and model of the robot")
    serial_number: Text = Field("", description="of the robot")
    laboratory: Text = Field("", description="who calibrates, with the address")
    country: Text = Field(
        "", pattern="^([A-Z]{2})?$", description="of the laboratory, ISO 3166: two letters, as DE"
    )
    customer: Text = Field("", description="for whom, with the address")
    place: Text = Field("", description="where the robot stands")
    authorised_by: Text = Field("", description="who answers for reports of this cell")
