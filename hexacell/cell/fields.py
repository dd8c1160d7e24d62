"""Types that the sections of the cell file share, with each other and with the records of a run."""

from collections.abc import Callable
from datetime import date, datetime
from functools import partial
from typing import Annotated, Any, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    SecretStr,
    ValidationError,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from hexacell.addresses import require_host, require_serial_port
from hexacell.errors import UsageError
from hexacell.printable import printable
from hexacell.storage.toml_document import MASK

LARGEST_NUMBER = 1e6
"""Largest number in a cell file or a measurement file: a kilometre, eleven days."""

LARGEST_TIME_S = 1e11
"""Largest time of a record, from the year 1970 or any other moment."""

SMALLEST_NUMBER = 1e-9
"""Smallest number that must not be zero: a millionth of a nanometre."""

SHORTEST_DIRECTION = 1e-6
LARGEST_SEED = 2**32 - 1
LONGEST_TEXT = 1000
LONGEST_NAME = 64
SIGNS_OF_NAMES = " ._-+()#"


def key(default: object, meaning: str, **constraints: Any) -> Any:  # noqa: ANN401 - as pydantic's Field
    """A key of the cell file: its default (``...``: it is required), meaning and constraints."""
    return Field(default, description=meaning, **constraints)


def broken_rule(problem: str, action: str) -> PydanticCustomError:
    """The error that a validator raises: the problem and the next action."""
    return PydanticCustomError("broken_rule", "{problem}", {"problem": problem, "action": action})


def outside(expected: str) -> PydanticCustomError:
    """The error that a validator raises where a value is not as ``expected``."""
    return PydanticCustomError("out_of_range", "must be {expected}", {"expected": expected})


def _number_from(least: float) -> Any:  # noqa: ANN401 - as pydantic's Field
    return Field(allow_inf_nan=False, json_schema_extra={"minimum": least, "maximum": LARGEST_NUMBER})


def _in_range(value: float) -> float:
    if not abs(value) <= LARGEST_NUMBER:
        raise outside(f"a number within +-{LARGEST_NUMBER:g}")
    return value


def _positive(value: float) -> float:
    if not SMALLEST_NUMBER <= value <= LARGEST_NUMBER:
        raise outside(f"more than 0: from {SMALLEST_NUMBER:g} to {LARGEST_NUMBER:g}")
    return value


def _not_negative(value: float) -> float:
    if value and not SMALLEST_NUMBER <= value <= LARGEST_NUMBER:
        raise outside(f"0 or more: 0, or from {SMALLEST_NUMBER:g} to {LARGEST_NUMBER:g}")
    return value


def _printable(text: str) -> str:
    if not text.isprintable():
        raise outside("text without control characters")
    return text


def accepted(text: str, require: Callable[[str], object]) -> str:
    """A text, if ``require`` raises no ``UsageError`` for it; else the same as a broken rule."""
    try:
        require(text)
    except UsageError as error:
        raise broken_rule(error.problem, error.action or "Correct it") from error
    return text


def _a_password(secret: SecretStr) -> SecretStr:
    password = secret.get_secret_value()
    if len(password) > LONGEST_TEXT or not password.isprintable():
        raise outside(f"text of {LONGEST_TEXT} letters or fewer, without control characters")
    return secret


def _a_name(name: str) -> str:
    if (
        name != name.strip()
        or name.startswith(".")
        or not all(sign.isalnum() or sign in SIGNS_OF_NAMES for sign in name)
    ):
        raise outside(
            "a name of letters, digits, spaces and . _ - + ( ) #, no dot first, no space at its ends"
        )
    return name


def _a_day(value: object) -> date:
    if isinstance(value, date):
        return value
    try:
        return datetime.strptime(str(value), "%Y-%m-%d").date()  # noqa: DTZ007 - a day has no zone
    except ValueError as error:
        raise outside('a day, as "2027-03-31"') from error


