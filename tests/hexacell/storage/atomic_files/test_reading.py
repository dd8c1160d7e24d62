"""Reading, making folders, checksums."""

from pathlib import Path

import pytest

from hexacell.errors import FileError
from hexacell.storage import atomic_files


def test_read_if_present(path: Path, tmp_path: Path) -> None:
    assert atomic_files.read_if_present(path) == b"old"
    assert atomic_files.read_if_present(tmp_path / "absent") is None
    with pytest.raises(FileError, match="not a file"):
        atomic_files.read_if_present(tmp_path)
    with pytest.raises(FileError, match="a part of the path is not a folder"):
        atomic_files.read_if_present(path / "below")


def test_text_keeps_its_line_ends_and_the_error_has_the_line_that_is_not_utf8(tmp_path: Path) -> None:
    path = tmp_path / "text"
    path.write_bytes(b"\xef\xbb\xbfa\r\nb\n")
    assert atomic_files.read_text(path) == "a\r\nb\n"
    path.write_bytes("a\nb\nmäßig\n".encode("latin-1"))
    with pytest.raises(FileError, match="not UTF-8") as caught:
        atomic_files.read_text(path)
    assert caught.value.line == 3


def test_folders_are_made_with_those_above(tmp_path: Path) -> None:
    atomic_files.create_folder_durably(tmp_path / "a" / "b")
    atomic_files.create_folder_durably(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").write_bytes(b"")
    for name in ("file", "file/below"):
        with pytest.raises(FileError, match="the folder cannot be made"):
            atomic_files.create_folder_durably(tmp_path / name)


def test_the_name_of_every_new_folder_is_synced_in_its_parent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[Path] = []
    monkeypatch.setattr(atomic_files, "sync_folder", synced.append)
    atomic_files.create_folder_durably(tmp_path / "runs" / "cell" / "run")
    assert set(synced) == {tmp_path, tmp_path / "runs", tmp_path / "runs" / "cell"}
