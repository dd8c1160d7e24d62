"""Measurement files, exact and with every mistake named; records as arrays."""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.errors import FileError, UsageError
from hexacell.kinematics.pose import Pose
from hexacell.measurements.csv_file import read_measurements, write_measurements
from hexacell.measurements.records import MeasurementSet, Record

HEADER = "point,orientation,x,y,z,a,b,c,q1,q2,q3,q4,q5,q6,dx,dy,dz"
NUMBERS = "0,0,550,0,0,0,-489.7,-485.2,-476.4,476.4,485.2,489.7,0,0,0"
ROWS = [f"1,1,{NUMBERS}", f"1,2,{NUMBERS}", f"4,1,{NUMBERS}", f"4,2,{NUMBERS}"]
GOOD = "\n".join([HEADER, *ROWS]) + "\n"

finite = st.floats(-1e6, 1e6)
counts = st.integers(1, 1_000_000)
records = st.builds(
    Record,
    point=counts,
    orientation=counts,
    pose=st.builds(Pose, finite, finite, finite, finite, finite, finite),
    joints=st.tuples(*[finite] * 6),
    deviation=st.tuples(finite, finite, finite),
    directions=st.just(()) | st.tuples(*[st.sampled_from([1, -1, 0])] * 6),
    temperatures=st.just(()) | st.tuples(*[st.none() | finite] * 7).filter(any),
    time_s=st.none() | finite,
)
measurement_sets = st.lists(records, max_size=8, unique_by=lambda r: (r.point, r.orientation)).map(
    lambda rows: MeasurementSet(tuple(sorted(rows, key=lambda r: r.time_s or 0.0)))
)


@pytest.fixture(scope="module")
def csv_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("measurements") / "measurements.csv"


@pytest.fixture(scope="module")
def read(csv_path: Path) -> Callable[..., MeasurementSet]:
    def read_text(text: str, *, allow_partial: bool = False) -> MeasurementSet:
        csv_path.write_bytes(text.encode())
        return read_measurements(csv_path, allow_partial=allow_partial)

    return read_text


def test_a_file_is_read_completely(read):
    first = read(GOOD).records[0]
    assert first == Record(
        1, 1, Pose(0, 0, 550), (-489.7, -485.2, -476.4, 476.4, 485.2, 489.7), (0.0, 0.0, 0.0)
    )


@given(measurements=measurement_sets)
def test_written_sets_read_back_exactly(csv_path, measurements):
    write_measurements(csv_path, measurements)
    assert read_measurements(csv_path, allow_partial=True) == measurements


def test_directions_are_read_where_the_file_has_them(read):
    rows = ["1,-1,0,,1,1", ",,,,,", "0,0,0,0,0,0", " 1,1 ,1,1,1,1"]
    lines = [f"{HEADER},d1,d2,d3,d4,d5,d6", *(f"{row},{six}" for row, six in zip(ROWS, rows, strict=True))]
    found = [record.directions for record in read("\n".join(lines)).records]
    assert found == [(1, -1, 0, 0, 1, 1), (), (0,) * 6, (1,) * 6]


def test_temperatures_are_read_of_the_parts_that_the_file_has(read):
    cells = ["21.5,,20", ",,", "20,0,-3.25", "1,1,1"]
    lines = [f"{HEADER},tb,t1,t6", *(f"{row},{three}" for row, three in zip(ROWS, cells, strict=True))]
    found = read("\n".join(lines))
    assert found.records[0].temperatures == (None, None, None, None, None, 20.0, 21.5)
    assert found.records[1].temperatures == ()
    np.testing.assert_array_equal(found.temperatures[:, 0], [np.nan, np.nan, 0.0, 1.0])
    with pytest.raises(FileError, match='t6 is "warm", but must be a finite number'):
        read("\n".join(lines).replace("-3.25", "warm"))


def test_times_from_any_moment_do_not_go_back_within_a_point(read):
    lines = [f"{HEADER},time_s", *(f"{row},{s}" for row, s in zip(ROWS, (1e9, 2e9, "", 4), strict=True))]
    np.testing.assert_array_equal(read("\n".join(lines)).times_s, [1e9, 2e9, np.nan, 4.0])
    with pytest.raises(FileError, match=r"time_s is 80\.0, before 1000000000\.0 in") as error:
        read("\n".join(lines).replace("2000000000.0", "80"))
    assert error.value.line == 3


