"""Sections of what records hardly show: sizes of effects, the length check, terms beside the geometry."""

from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, Literal, Self, get_args

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from hexacell.cell.fields import (
    CertificateSettings,
    Direction,
    InRange,
    NotNegative,
    PointInRange,
    Positive,
    Section,
    Text,
    accepted,
    broken_rule,
    key,
)
from hexacell.kinematics.parameters import JointUnit
from hexacell.plugins import Group, load
from hexacell.printable import printable

MicrometresPerMetreKelvin = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]
COARSEST_SHARE = 1e-3
"""Largest expanded uncertainty of the distance, over it: beyond, the certificate is in another unit."""

Grade = Literal["precision", "ordinary", "ideal"]

SIZES_OF_GRADES: Mapping[Grade, Mapping[str, float]] = {
    "precision": {},
    "ordinary": {
        "common_encoder_scale_um_m": 30.0,
        "encoder_scale_um_m": 20.0,
        "rail_direction_mrad": 0.05,
        "rail_wave_short_um": 5.0,
        "rail_wave_long_um": 10.0,
        "rail_sag_um": 20.0,
        "encoder_eccentricity_mdeg": 10.0,
    },
    "ideal": dict.fromkeys(
        (
            *("common_encoder_scale_um_m", "encoder_scale_um_m", "encoder_eccentricity_mdeg"),
            *("stop_repeatability_mdeg", "rail_direction_mrad", "rail_wave_short_um", "rail_wave_long_um"),
            *("rail_sag_um", "stop_repeatability_um", "ball_roundness_um", "temperature_at_work_k"),
            *("temperature_measuring_k", "thermometers_k", "expansion_percent", "load_n"),
        ),
        0.0,
    ),
}
"""Where the sizes of a grade differ from the defaults of the keys, which are those of ``precision``."""


STOPS = "noise.stops"
"""The size of this section's effects that stands in another: where joints stop beside their commands."""


def repeatability_key(unit: JointUnit) -> str:
    """The key of where a joint stops beside what its encoder shows."""
    return f"stop_repeatability_{unit.thousandth}"


class CommonUncertaintySettings(Section):
    """Sizes of systematic effects, one standard deviation; certificates and own measurements say better."""

    grade: Grade = key(
        "precision",
        "what sizes that are not given are for; precision: glass scales and precision guides; ordinary: "
        "magnetic scales and ordinary guides; ideal: no effects, as in a simulation",
    )
    stop_repeatability_acts: Literal["everywhere", "at work"] = key(
        "everywhere",
        "when a joint's stop scatters: everywhere, or at work alone, where the noise of the records "
        "contains it already",
    )
    ball_roundness_um: NotNegative = key(2.0, "largest departure of the ball from its mean radius, um")
    ball_beside_tool_mm: NotNegative = key(
        0.0, "distance of the ball's centre from that of the tool along each platform axis, mm"
    )
    temperature_at_work_k: NotNegative = key(
        1.0, "difference of the temperature between work and measuring, K"
    )
    temperature_measuring_k: NotNegative = key(
        1.0,
        "change of the temperature while measuring, K; a run with thermometers takes their range instead",
    )
    thermometers_k: NotNegative = key(
        0.3, "uncertainty of the temperatures of legs by their thermometers, K; DS18B20: +-0.5 at most"
    )
    expansion_base_um_m_k: NotNegative = key(
        23.0, "thermal expansion of the base with its scales, um/m/K: aluminium 23, steel 11.5, granite 6"
    )
    expansion_platform_um_m_k: NotNegative = key(23.0, "thermal expansion of the platform, um/m/K")
    expansion_legs_um_m_k: NotNegative = key(
        23.0, "thermal expansion of the legs, um/m/K; taken out of the records where they have thermometers"
    )
    expansion_percent: NotNegative = key(10.0, "uncertainty of these, %")
    load_n: NotNegative = key(20.0, "force on the tool at work in each direction, N")
    leg_compliance_um_n: NotNegative = key(0.03, "compliance of a leg with its joints, um/N")
    own_weight_n: NotNegative = key(
        0.0,
        "weight of the platform with what it carries while measuring, N; 0: its legs hardly yield to it",
    )
    own_weight_centre_mm: PointInRange | None = key(
        None, "its centre in the platform frame of the drawing, mm; by default the middle of the joints"
    )
    own_weight_direction: Direction = key((0.0, 0.0, -1.0), "where it pulls, in the base frame")
    sources: dict[str, Text] = key({}, "where a size comes from, by its key")

    @field_validator("own_weight_centre_mm", "own_weight_direction", mode="before")
    @classmethod
    def _a_list_is_a_vector(cls, given: object) -> object:
        return tuple(given) if isinstance(given, list) else given

    @model_validator(mode="before")
    @classmethod
    def _sizes_of_the_grade(cls, given: Any) -> Any:  # noqa: ANN401 - what pydantic hands on
        """Sizes that are not given are those of the grade."""
        if not isinstance(given, dict):
            return given
        grade = given.get("grade", "precision")
        of_grade = SIZES_OF_GRADES[grade] if grade in get_args(Grade) else {}
        sizes = {key: size for key, size in of_grade.items() if key in cls.model_fields}
        return {**sizes, **given}

    @model_validator(mode="after")
    def _sources_belong_to_sizes(self) -> Self:
        no_sizes = {"grade", "sources", "stop_repeatability_acts", "own_weight_centre_mm"}
        known = {*type(self).model_fields, STOPS} - {*no_sizes, "own_weight_direction"}
        if unknown := sorted(set(self.sources) - known):
            raise broken_rule(
                f"sources has {unknown[0]}, which is no size of this section", "Correct the key"
            )
        return self

    @property
    def common_scale_um_m(self) -> float:
        """Size of a scale error common to all encoders, um/m; 0 for encoders of angles."""
        return 0.0

    def source(self, key: str) -> str:
        """Where a size comes from."""
        assumed = SIZES_OF_GRADES[self.grade].get(key, type(self).model_fields[key].default)
        stated = "cell file" if getattr(self, key) != assumed else f"assumed: {self.grade}"
        return self.sources.get(key, stated)


