"""Where the controller's passwords come from, and who may read them."""

import os
from unittest.mock import patch

import pytest

from hexacell.cell.loader import Cell, describe, load_cell, settings_document
from hexacell.cell.passwords import password_warnings, with_passwords
from hexacell.errors import FileError, HexacellError, UsageError

PASSWORDS = 'connect_password = "hunter2"\nenable_password = "hunter3"\n'


@pytest.fixture
def cell_with(cell_text, tmp_path):
    """A cell with these lines in [controller], and a password file with this text and mode."""

    def make(lines: str = "", passwords: str | None = None, mode: int = 0o600) -> Cell:
        path = tmp_path / "cell.toml"
        path.write_text(cell_text.replace("[controller]\n", f"[controller]\n{lines}"))
        if passwords is not None:
            (tmp_path / "passwords.toml").write_text(passwords)
            (tmp_path / "passwords.toml").chmod(mode)
        return load_cell(path)

    return make


def passwords_of(cell: Cell, **environment: str) -> tuple[str, str]:
    with patch.dict(os.environ, environment):
        found = with_passwords(cell.settings, cell.path.parent).controller
    return found.connect_password.get_secret_value(), found.enable_password.get_secret_value()


def test_without_any_they_are_those_that_linuxcnc_comes_with(cell_with) -> None:
    assert passwords_of(cell_with()) == ("EMC", "EMCTOO")


def test_a_file_beside_the_cell_counts_and_the_environment_before_it(cell_with, monkeypatch) -> None:
    monkeypatch.chdir("/")
    cell = cell_with('password_file = "passwords.toml"\n', PASSWORDS)
    assert passwords_of(cell) == ("hunter2", "hunter3")
    assert list(password_warnings(cell)) == []
    assert passwords_of(cell, HEXACELL_ENABLE_PASSWORD="other") == ("hunter2", "other")


def test_a_password_in_the_cell_file_still_counts_and_is_warned_of_with_its_line(cell_with) -> None:
    cell = cell_with('connect_password = "hunter2"\n')
    assert passwords_of(cell) == ("hunter2", "EMCTOO")
    [warning] = password_warnings(cell)
    line = cell.text.splitlines().index('connect_password = "hunter2"') + 1
    assert warning.startswith(f"{cell.path}:{line}: a password stands here in clear. Move ")
    assert "password_file" in warning
    assert "HEXACELL_CONNECT_PASSWORD" in warning
    assert "hunter" not in warning


@pytest.mark.parametrize("mode", [0o644, 0o604, 0o620, 0o666, 0o601])
def test_a_file_that_others_can_read_or_change_is_refused(cell_with, mode: int) -> None:
    cell = cell_with('password_file = "passwords.toml"\n', PASSWORDS, mode)
    with pytest.raises(FileError, match="others can read or change the passwords") as refused:
        passwords_of(cell)
    assert f"chmod 600 {cell.path.parent / 'passwords.toml'}" in str(refused.value)


def test_a_file_that_a_group_can_read_is_warned_of(cell_with) -> None:
    cell = cell_with('password_file = "passwords.toml"\n', PASSWORDS, 0o640)
    assert passwords_of(cell) == ("hunter2", "hunter3")
    [warning] = password_warnings(cell)
    assert "passwords.toml: its whole group can read the passwords" in warning


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("hunter2", "passwords.toml:1: not valid TOML"),
        ("connect_password = 7654321", "must be text in quotes"),
        ('connect_password = "hunter2\\u0007"', "must be text of 1000 letters or fewer, without control"),
        ('conect_password = "hunter2"', "unknown key 'conect_password'"),
        (None, "it does not exist"),
    ],
)
def test_a_mistake_in_the_file_is_told_and_the_password_is_not(cell_with, text, problem) -> None:
    cell = cell_with('password_file = "passwords.toml"\n', text)
    with pytest.raises(HexacellError) as refused:
        passwords_of(cell)
    assert problem in str(refused.value)
    assert "hunter" not in str(refused.value)
    assert "7654321" not in str(refused.value)


@pytest.mark.parametrize("value", ["a\nb", "x" * 1001])
def test_a_strange_variable_is_refused_without_its_value(cell_with, value: str) -> None:
    with pytest.raises(UsageError, match="HEXACELL_ENABLE_PASSWORD") as refused:
        passwords_of(cell_with(), HEXACELL_ENABLE_PASSWORD=value)
    assert value not in str(refused.value)


def test_nothing_that_is_shown_of_a_cell_has_a_password(cell_with) -> None:
    cell = cell_with('connect_password = "hunter2"\n')
    shown = (describe(cell), str(settings_document(cell)), repr(cell.settings), cell.text_without_secrets)
    assert not any("hunter" in text for text in shown)
    assert "# connect_password is not shown  " not in shown[0]
    assert "# connect_password is not shown\n" in shown[0]
    assert settings_document(cell)["controller"]["connect_password"] == "***"


def test_a_wrong_password_in_the_cell_file_is_not_quoted(cell_with) -> None:
    with pytest.raises(FileError) as refused:
        cell_with('connect_password = ["hunter2"]\n')
    assert "'connect_password' in [controller] must be text in quotes" in str(refused.value)
    assert "hunter" not in str(refused.value)
