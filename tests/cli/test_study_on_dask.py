"""``hexacell study ... --scheduler``: the same results from a cluster as from processes."""

import sys

import pytest

from hexacell.errors import ExitCode

PAPER = ("study", "paper", "--draws", "1")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--scheduler", "here"), "'here' is not an address of a Dask scheduler. Try tcp://HOST:8786"),
        (("--scheduler", "tcp://h:1", "--processes", "2"), "not allowed with argument --scheduler"),
    ],
)
def test_what_cannot_be_is_refused(typed_here, arguments, words: str) -> None:
    refused = typed_here(*PAPER, *arguments)
    assert (refused.code, words in refused.err) == (ExitCode.USAGE, True), refused.err


def test_dask_may_be_absent(typed_here, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "hexacell.study.dask_cluster", None)
    refused = typed_here(*PAPER, "--scheduler", "tcp://127.0.0.1:1")
    assert refused.code == ExitCode.USAGE
    assert "Dask is not installed. Install hexacell[dask]" in refused.err