class LinearUncertaintySettings(CommonUncertaintySettings):
    """Sizes of the effects of a machine whose joint variables are lengths."""

    common_encoder_scale_um_m: NotNegative = key(15.0, "scale error that all encoders have alike, um/m")
    encoder_scale_um_m: NotNegative = key(10.0, "scale error of each encoder, um/m")
    stop_repeatability_um: NotNegative = key(
        2.0, "distance of a joint's stop from where its encoder shows it, um"
    )

    @property
    def common_scale_um_m(self) -> float:
        """Size of a scale error common to all encoders, um/m."""
        return self.common_encoder_scale_um_m


class RotaryUncertaintySettings(CommonUncertaintySettings):
    """Sizes of the effects of a machine whose joints turn: a full circle has no error of scale."""

    encoder_eccentricity_mdeg: NotNegative = key(
        2.0, "amplitude of each encoder's error over a turn, as its disc is off centre, mdeg"
    )
    stop_repeatability_mdeg: NotNegative = key(
        1.0, "distance of a joint's stop from where its encoder shows it, mdeg"
    )


class UncertaintySettings(LinearUncertaintySettings):
    """Sizes of the effects of a machine whose joints move along rails."""

    rail_direction_mrad: NotNegative = key(
        0.02, "angle of each rail from parallel, horizontally and vertically, mrad"
    )
    rail_wave_short_um: NotNegative = key(3.0, "amplitude of a short wave of each rail, um")
    rail_wave_short_mm: Positive = key(600.0, "length of the short wave, mm")
    rail_wave_long_um: NotNegative = key(5.0, "amplitude of a long wave of each rail, um")
    rail_wave_long_mm: Positive = key(1500.0, "length of the long wave, mm")
    rail_sag_um: NotNegative = key(
        10.0, "depth to which all rails sag alike over the range of the joints, um"
    )


