"""Results by name and records as columns: the same numbers as everywhere else, and plain refusals."""

import sys
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from hexacell import api
from hexacell.cell.bundled import bundled_config
from hexacell.errors import FileError, UsageError


@pytest.fixture
def cell() -> api.Cell:
    return api.load_cell(bundled_config("simulated-hexaglide"))


@pytest.fixture(autouse=True)
def without_a_screen() -> None:
    mpl.use("Agg")


def test_a_fit_of_arrays_is_that_of_the_records_by_name(cell, noisy) -> None:
    found = api.fit(cell, api.measurements_of(api.columns_of(noisy)))
    whole = api.fit_measurements(cell, noisy).found
    assert [found.value(name) for name in found.names] == pytest.approx(whole.geometry.vector.tolist())
    assert [found.sigma(name) for name in found.names] == pytest.approx(whole.sigma.tolist())
    assert np.allclose(found.covariance(), whole.covariance)
    row, column = found.names.index("S1x"), found.names.index("B2y")
    assert found.covariance(["B2y", "S1x"])[0, 1] == pytest.approx(whole.covariance[column, row])
    assert (found.verdict, found.run) == (None, None)
    assert "Good: the records agree" in found._repr_html_()
    with pytest.raises(UsageError, match=r"no parameter is called 's1x'. Did you mean 'S1x'"):
        found.value("s1x")
    with pytest.raises(UsageError, match="no held-out pose was measured"):
        found.plot_errors()
    axes = Figure().add_subplot()
    assert found.plot_residuals(axes) is axes
    drawn = np.array([line.get_ydata() for line in axes.lines[:3]]).T
    assert drawn.shape == (len(noisy), 3)
    assert np.sqrt(np.mean(drawn**2)) == pytest.approx(whole.residual_rms_mm)


def test_records_are_the_same_through_columns(noisy) -> None:
    columns = api.columns_of(noisy)
    assert columns["q1"].tolist() == noisy.joints[:, 0].tolist()
    assert columns["dz"].tolist() == noisy.deviations[:, 2].tolist()
    assert columns["x"].tolist() == noisy.poses.positions[:, 0].tolist()
    floats = {
        name: column.astype(float) for name, column in columns.items()
    }  # as a frame with NaN has them
    floats["t1"] = np.full(len(noisy), np.nan)
    for one in (columns, floats):
        assert api.columns_of(api.measurements_of(one)).keys() == columns.keys()
        assert np.array_equal(api.measurements_of(one).joints, noisy.joints)
    assert api.measurements_of(columns) == noisy


def test_columns_that_are_no_records_are_refused_with_their_place(noisy) -> None:
    columns = api.columns_of(noisy)
    damaged = columns["dx"].copy()
    damaged[3] = np.nan
    for change, told in (
        ({"dx": damaged}, r"the columns:5: dx is \"nan\""),
        ({"dx": damaged[1:]}, r"not equally long: .*dx \d+"),
        ({"point": columns["point"] + 0.5}, r"point is \"1.5\", but must be a whole number"),
        ({"orientation": columns["orientation"] * 0 + 1}, "is here and in line"),
    ):
        with pytest.raises((FileError, UsageError), match=told):
            api.measurements_of({**columns, **change})
    with pytest.raises(FileError, match="columns are missing: q5"):
        api.measurements_of({name: column for name, column in columns.items() if name != "q5"})


def test_a_frame_needs_pandas_and_nothing_else_does(noisy, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match=r"needs the package pandas. Install it"):
        api.frame(noisy)
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))  # what it is given
    assert api.frame(noisy).keys() == api.columns_of(noisy).keys()


def test_a_study_needs_no_files_of_its_own(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    found = api.study("experiment", draws=1)
    assert repr(found) == repr(api.study("experiment", draws=1, folder=tmp_path / "kept"))  # NaN is not NaN
    assert (tmp_path / "kept" / "experiment.jsonl").is_file()
    with pytest.raises(UsageError, match=r"no study 'papers'. There are: paper, experiment"):
        api.study("papers", draws=1)


def test_a_simulated_cell_is_a_copy_with_its_seed(tmp_path) -> None:
    cell = api.simulated_cell("gough-stewart", tmp_path / "robot", seed=7)
    assert cell.settings.simulation is not None
    assert cell.settings.simulation.seed == 7
    assert cell.settings.timing.clock_factor > 1.0
    assert cell.path.parent == tmp_path / "robot"
    assert cell.config_path.is_file()
    assert api.simulated_cell("gough-stewart", str(tmp_path / "robot")).settings.simulation is not None
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep")
    with pytest.raises(FileError, match=r"not empty, and no earlier demo's. Choose another folder"):
        api.simulated_cell(folder=tmp_path / "mine")
    with pytest.raises(UsageError, match="no cell called 'hexaglid'"):
        api.simulated_cell("hexaglid", tmp_path / "new")
    with pytest.raises(FileError, match="seed"):
        api.simulated_cell(folder=tmp_path / "new", seed=-1)
