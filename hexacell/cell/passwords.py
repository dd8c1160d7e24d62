"""Passwords of the controller: from the environment, a file of their own, or the cell file.

A cell file is copied, shown and kept with every run, so a password should not be in it. The first of these
that has one counts.
"""

import hmac
import os
import stat
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import SecretStr

from hexacell.cell.fields import LONGEST_TEXT, Password, Section
from hexacell.cell.loader import Cell, SectionType, validated
from hexacell.cell.model import CellSettings
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import FileError, UsageError
from hexacell.storage.atomic_files import os_errors, read_text
from hexacell.storage.toml_document import TomlDocument, clear_secrets

VARIABLES = {"connect_password": "HEXACELL_CONNECT_PASSWORD", "enable_password": "HEXACELL_ENABLE_PASSWORD"}
"""The environment variable of each password."""

LARGEST_FILE_BYTES = 10_000


class PasswordFile(Section):
    """The content of a ``password_file``."""

    connect_password: Password | None = None
    enable_password: Password | None = None


def with_passwords(settings: CellSettings, folder: Path) -> CellSettings:
    """The settings with the controller's passwords; ``folder`` has the cell file.

    Raises as :func:`stated_secrets` does.
    """
    controller = settings.controller
    found = stated_secrets(password_path(controller, folder), PasswordFile, VARIABLES)
    if not found:
        return settings
    return settings.model_copy(update={"controller": controller.model_copy(update=found)})


def password_warnings(cell: Cell) -> Iterator[str]:
    """Passwords that others may read: in the cell file, or in a file that a group can read."""
    lines = sorted({cell.document.line_of(path) or 1 for path in clear_secrets(cell.document)})
    if lines:
        which = ", ".join(map(str, lines))
        yield (
            f"{cell.path}:{which}: a password stands here in clear. Move connect_password and "
            'enable_password to a file of mode 600, name it with password_file = "..." in [controller], '
            f"or set {' and '.join(VARIABLES.values())}"
        )
    path = password_path(cell.settings.controller, cell.path.parent)
    if path is not None and _mode(path) & stat.S_IRGRP:
        yield f"{path}: its whole group can read the passwords in it. If not all should, use chmod 600"


def _mode(path: Path) -> int:
    """The permissions of a file; 0 if it cannot be found, which is reported where it is read."""
    try:
        return path.stat().st_mode
    except (OSError, ValueError):
        return 0


def password_path(controller: ControllerSettings, folder: Path) -> Path | None:
    """The password file that a cell file names; ``folder`` has the cell file."""
    return None if controller.password_file is None else folder / controller.password_file


def stated_secrets(
    path: Path | None, model: type[Section], variables: Mapping[str, str]
) -> dict[str, SecretStr]:
    """Secrets by name: from the environment, or else from a file of their own, if there is one.

    ``variables`` has the variable of the environment for each name.

    Raises:
        FileError: see :func:`private_content`.
        UsageError: a variable of the environment has control characters or is too long.
    """
    content = () if path is None else private_content(path, model)
    found: dict[str, SecretStr] = {name: value for name, value in content if value is not None}
    for name, variable in variables.items():
        value = os.environ.get(variable, "")
        if len(value) > LONGEST_TEXT or not value.isprintable():
            problem = f"the variable {variable} is too long or has control characters"
            raise UsageError(problem, action="Correct it")
        if value:
            found[name] = SecretStr(value)
    return found


class LoginFile(Section):
    """The content of the ``password_file`` of a server."""

    user: Password
    password: Password


@dataclass(frozen=True, slots=True)
class Login:
    """The one name and password that a server lets in."""

    user: str = field(repr=False)
    password: str = field(repr=False)

    def admits(self, user: str, password: str) -> bool:
        """Whether these are they; the answer takes as long for any wrong ones."""
        is_user = hmac.compare_digest(user.encode(), self.user.encode())
        is_password = hmac.compare_digest(password.encode(), self.password.encode())
        return is_user and is_password


def stated_login(file: str | None, folder: Path, variables: Mapping[str, str]) -> Login | None:
    """Who may log in at a server, if its ``password_file`` or the environment names anybody.

    ``folder`` has the cell file, ``variables`` are those with ``user`` and ``password``. Raises as
    :func:`stated_secrets` does.
    """
    found = stated_secrets(None if file is None else folder / file, LoginFile, variables)
    texts = {name: value.get_secret_value() for name, value in found.items()}
    return Login(**texts) if len(texts) == len(variables) else None


def private_content(path: Path, model: type[SectionType]) -> SectionType:
    """The content of a TOML file that others can neither read nor change.

    Raises:
        FileError: it cannot be read, has another content, or others can read or change it.
    """
    with os_errors("the passwords cannot be read", path):
        mode = path.stat().st_mode
    if mode & (stat.S_IRWXO | stat.S_IWGRP):
        raise FileError(
            f"others can read or change the passwords in it (mode {stat.S_IMODE(mode):o})",
            subject=path,
            action=f"Use chmod 600 {path}, and change the passwords if somebody may have read them",
        )
    return validated(TomlDocument.parse(read_text(path, LARGEST_FILE_BYTES), path), model, path)
