"""Addresses of networks and of serial ports, taken apart and judged in one place."""

import encodings.idna  # noqa: F401 - a process that gave up rights may find it no longer
import socket
import sys
import threading
from contextlib import suppress
from functools import cache
from ipaddress import IPv6Address, ip_address
from urllib.parse import SplitResult, urlsplit

from hexacell.errors import UsageError

SERIAL_SCHEMES = ("socket", "rfc2217", "loop")
"""URLs of pyserial that may be named; others of it write files, or search for a port by a pattern."""

WITHOUT_HOST = ("loop",)
METADATA = frozenset(map(ip_address, ("fd00:ec2::254", "fd20:ce::254", "100.100.100.200")))
"""Where clouds tell a computer its secrets, beyond the link-local addresses."""
LINK_LOCAL = "the address is link-local, or tells the secrets of a cloud"


def address_of(url: str) -> SplitResult:
    """The parts of an address with a scheme, such as ``mqtts://user@host:8883/path?query``.

    Raises:
        UsageError: it has no scheme, or its host or port cannot be one.
    """
    scheme, mark, _ = url.partition("://")
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        # Its words may have a part of the address in them, which may be secret.
        raise _mistaken("its host or port cannot be one") from error
    if not mark or parts.scheme != scheme.lower():
        raise _mistaken("it has no scheme")
    if host:
        require_host(host)
    if port == 0:
        raise _mistaken("there is no port 0")
    return parts


def require_host(host: str) -> None:
    """Refuse what can be no network name or address; raises ``UsageError``."""
    try:
        host.encode("idna")
        if ":" in host:
            ip_address(host)
        is_possible = bool(host) and not any(sign.isspace() or sign in "[]" for sign in host)
    except ValueError:  # of which UnicodeError is one
        is_possible = False
    if not is_possible:
        raise _mistaken("its host is no network name or address")


def require_serial_port(port: str) -> None:
    """Refuse what is no device path and no URL that may be named; raises ``UsageError``."""
    scheme, mark, _ = port.lower().partition("://")
    if not mark or scheme in WITHOUT_HOST:
        return
    if scheme not in SERIAL_SCHEMES:
        problem = f"serial ports of {scheme}:// are refused"
        raise UsageError(problem, action="Write a device path, socket://HOST:PORT or rfc2217://HOST:PORT")
    address = address_of(port)
    if not address.hostname or address.port is None:
        raise _mistaken("it has no host and port")


def is_link_local(host: str, *, by_name: bool) -> bool:
    """Whether a host, however it is spelt, is a link-local address or one with a cloud's secrets.

    ``by_name``: a name is looked up, which may take long; else only addresses are known.
    """
    found: list[str] = []
    with suppress(OSError, UnicodeError):  # nobody can be reached there
        flags = 0 if by_name else socket.AI_NUMERICHOST
        answers = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM, flags=flags)
        found = [str(answer[4][0]).partition("%")[0] for answer in answers]
    return any(_is_refused(one) for one in found)


def connect_to_no_link_local() -> None:
    """From now on this thread connects to no such address, whatever a name resolved to before."""
    # By a hook, since the libraries that connect resolve names themselves; it cannot be taken away.
    _add_hook_once(_require_elsewhere)
    _of_thread.is_watched = True


_of_thread = threading.local()
_add_hook_once = cache(sys.addaudithook)


def _require_elsewhere(event: str, arguments: tuple[object, ...]) -> None:
    if event == "socket.connect" and hasattr(_of_thread, "is_watched"):
        match arguments:
            case (_, (str(host), *_)) if is_link_local(host, by_name=True):
                raise PermissionError(LINK_LOCAL)


def _is_refused(text: str) -> bool:
    address = ip_address(text)
    if isinstance(address, IPv6Address):
        address = address.ipv4_mapped or address.sixtofour or address
    return address.is_link_local or address in METADATA


def _mistaken(problem: str) -> UsageError:
    return UsageError(f"this is no address: {problem}", action="Write it as scheme://host:port/path")
