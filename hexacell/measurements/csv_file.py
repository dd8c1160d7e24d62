"""Measurements as a CSV file.

One row per record, with the header ``point,orientation,x,y,z,a,b,c,q1,...,q6,dx,dy,dz``: the pose as
commanded, mm and deg, the joint variables by the encoders, mm or deg as the mechanism has them, and the
deviation from the point's first row, mm. A robot with fewer joints has as many q. There may also be
``d1,...,d6``: whether each joint last moved up, 1, or down, -1; 0 or empty where that is not known; some
of ``t1,...,t6,tb``: the temperatures of legs and base, deg C; and ``time_s``: when the row was measured, s
from any moment; both empty where not known. The order of the columns is free; others are ignored.
"""

import csv
import io
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Set
from pathlib import Path

from hexacell.cell.fields import LARGEST_NUMBER, LARGEST_TIME_S
from hexacell.errors import FileError
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import Directions, MeasurementSet, Record, RecordId, Temperatures
from hexacell.storage.atomic_files import read_text, write_own
from hexacell.storage.toml_document import shortened

COUNTS = ("point", "orientation")
POSE_HEADER = (*COUNTS, *"xyzabc")
DEVIATIONS = ("dx", "dy", "dz")

TEMPERATURES = ("t1", "t2", "t3", "t4", "t5", "t6", "tb")
"""Columns of a file with records of which it is known how warm legs and base were."""

TIME = "time_s"
"""Column of a file with records of which it is known when they were measured."""

FEWEST_JOINTS, MOST_JOINTS = 4, 6
LARGEST_COUNT = 1_000_000
MOST_RECORDS = 2000
"""An identification from so many takes a quarter of a minute."""

LARGEST_FILE_BYTES = 5_000_000
csv.field_size_limit(LARGEST_FILE_BYTES)  # a column that is ignored may hold anything


def numbers_of(joints: int) -> tuple[str, ...]:
    """Columns of numbers of a robot with so many joints."""
    return (*"xyzabc", *(f"q{leg}" for leg in range(1, joints + 1)), *DEVIATIONS)


def directions_of(joints: int) -> tuple[str, ...]:
    """Columns of a file with records of which it is known from which side joints arrived."""
    return tuple(f"d{leg}" for leg in range(1, joints + 1))


def read_measurements(path: Path | str, *, allow_partial: bool = False) -> MeasurementSet:
    """Read the records of a measurement file, in the order of its rows.

    With ``allow_partial`` it may be of an unfinished calibration: without rows, or even without a header,
    and with one row at a point.

    Raises:
        FileError: the file cannot be read, a column is missing, a cell is not a number, a record occurs
            twice, the times of a point go back, or there are too few; with the line.
    """
    path = Path(path)
    text = read_text(path, LARGEST_FILE_BYTES)
    if allow_partial and not text.strip():
        return MeasurementSet(())
    return measurements_in(path, text, allow_partial=allow_partial)


def measurements_in(path: Path, text: str, *, allow_partial: bool = False) -> MeasurementSet:
    """The records in the text of a measurement file; raises as ``read_measurements`` does."""
    records = _records(path, text)
    if not allow_partial and not records:
        raise FileError("there are no measurements in it", subject=path, action="Measure some first")
    rows = Counter(point for point, _ in records)
    for (point, _), (line, _) in records.items():
        if rows[point] < 2 and not allow_partial:
            problem = f"point {point} has one row, and at least two are needed to compare"
            action = "Measure it in another orientation, or remove the row"
            raise FileError(problem, subject=path, line=line, action=action)
    return MeasurementSet(tuple(record for _, record in records.values()))


def read_poses(path: Path) -> list[tuple[int, int, Pose]]:
    """Read line, point and pose of each row; only the columns of the poses are required."""
    records = _records(path, read_text(path, LARGEST_FILE_BYTES), poses_alone=True).values()
    return [(line, record.point, record.pose) for line, record in records]