def test_header_is_the_documented_one(csv_path):
    write_measurements(csv_path, MeasurementSet(()))
    assert csv_path.read_bytes() == HEADER.encode() + b"\n"


def test_numpy_numbers_are_written_as_numbers(csv_path):
    pose = Pose.of(np.array([0.1, 0.2, 550.0]), np.eye(3))
    joints, deviation = np.full(6, 0.1), np.full(3, 1 / 3)
    rows = [Record(1, n, pose, tuple(joints), tuple(deviation)) for n in (1, 2)]
    write_measurements(csv_path, MeasurementSet(tuple(rows)))
    assert read_measurements(csv_path).records == tuple(rows)


@pytest.mark.parametrize(
    "text",
    [
        GOOD.replace("\n", "\r\n"),
        "\ufeff" + GOOD,
        GOOD + "\n\n  \n",
        GOOD + "," * 16 + "\n",
        GOOD.rstrip("\n"),
        GOOD.replace(",", " , "),
        GOOD.replace("550", '"550.0"'),
    ],
    ids=["crlf", "bom", "blank lines", "blank cells", "no last line end", "blanks", "quotes"],
)
def test_files_rewritten_by_other_programs_are_read_the_same(read, text):
    assert read(text) == read(GOOD)


def test_columns_in_another_order_and_further_ones(read, csv_path):
    with csv_path.open("w", newline="") as stream:
        rows = csv.writer(stream)
        for line in GOOD.splitlines():
            cells = line.split(",")
            rows.writerow(['said "ok", nan', *reversed(cells), "_" * 200_000])
    assert read_measurements(csv_path) == read(GOOD)


# The text in the good file, what replaces it, what must be said, and in which line.
MISTAKES = [
    (HEADER, HEADER.replace("q3,", ""), "columns are missing: q3", 1),
    (HEADER, HEADER.replace("dx,dy", "dx,dx"), "columns are missing: dy", 1),
    (HEADER, HEADER + ",q1", "columns occur twice: q1", 1),
    (HEADER + "\n", "", "columns are missing: point, orientation, x", 1),
    (GOOD, GOOD.replace(",", ";"), "separated by semicolons, not by commas", 1),
    (GOOD, HEADER + "\n", "no measurements in it", None),
    (GOOD, "", "is empty", 1),
    (ROWS[1], f"1,2,{NUMBERS},0", "18 cells, the header 17; is the decimal sign a comma", 3),
    (ROWS[1], "1,2,0", "3 cells, the header 17", 3),
    (ROWS[1], ROWS[1].replace("550", "nan"), 'z is "nan", but must be a finite number', 3),
    (ROWS[1], ROWS[1].replace("550", "1e308"), "must be a finite number within .-1e.06", 3),
    (ROWS[1], ROWS[1].replace("550", "5_50"), 'z is "5_50", but must be a finite number', 3),
    (ROWS[1], ROWS[1].replace("550", "\u0665\u0665\u0660"), "must be a finite number", 3),
    (ROWS[1], ROWS[1].replace("489.7,0", "489.7,"), "dx is empty, but must be a finite number", 3),
    (ROWS[1], f"1.0,2,{NUMBERS}", 'point is "1.0", but must be a whole number from 1', 3),
    (ROWS[1], f"0,2,{NUMBERS}", 'point is "0", but must be a whole number from 1', 3),
    (ROWS[1], f"1,{'9' * 5000},{NUMBERS}", "but must be a whole number from 1", 3),
    (ROWS[1], ROWS[0], "point 1, orientation 1 is here and in line 2", 3),
    (ROWS[3] + "\n", "", "point 4 has one row", 4),
    (ROWS[1], f'1,2,"0"5{NUMBERS[1:]}', "not valid CSV", 3),
    (ROWS[3], f'4,2,"{NUMBERS}', "not valid CSV", 5),
    (ROWS[1], "a" * 200_000, "1 cells, the header 17", 3),
    (GOOD, f"{HEADER},d1,d2\n{ROWS[0]},1,1\n", "columns are missing: d3, d4, d5, d6", 1),
    (GOOD, f"{HEADER},d1,d2,d3,d4,d5,d6\n{ROWS[0]},1,1,1,1,2,1\n", 'd5 is "2", but must be 1, -1, 0', 2),
]


