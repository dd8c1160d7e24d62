"""The certificate by which this computer is known to others over OPC UA."""

import os
from pathlib import Path

from hexacell.storage import atomic_files

CERTIFICATE, KEY = "certificate.der", "private-key.pem"
VALID_DAYS = 3650


def ensure_certificate(folder: Path, uri: str, host: str, *, is_server: bool = True) -> tuple[Path, Path]:
    """An application's certificate and private key, made where absent; only its owner can read the key.

    Raises:
        FileError: they cannot be written.
    """
    certificate, key = folder / CERTIFICATE, folder / KEY
    if not (certificate.is_file() and key.is_file()):
        # Imported here: most cells have nothing to do with OPC UA.
        from asyncua.crypto import cert_gen  # noqa: PLC0415
        from cryptography import x509  # noqa: PLC0415
        from cryptography.hazmat.primitives.serialization import Encoding  # noqa: PLC0415
        from cryptography.x509.oid import ExtendedKeyUsageOID as Usage  # noqa: PLC0415

        atomic_files.create_folder_durably(folder)
        private_key = cert_gen.generate_private_key()
        made = cert_gen.generate_self_signed_app_certificate(  # as OPC 10000-6, 6.2.2 has it
            private_key,
            "hexacell",
            {},
            [x509.UniformResourceIdentifier(uri), x509.DNSName(host)],
            extended=[Usage.SERVER_AUTH if is_server else Usage.CLIENT_AUTH],
            days=VALID_DAYS,
        )
        with atomic_files.os_errors("cannot be written", key):
            key.unlink(missing_ok=True)
            with os.fdopen(os.open(key, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as stream:
                stream.write(cert_gen.dump_private_key_as_pem(private_key))
        atomic_files.write_own(certificate, made.public_bytes(Encoding.DER))
    return certificate, key