def _a_direction(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if max(map(abs, vector)) < SHORTEST_DIRECTION:
        raise broken_rule("a vector of length zero is no direction", "Write where it points, as [1, 0, 0]")
    return vector


Finite = Annotated[float, Field(allow_inf_nan=False)]
InRange = Annotated[float, _number_from(-LARGEST_NUMBER), AfterValidator(_in_range)]
Positive = Annotated[float, _number_from(SMALLEST_NUMBER), AfterValidator(_positive)]
NotNegative = Annotated[float, _number_from(0.0), AfterValidator(_not_negative)]
Text = Annotated[str, Field(max_length=LONGEST_TEXT), AfterValidator(_printable)]
Shown = Annotated[
    str,
    BeforeValidator(
        lambda given: printable(given).replace("\n", r"\n") if isinstance(given, str) else given
    ),
]
"""What nobody chose to be text, such as the name of a file: accepted, and made printable."""

Host = Annotated[Text, AfterValidator(partial(accepted, require=require_host))]
SerialPortName = Annotated[Text, AfterValidator(partial(accepted, require=require_serial_port))]
Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME), AfterValidator(_a_name)]
Password = Annotated[
    SecretStr, AfterValidator(_a_password), PlainSerializer(lambda _: MASK, return_type=str)
]
"""Nothing that is printed or kept shows it."""
Day = Annotated[date, BeforeValidator(_a_day)]
Seed = Annotated[int, Field(ge=0, le=LARGEST_SEED)]
Point = tuple[Finite, Finite, Finite]
Item = TypeVar("Item")
OF_JOINTS = "one of each joint"
"""Marks what has as many items as the mechanism joints (:mod:`hexacell.cell.joint_count`)."""

Six = Annotated[tuple[Item, Item, Item, Item, Item, Item], OF_JOINTS]
"""One of each joint: six, or as many as the mechanism has."""
SixNumbers = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
"""A pose."""
JointNumbers = Annotated[tuple[Finite, ...], Field(min_length=4, max_length=6)]


def _for_each(given: object, count: int) -> object:
    if isinstance(given, int | float) and not isinstance(given, bool):
        return (_not_negative(float(given)),) * count
    return tuple(given) if isinstance(given, list) else given


SixAlike = Annotated[
    Six[NotNegative],
    BeforeValidator(partial(_for_each, count=6), json_schema_input_type=NotNegative | Six[NotNegative]),
]
"""A number of each joint, or one for all; a default that is one number needs ``validate_default``."""
PointInRange = tuple[InRange, InRange, InRange]
Direction = Annotated[PointInRange, AfterValidator(_a_direction)]
SixInRange = tuple[InRange, InRange, InRange, InRange, InRange, InRange]
"""A pose in a cell file."""


class Frozen(BaseModel):
    """A record that is kept in a file; no key is unknown, and NaN and infinity are numbers in JSON too."""

    # Each model is built when it is used first: a screen that starts needs few of them.
    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="constants", defer_build=True)


class Section(Frozen):
    """A section of the cell file.

    A key whose value is in the unit of the joint variables has that unit in its name, and the field has
    not: ``encoder`` is ``encoder_mm`` in a file, or ``encoder_deg`` (:mod:`hexacell.cell.by_mechanism`).
    """

    model_config = ConfigDict(serialize_by_alias=True)

    @classmethod
    def key(cls, field: str) -> str:
        """What a field is called in the file."""
        return cls.model_fields[field].alias or field

    @classmethod
    def field_of(cls, key: str) -> FieldInfo | None:
        """The field of a key in the file; None if the section has no such key."""
        return next((one for name, one in cls.model_fields.items() if cls.key(name) == key), None)


class GeometrySettings(Section):
    """One value a parameter of the mechanism, under the symbols of the kinds that the mechanism has."""


def first_mistake(refusal: ValidationError, whole: str) -> str:
    """Where the first mistake of a record is, and what it is; ``whole`` names the record itself."""
    first = refusal.errors(include_url=False, include_context=False)[0]
    where = ".".join(str(key) for key in first["loc"]) or whole
    return f"{where}: {first['msg']}"


GeometryDocument = dict[str, tuple[Finite | tuple[Finite, ...], ...]]
"""The values of a geometry under the symbols of its parameter kinds, as JSON files have them."""


class CertificateSettings(Section):
    """The certificate of an instrument, to which its readings are traceable."""

    number: Text = key(..., "number of the certificate, with who issued it", min_length=1)
    due: Day | None = key(
        None,
        'last day on which the certificate holds, as "2027-03-31"; afterwards a person must approve what '
        "rests on it",
    )
    expanded_um: float | None = key(
        None, "expanded uncertainty, k = 2, as certified, um", gt=0, le=1000, allow_inf_nan=False
    )

    def has_expired(self, day: date) -> bool:
        """Whether it holds no longer on a day."""
        return self.due is not None and day > self.due