@pytest.mark.parametrize(("old", "new", "message", "line"), MISTAKES)
def test_every_mistake_is_named_with_its_line(read, csv_path, *, old, new, message, line):
    with pytest.raises(FileError, match=message) as refused:
        read(GOOD.replace(old, new, 1))
    assert refused.value.subject == str(csv_path)
    assert refused.value.line == line
    assert refused.value.action


@pytest.mark.parametrize("raw", [GOOD.encode("utf-16"), GOOD.encode() + b"\xe4\n"])
def test_other_encodings_are_refused(csv_path, raw):
    csv_path.write_bytes(raw)
    with pytest.raises(FileError, match="UTF-8") as refused:
        read_measurements(csv_path)
    assert refused.value.line == (1 if raw.startswith(b"\xff") else 6)


@pytest.mark.parametrize("text", ["", "\n", "\ufeff", HEADER, HEADER + "\n"])
def test_an_empty_file_is_a_valid_partial_file(read, text):
    assert read(text, allow_partial=True) == MeasurementSet(())


def test_more_records_than_can_be_identified_are_refused(read):
    rows = (f"1,{number},{NUMBERS}\n" for number in range(1, 2002))
    with pytest.raises(FileError, match="more than 2000 records") as caught:
        read(f"{HEADER}\n{''.join(rows)}")
    assert caught.value.line == 2002


def test_a_file_that_is_far_too_large_is_not_read(read):
    with pytest.raises(FileError, match=r"is too large: 6.0 MB, and at most 5 MB are read"):
        read(GOOD + 6_000_000 * "\n")


pieces = st.sampled_from(
    [",", "\n", '"', ";", "\r", "nan", "1e999", "-", "point", "\0", "\u0661", "_", " "]
)


@given(
    edits=st.lists(st.tuples(st.integers(0, len(GOOD)), st.integers(0, 9), st.text() | pieces), max_size=3)
)
def test_damaged_files_give_plain_errors_or_sound_records(read, edits):
    text = GOOD
    for start, length, piece in edits:
        text = text[:start] + piece + text[start + length :]
    try:
        measurements = read(text)
    except FileError as error:
        assert error.action  # noqa: PT017 - reading may also succeed
        return
    for array in (measurements.joints, measurements.deviations, measurements.poses.positions):
        assert np.isfinite(array).all()
    assert (measurements.labels >= 1).all()


def test_as_many_rows_as_there_may_be_are_read(read, csv_path):
    rows = [Record(n // 20 + 1, n % 20 + 1, Pose(0, 0, n / 7), (n / 3,) * 6, (0,) * 3) for n in range(2000)]
    measurements = MeasurementSet(tuple(rows))
    write_measurements(csv_path, measurements)
    assert read_measurements(csv_path) == measurements


def record(point: int, orientation: int, z: float = 550.0) -> Record:
    return Record(point, orientation, Pose(1, 2, z, 10, 20, 30), (1, 2, 3, 4, 5, 6), (0.1, 0.2, 0.3))


def test_records_as_arrays():
    a, b = record(1, 1), record(1, 2, z=500.0)
    measurements = MeasurementSet((a, b))
    assert len(measurements) == 2
    np.testing.assert_array_equal(measurements.labels, [[1, 1], [1, 2]])
    np.testing.assert_array_equal(measurements.points, [1, 1])
    np.testing.assert_array_equal(measurements.poses.positions, [[1, 2, 550], [1, 2, 500]])
    np.testing.assert_array_equal(measurements.poses.rotations[1], b.pose.rotation)
    np.testing.assert_array_equal(measurements.joints, [[1, 2, 3, 4, 5, 6]] * 2)
    np.testing.assert_array_equal(measurements.deviations, [[0.1, 0.2, 0.3]] * 2)
    assert measurements.joints.dtype == float


def test_points_are_grouped_in_the_order_of_measurement():
    order = [(7, 1), (3, 5), (7, 2), (3, 1), (9, 1)]
    measurements = MeasurementSet(tuple(record(*label) for label in order))
    np.testing.assert_array_equal(measurements.group, [0, 1, 0, 1, 2])


def test_the_same_record_twice_is_refused():
    with pytest.raises(UsageError, match="two records of point 2, orientation 3"):
        MeasurementSet((record(2, 3), record(2, 4), record(2, 3, z=0.0)))