class LengthCheckSettings(Section):
    """A fixture with two parallel seats for the gauges, a certified distance apart."""

    first_seat: PointInRange = key(..., "position of the ball in the first seat, mm, in the base frame")
    direction: Direction = key(
        (1.0, 0.0, 0.0),
        "direction from the first seat to the second; a way on which all joints move alike is best",
    )
    distance_mm: float = key(..., "certified distance of the two places of the ball, mm", ge=20, le=5000)
    uncertainty_mm: Positive = key(..., "certified expanded uncertainty (k = 2) of that distance, mm")
    certificate: CertificateSettings | None = key(None, "certificate of that distance")
    parallel_mrad: NotNegative = key(0.1, "angle between the seats about each axis, mrad, 1 sigma", le=20)
    height_mm: NotNegative = key(
        50.0, "height of the ball above the line along which the distance is certified, mm; 0: at the ball"
    )
    seating_um: NotNegative = key(
        5.0, "scatter of the gauges in a seat, from one mounting to the next, um, 1 sigma", le=1000
    )
    certified_at_c: InRange = key(20.0, "temperature for which the certificate holds, deg C")
    temperature_c: InRange = key(20.0, "temperature of the fixture, deg C, where no thermometer shows it")
    thermometer: Text | None = key(None, "name of the thermometer on the fixture")
    temperature_sigma_k: NotNegative = key(1.0, "uncertainty of that temperature, K, 1 sigma", le=50)
    expansion_um_m_k: MicrometresPerMetreKelvin = key(
        11.5, "thermal expansion of the fixture, um/m/K: steel 11.5, aluminium 23, Invar 1.5"
    )
    repeats: int = key(1, "how often the second seat is measured", ge=1, le=20)
    orientations: int = key(
        5, "orientations of the platform with the ball in the middle of a seat", ge=1, le=25
    )
    tilt_deg: Positive = key(10.0, "tilt of all orientations but the first, which is level, deg", le=45)
    mounting: Literal["by-hand", "fixed"] = key(
        "by-hand", "how the gauges come into the seats: by-hand, or fixed where no person is needed"
    )

    @property
    def second_seat(self) -> tuple[float, float, float]:
        """Where the ball is measured in the second seat, mm, in the base."""
        first, towards = np.array(self.first_seat), np.array(self.direction)
        x, y, z = (first + self.distance_mm * towards / np.linalg.norm(towards)).tolist()
        return x, y, z

    @property
    def mountings(self) -> int:
        """How often the gauges are mounted: in the first seat before and after each time in the second."""
        return 2 * self.repeats + 1

    @model_validator(mode="after")
    def _the_certificate_is_better_than_a_ruler(self) -> Self:
        largest = COARSEST_SHARE * self.distance_mm
        if self.uncertainty_mm > largest:
            raise broken_rule(
                f"uncertainty_mm is {self.uncertainty_mm:g}, more than {largest:g} (0.1 % of distance_mm)",
                "Write the expanded uncertainty of the certificate, in mm",
            )
        return self


TermName = Annotated[Text, AfterValidator(partial(accepted, require=partial(load, Group.TERMS)))]
BUNDLED_TERMS = ("backlash", "play", "compliance")
"""Those looked for by default, whose sizes have keys of their own."""

MOST_TERMS = 10


class ModelSettings(Section):
    """Terms of the model beside the geometry, which are taken where the records show them."""

    terms: tuple[TermName, ...] = key(
        BUNDLED_TERMS,
        "terms that records are searched for, those that plug-ins add too; compliance with "
        "uncertainty.own_weight_n only; [] for none",
        max_length=MOST_TERMS,
    )
    temperature_c: InRange | None = key(
        None,
        "temperature at which the geometry is sought, where legs have thermometers, deg C; by default that "
        "of each at the first record of the first point",
        ge=-100,
        le=300,
    )
    backlash: Positive = key(
        0.1, "what the backlash of a joint may be, 1 sigma before measuring", alias="backlash_mm"
    )
    play_mm: Positive = key(0.1, "what the play of a leg may be, mm, 1 sigma before measuring")
    compliance_um_n: Positive = key(
        0.3, "what the compliance of a leg may be, um/N, 1 sigma before measuring"
    )
    sizes: dict[str, Positive] = key(
        {}, "what coefficients of the terms of plug-ins may be, 1 sigma before measuring, by their names"
    )

    @property
    def all_sizes(self) -> dict[str, float]:
        """The sizes of all terms, by their fields; those of plug-ins by their names."""
        own = {"backlash": self.backlash, "play_mm": self.play_mm, "compliance_um_n": self.compliance_um_n}
        return own | self.sizes

    @model_validator(mode="after")
    def _sizes_belong_to_terms(self) -> Self:
        for name in self.sizes:
            if name in BUNDLED_TERMS or name not in self.terms:
                raise broken_rule(
                    f"sizes has {printable(name)}, which is no term of a plug-in that is looked for",
                    "Correct the name, or add it to terms; backlash, play and compliance have own keys",
                )
        return self