def write_measurements(path: Path, measurements: MeasurementSet) -> None:
    """Write a measurement file, in one step; every number reads back exactly."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    joints = len(measurements.records[0].joints) if measurements.records else MOST_JOINTS
    arrived = directions_of(joints) if any(one.directions for one in measurements.records) else ()
    warm = TEMPERATURES if any(one.temperatures for one in measurements.records) else ()
    timed = (TIME,) if any(one.time_s is not None for one in measurements.records) else ()
    rows.writerow([*COUNTS, *numbers_of(joints), *arrived, *warm, *timed])
    for one in measurements.records:
        numbers = (*one.pose.as_tuple(), *one.joints, *one.deviation)
        directions = one.directions or ("",) * len(arrived)
        shown = *(one.temperatures or (None,) * len(warm)), *(one.time_s for _ in timed)
        # float(): the repr of a numpy number contains its type.
        cells = (repr(float(number)) for number in numbers)
        further = ("" if number is None else repr(float(number)) for number in shown)
        rows.writerow([one.point, one.orientation, *cells, *directions, *further])
    write_own(path, text.getvalue().encode())


def _records(path: Path, text: str, *, poses_alone: bool = False) -> dict[RecordId, tuple[int, Record]]:
    """The records, each with its line, in the order of the file."""
    rows = _filled_rows(path, text)
    line, header = next(rows, (1, []))
    names = {name.strip() for name in header}
    joints = _joints_in(names)
    wanted: tuple[str, ...] = POSE_HEADER
    if not poses_alone:
        arrived = directions_of(joints) if names.intersection(directions_of(joints)) else ()
        further = (name for name in (*TEMPERATURES, TIME) if name in names)
        wanted = (*COUNTS, *numbers_of(joints), *arrived, *further)
    columns = _columns(path, line, header, wanted)
    found: dict[RecordId, tuple[int, Record]] = {}
    latest: dict[int, float] = {}
    for line, row in rows:
        if len(row) != len(header):
            hint = "; is the decimal sign a comma?" if len(row) > len(header) else ""
            problem = f"the row has {len(row)} cells, the header {len(header)}{hint}"
            raise FileError(problem, subject=path, line=line, action="Correct this row")
        cells = {name: row[column] for name, column in zip(wanted, columns, strict=True)}
        record = _record(path, line, cells, joints)
        if record.id in found:
            where, other = f"point {record.point}, orientation {record.orientation}", found[record.id][0]
            problem = f"{where} is here and in line {other}"
            raise FileError(problem, subject=path, line=line, action="Remove one of the two rows")
        found[record.id] = (line, record)
        if record.time_s is not None:
            if record.time_s < (before := latest.get(record.point, record.time_s)):
                problem = f"{TIME} is {record.time_s}, before {before} in an earlier row of this point"
                action = "Put the rows into the order in which they were measured, or correct this cell"
                raise FileError(problem, subject=path, line=line, action=action)
            latest[record.point] = record.time_s
        if len(found) > MOST_RECORDS:
            action = "Split the file; some 60 records identify a robot"
            problem = f"there are more than {MOST_RECORDS} records"
            raise FileError(problem, subject=path, line=line, action=action)
    return found


def _joints_in(names: Set[str]) -> int:
    """How many joints the columns are of: all of them, unless the last ones are not there."""
    last = max((n for n in range(1, MOST_JOINTS + 1) if f"q{n}" in names), default=MOST_JOINTS)
    return last if last >= FEWEST_JOINTS else MOST_JOINTS


def _filled_rows(path: Path, text: str) -> Iterator[tuple[int, list[str]]]:
    """The rows that are not empty, each with its line."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                yield reader.line_num, row
    except csv.Error as error:
        raise FileError(
            f"is not valid CSV: {error}", subject=path, line=reader.line_num, action="Correct this line"
        ) from None


def _columns(path: Path, line: int, header: list[str], wanted: tuple[str, ...]) -> list[int]:
    """The position in the file of each wanted column."""
    names = [name.strip() for name in header]
    missing = [name for name in wanted if name not in names]
    twice = [name for name in wanted if names.count(name) > 1]
    if not names:
        problem = "is empty"
    elif len(names) == 1 and (";" in names[0] or "\t" in names[0]):
        problem = f"columns are separated by {'semicolons' if ';' in names[0] else 'tabs'}, not by commas"
    elif missing:
        problem = f"columns are missing: {', '.join(missing)}"
    elif twice:
        problem = f"columns occur twice: {', '.join(twice)}"
    else:
        return [names.index(name) for name in wanted]
    raise FileError(problem, subject=path, line=line, action=f"The header must be {','.join(wanted)}")


def _record(path: Path, line: int, cells: Mapping[str, str], count: int) -> Record:
    """The record in the cells of one row, by their columns; what is not there is 0."""
    header = (*COUNTS, *numbers_of(count))
    numbers = [_number(path, line, name, cells.get(name, "0")) for name in header]
    point, orientation = int(numbers[0]), int(numbers[1])
    *joints, dx, dy, dz = numbers[8:]
    time = cells.get(TIME, "").strip()
    time_s = _number(path, line, TIME, time) if time else None
    further = _directions(path, line, cells, count), _temperatures(path, line, cells), time_s
    return Record(point, orientation, Pose(*numbers[2:8]), tuple(joints), (dx, dy, dz), *further)


def _directions(path: Path, line: int, cells: Mapping[str, str], joints: int) -> Directions:
    """From which side the joints arrived; empty if no cell says it."""
    names = directions_of(joints)
    stated = [cells.get(name, "").strip() for name in names]
    for name, cell in zip(names, stated, strict=True):
        if cell not in {"", "0", "1", "-1"}:
            problem = f'{name} is "{shortened(cell)}", but must be 1, -1, 0 or empty'
            raise FileError(problem, subject=path, line=line, action="Correct this cell")
    return tuple(int(cell or 0) for cell in stated) if any(stated) else ()


def _temperatures(path: Path, line: int, cells: Mapping[str, str]) -> Temperatures:
    """How warm legs and base were; empty if no cell says it."""
    stated = [(name, cells.get(name, "").strip()) for name in TEMPERATURES]
    shown = tuple(_number(path, line, name, cell) if cell else None for name, cell in stated)
    return shown if any(cell for _, cell in stated) else ()


def _number(path: Path, line: int, name: str, cell: str) -> float:
    """The number in one cell of the column ``name``."""
    is_count, largest = name in COUNTS, LARGEST_TIME_S if name == TIME else LARGEST_NUMBER
    try:
        number = int(cell) if is_count else float(cell)
    except ValueError:
        number = math.nan
    # Python accepts underscores and digits of any script in numbers; a CSV file must not have them.
    is_plain = cell.isascii() and "_" not in cell
    if is_plain and (1 <= number <= LARGEST_COUNT if is_count else abs(number) <= largest):
        return number
    expected = "a finite number" if math.isnan(number) else f"a finite number within +-{largest:g}"
    if is_count:
        expected = f"a whole number from 1 to {LARGEST_COUNT}"
    found = f'"{shortened(cell)}"' if cell.strip() else "empty"
    problem = f"{name} is {found}, but must be {expected}"
    raise FileError(problem, subject=path, line=line, action="Correct this cell")
