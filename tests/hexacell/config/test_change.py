"""A proposed change of a config: what it holds, how it is kept, and its diff."""

import json
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.config.change import ConfigChange, diff, propose
from hexacell.config.layout import fingerprint
from hexacell.errors import FileError
from hexacell.kinematics.geometry import Geometry
from hexacell.storage import atomic_files
from tests.native_config import NATIVE


def test_a_proposal_describes_the_change_and_writes_nothing(config, geometry, proposal) -> None:
    text = config.read_bytes()
    assert proposal.path == config
    assert proposal.sha256_before == atomic_files.sha256(text) == fingerprint(config)
    assert proposal.text_before.encode() == text
    assert proposal.before["l"] == (700.0,) * 6
    assert proposal.after["S"][1] == tuple(geometry["S"][1])
    assert "-\t[-400.0, 200, 0.0]," in proposal.diff
    assert "+\t[-399.996296, 200.004938, 0.006173]," in proposal.diff
    assert "gain" not in proposal.diff


def test_a_config_that_changed_since_the_run_began_is_refused(config: Path, geometry: Geometry) -> None:
    start = fingerprint(config)
    config.write_text(config.read_text() + "# one more remark\n")
    with pytest.raises(FileError, match=r"changed since the run began.*run again"):
        propose((config,), NATIVE, geometry, fingerprint_at_start=start)


def test_a_proposal_survives_its_file_with_windows_line_ends_and_a_byte_order_mark(
    tmp_path: Path, config: Path, geometry: Geometry
) -> None:
    config.write_bytes(b"\xef\xbb\xbf" + config.read_bytes().replace(b"\n", b"\r\n"))
    made = propose((config,), NATIVE, geometry, fingerprint_at_start=fingerprint(config))
    made.save(tmp_path / "proposal.json")
    loaded = ConfigChange.load(tmp_path / "proposal.json")
    assert loaded == made
    assert loaded.text_before.encode() == config.read_bytes()


@pytest.mark.parametrize("key", ["text_before", "text_after", "sha256_before", "sha256_after"])
def test_an_edited_proposal_is_refused(tmp_path: Path, proposal: ConfigChange, key: str) -> None:
    path = tmp_path / "proposal.json"
    document = json.loads(proposal.to_json())
    path.write_text(json.dumps(document | {key: document[key] + " "}))
    with pytest.raises(FileError, match="does not have the checksum stated"):
        ConfigChange.load(path)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"version": 2}'])
def test_a_file_that_is_no_proposal_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "proposal.json"
    path.write_text(text)
    with pytest.raises(FileError, match="this is not a config change") as caught:
        ConfigChange.load(path)
    assert caught.value.subject == str(path)


pieces = st.lists(st.sampled_from(["a\n", "b\r\n", "c\f d\n", "e\x85\u2028\n", "\n"]), max_size=8).map(
    "".join
)
texts = st.tuples(pieces, st.sampled_from(["", "no end of line"])).map("".join)


def patched(before: str, change: str) -> str:
    """``before`` with a unified diff applied, as ``patch`` does it but by the book."""
    old = re.findall(r"[^\n]*\n|[^\n]+$", before)
    lines = re.findall(r"[^\n]*\n", change.replace("\n\\ No newline at end of file\n", "\0\n"))
    new, done = [], 0
    for line in (line.replace("\0\n", "") for line in lines[2:]):
        if hunk := re.match(r"@@ -(\d+)(,0)?", line):
            start = int(hunk[1]) - (0 if hunk[2] else 1)
            new += old[done:start]
            done = start
        elif line.startswith("+"):
            new.append(line[1:])
        else:
            assert old[done] == line[1:]
            new += [old[done]] if line.startswith(" ") else []
            done += 1
    return "".join(new + old[done:])


@given(texts, texts)
def test_the_diff_is_the_whole_change(before: str, after: str) -> None:
    assert patched(before, diff(before, after)) == after
