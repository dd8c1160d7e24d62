"""Passwords are masked whole, and nothing else of a text is changed."""

import tomllib

import pytest

from hexacell.errors import FileError
from hexacell.storage.toml_document import TomlDocument, clear_secrets, with_lines_masked, without_secrets

TEXT = """\
# a cell, and a password_file beside it
[controller]
connect_password = "hunter2"   # the door
'enable_password' = '''
hunter
three'''
password_file = "passwords.toml"
reload_command = ["sh", "-c", "#password = kept"]
[encoders]
bus = { interface = "x", channel = "http://me:hunter4@host/", api-key = 7, nested = { token = "hunter5" } }
#enable_password = "hunter6"
# Password: hunter7
"""


def test_every_secret_is_masked_and_all_else_is_kept() -> None:
    masked = without_secrets(TEXT)
    assert "hunter" not in masked
    before, after = tomllib.loads(TEXT), tomllib.loads(masked)
    assert after["controller"]["connect_password"] == after["controller"]["enable_password"] == "***"
    assert after["encoders"]["bus"]["nested"]["token"] == "***"
    assert after["encoders"]["bus"]["channel"] == "http://me:***@host/"
    assert after["controller"]["reload_command"] == before["controller"]["reload_command"]
    assert 'connect_password = "***"   # the door\n' in masked
    assert "# a cell, and a password_file beside it\n" in masked
    assert without_secrets(masked) == masked


def test_a_text_without_secrets_stays_and_masked_ones_are_not_in_clear() -> None:
    text = '\ufeff# a "# b\r\n[tokens]\r\nname = "password = 1" # c\r\npasswords = ["x"]\r\n'
    assert without_secrets(text) == text
    assert clear_secrets(TomlDocument.parse(without_secrets(TEXT))) == []
    assert ("controller", "connect_password") in clear_secrets(TomlDocument.parse(TEXT))


@pytest.mark.parametrize(
    "line",
    ["password = hunter2", 'PASSWD: "hunter2"', "linuxcncrsh --connectpw hunter2 --enablepw hunter2"],
)
def test_a_text_that_is_no_toml_loses_the_rest_of_the_line(line: str) -> None:
    masked = with_lines_masked(f"[a\n{line}\nb = 1\n")
    assert "hunter" not in masked
    assert masked.startswith("[a\n")
    assert masked.endswith("\nb = 1\n")


def test_an_error_does_not_show_a_secret() -> None:
    document = TomlDocument.parse('enable_password = "hunter2"')
    assert "hunter" not in document.mismatch(("enable_password",), "shorter")
    with pytest.raises(FileError) as refused:
        raise document.error(
            ("enable_password",), document.mismatch(("enable_password",), "x"), "Correct it"
        )
    assert "'enable_password' at the top of the file must be x" in str(refused.value)
