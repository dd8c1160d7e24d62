"""Who may read results, and the certificate that the server shows."""

from __future__ import annotations

import hmac
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from hexacell.cell.fields import LONGEST_TEXT, Password, Section
from hexacell.cell.operation import OpcUaSettings
from hexacell.cell.passwords import private_content
from hexacell.errors import UsageError
from hexacell.storage import atomic_files

USER_VARIABLE, PASSWORD_VARIABLE = "HEXACELL_OPCUA_USER", "HEXACELL_OPCUA_PASSWORD"
CERTIFICATE, KEY = "certificate.der", "private-key.pem"
VALID_DAYS = 3650


class ReaderFile(Section):
    """The content of the server's ``password_file``."""

    user: Password
    password: Password


@dataclass(frozen=True, slots=True)
class Reader:
    """Who may read; anybody if there is no name."""

    user: str = field(default="", repr=False)
    password: str = field(default="", repr=False)

    def is_this(self, user: str | None, password: str | None) -> bool:
        """Whether somebody who logs in is the reader; as slow for a wrong password as for the right one."""
        if not self.user:
            return user is None
        same_user = hmac.compare_digest((user or "").encode(), self.user.encode())
        same_password = hmac.compare_digest((password or "").encode(), self.password.encode())
        return same_user and same_password


def allowed_reader(
    settings: OpcUaSettings, folder: Path, environment: Mapping[str, str] = os.environ
) -> Reader:
    """Who may read; ``folder`` has the cell file.

    Raises:
        FileError: the password file cannot be read, or others can read or change it.
        UsageError: nobody is named, and the cell file does not let anybody in.
    """
    given = [environment.get(variable, "") for variable in (USER_VARIABLE, PASSWORD_VARIABLE)]
    if all(given) and max(map(len, given)) <= LONGEST_TEXT:
        return Reader(*given)
    if settings.password_file is not None:
        content = private_content(folder / settings.password_file, ReaderFile)
        return Reader(content.user.get_secret_value(), content.password.get_secret_value())
    if settings.anonymous:
        return Reader()
    raise UsageError(
        "nobody may read the results",
        subject="[opcua]",
        action=f"Name a password_file, or set {USER_VARIABLE} and {PASSWORD_VARIABLE}",
    )


def ensure_certificate(folder: Path, uri: str, host: str) -> tuple[Path, Path]:
    """The server's certificate and private key, made where absent; only the owner can read the key.

    Raises:
        FileError: they cannot be written.
    """
    certificate, key = folder / CERTIFICATE, folder / KEY
    if not (certificate.is_file() and key.is_file()):
        atomic_files.create_folder_durably(folder)
        made_certificate, made_key = _made_certificate(uri, host)
        _write_private(key, made_key)
        atomic_files.write_atomically(certificate, made_certificate)
    return certificate, key


def _made_certificate(uri: str, host: str) -> tuple[bytes, bytes]:
    """A certificate signed by itself, as OPC 10000-6, 6.2.2 has it (DER), and its key (PEM)."""
    from asyncua.crypto import cert_gen  # noqa: PLC0415 - an optional extra
    from cryptography import x509  # noqa: PLC0415 - comes with it
    from cryptography.hazmat.primitives.serialization import Encoding  # noqa: PLC0415 - likewise
    from cryptography.x509.oid import ExtendedKeyUsageOID  # noqa: PLC0415 - likewise

    key = cert_gen.generate_private_key()
    certificate = cert_gen.generate_self_signed_app_certificate(
        key,
        "hexacell",
        {},
        [x509.UniformResourceIdentifier(uri), x509.DNSName(host)],
        extended=[ExtendedKeyUsageOID.SERVER_AUTH],
        days=VALID_DAYS,
    )
    return certificate.public_bytes(Encoding.DER), cert_gen.dump_private_key_as_pem(key)


def _write_private(path: Path, data: bytes) -> None:
    try:
        path.unlink(missing_ok=True)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(data)
    except OSError as error:
        raise atomic_files.os_error_to_file_error("cannot be written", path, error) from error
