"""Who may use the screen in a browser: pages of this server alone, for its user or who knows the password.

A browser lets any page send requests to any address. ``Host`` is the name by which that page reached this
computer, and may be one of its own that it made lead here; ``Origin`` is the page.
"""

import base64
import ipaddress
import os
import re
from contextlib import suppress
from dataclasses import dataclass

from aiohttp import hdrs, web

from hexacell.cell.passwords import Login
from hexacell.services.preflight import kernel_connections

CHALLENGE = {hdrs.WWW_AUTHENTICATE: 'Basic realm="hexacell", charset="UTF-8"'}
_HOST = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(:[0-9]{1,5})?", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Access:
    """Who is let in.

    Attributes:
        names: names of this computer, in lower case, beside its numeric addresses.
        login: what is asked for; without one, only processes of this process's user are let in.
    """

    names: frozenset[str]
    login: Login | None = None

    def require_own_page(self, request: web.Request) -> None:
        """Refuse another page, or a name that it made lead here; raises ``HTTPForbidden``."""
        host = request.headers.get(hdrs.HOST, "")
        if (found := _HOST.fullmatch(host)) is None or not self._is_own_name(found[1]):
            raise web.HTTPForbidden(text="This computer is not served under that name.")
        # Browsers name the page of every websocket; of a page that is typed in there is none.
        is_websocket = hdrs.UPGRADE in request.headers
        origin = request.headers.get(hdrs.ORIGIN, "" if is_websocket else f"http://{host}")
        if origin != f"http://{host}":
            raise web.HTTPForbidden(text="Another page may not use the screen.")

    def require_known_person(self, request: web.Request) -> None:
        """Refuse who gives neither user and password, nor needs none.

        Raises:
            HTTPUnauthorized: the login is missing or wrong.
            HTTPForbidden: no login is asked for, and this is another user of this computer.
        """
        if self.login is None:
            if request.transport is None or _user_at(request.transport) != os.getuid():
                raise web.HTTPForbidden(text="This screen is another user's.")
            return
        way, _, given = request.headers.get(hdrs.AUTHORIZATION, "").partition(" ")
        with suppress(ValueError):
            user, _, password = base64.b64decode(given).decode().partition(":")
            if way.lower() == "basic" and self.login.admits(user, password):
                return
        raise web.HTTPUnauthorized(text="User and password are needed.", headers=CHALLENGE)

    def _is_own_name(self, name: str) -> bool:
        with suppress(ValueError):  # no page can make a numeric address lead elsewhere
            return bool(ipaddress.ip_address(name.strip("[]")))
        return name.lower() in self.names


def _user_at(transport: object) -> int | None:
    """The user at the other end of a connection within this computer; None if that is not known."""
    get = transport.get_extra_info  # type: ignore[attr-defined]
    ends = [(ipaddress.ip_address(get(name)[0]).packed, get(name)[1]) for name in ("peername", "sockname")]
    rows = kernel_connections()
    return next((int(columns[7]) for this, other, columns in rows if [this, other] == ends), None)
