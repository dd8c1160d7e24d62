"""Servers on loopback that take notices: HTTP, MQTT 3.1.1 and mail; each may refuse, or never answer."""

import socket
import socketserver
import ssl
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

LOOPBACK = "127.0.0.1"
FROM = datetime(2020, 1, 1, tzinfo=UTC)


@dataclass
class Certificate:
    """Of a server on loopback, signed by itself; one file has it, one its key too."""

    path: Path
    with_key: Path

    def context(self) -> ssl.SSLContext:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(self.with_key)
        return context


def make_certificate(folder: Path) -> Certificate:
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "loopback")])
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(FROM)
        .not_valid_after(FROM + timedelta(days=36_500))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address(LOOPBACK))]), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(key, hashes.SHA256())
        .public_bytes(serialization.Encoding.PEM)
    )
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    made = Certificate(folder / "certificate.pem", folder / "with-key.pem")
    made.path.write_bytes(certificate)
    made.with_key.write_bytes(private + certificate)
    return made


@dataclass
class Webhook:
    """What an HTTP server was sent; it answers with ``statuses`` in turn, then with the last of them."""

    url: str
    statuses: list[int] = field(default_factory=lambda: [204])
    bodies: list[bytes] = field(default_factory=list)
    headers: list[dict[str, str]] = field(default_factory=list)
    location: str | None = None


@contextmanager
def webhook(certificate: Certificate | None = None) -> Iterator[Webhook]:
    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            taken.bodies.append(self.rfile.read(int(self.headers["Content-Length"])))
            taken.headers.append(dict(self.headers.items()))
            self.send_response(taken.statuses.pop(0) if len(taken.statuses) > 1 else taken.statuses[0])
            if taken.location:
                self.send_header("Location", taken.location)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer((LOOPBACK, 0), Handler)
    if certificate is not None:
        server.socket = certificate.context().wrap_socket(server.socket, server_side=True)
    scheme = "http" if certificate is None else "https"
    taken = Webhook(f"{scheme}://{LOOPBACK}:{server.server_address[1]}/hook")
    with _serving(server):
        yield taken


@dataclass
class Broker:
    """An MQTT broker: what is retained, what was published, and who may log in."""

    port: int = 0
    login: tuple[str, str] | None = None
    acknowledges: bool = True
    published: list[tuple[str, bytes, bool]] = field(default_factory=list)

    @property
    def retained(self) -> dict[str, bytes]:
        return {topic: payload for topic, payload, is_retained in self.published if is_retained}


@contextmanager
def broker(certificate: Certificate | None = None, **settings: Any) -> Iterator[Broker]:
    """The part of MQTT 3.1.1 that who publishes with QoS 1 sees."""

    class Handler(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            try:
                for kind, flags, body in _packets(self.rfile.read):
                    if not self.answer(kind, flags, body):
                        return
            except (OSError, EOFError):
                return

        def answer(self, kind: int, flags: int, body: bytes) -> bool:
            if kind == 1:
                refusal = 0 if known.login in (None, _login(body)) else 5
                self.wfile.write(bytes([0x20, 2, 0, refusal]))
                return not refusal
            if kind == 3:
                (length,) = struct.unpack(">H", body[:2])
                topic, rest = body[2 : 2 + length].decode(), body[2 + length :]
                assert flags >> 1 & 3 == 1, "at least once"
                known.published.append((topic, rest[2:], bool(flags & 1)))
                if known.acknowledges:
                    self.wfile.write(bytes([0x40, 2, *rest[:2]]))
            return kind != 14

    server = socketserver.ThreadingTCPServer((LOOPBACK, 0), Handler)
    server.daemon_threads = True
    if certificate is not None:
        server.socket = certificate.context().wrap_socket(server.socket, server_side=True)
    known = Broker(server.server_address[1], **settings)
    with _serving(server):
        yield known


def _packets(read: Callable[[int], bytes]) -> Iterator[tuple[int, int, bytes]]:
    while head := read(1):
        length = shift = 0
        while True:
            (byte,) = read(1)
            length |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                break
        yield head[0] >> 4, head[0] & 15, read(length)


def _login(body: bytes) -> tuple[str, str] | None:
    """User and password of a CONNECT packet."""
    (length,) = struct.unpack(">H", body[:2])
    flags, position = body[2 + length + 1], 2 + length + 4
    texts = []
    while position < len(body):
        (length,) = struct.unpack(">H", body[position : position + 2])
        texts.append(body[position + 2 : position + 2 + length].decode())
        position += 2 + length
    return (texts[-2], texts[-1]) if flags & 0xC0 == 0xC0 else None


@contextmanager
def silent_server() -> Iterator[int]:
    """A port that takes connections, and never says anything."""
    with socket.socket() as listening:
        listening.bind((LOOPBACK, 0))
        listening.listen(8)
        yield listening.getsockname()[1]


def closed_port() -> int:
    """A port where nobody listens."""
    with socket.socket() as free:
        free.bind((LOOPBACK, 0))
        port: int = free.getsockname()[1]
        return port


@contextmanager
def _serving(server: socketserver.BaseServer) -> Iterator[None]:
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
