"""The nodes of a PLC: all read in one request, each value checked; written in the PLC's own types."""

import math
from collections.abc import Coroutine, Mapping, Sequence
from concurrent.futures import CancelledError
from itertools import islice
from pathlib import Path
from socket import gethostname
from typing import Any, TypeVar

from asyncua import ua
from asyncua.client.client import Client
from asyncua.crypto import security_policies
from asyncua.sync import ThreadLoop
from asyncua.ua.attribute_ids import AttributeIds
from asyncua.ua.uaerrors import UaError

from drivers.controllers.adapter.served_robot import FailedError
from drivers.controllers.opcua.options import NODES, Kind, OpcUaOptions
from hexacell.errors import HexacellError
from hexacell.storage.opcua_certificate import ensure_certificate

URI = "urn:hexacell:controller"
REQUEST_S = 2.0
"""Longest wait for the answer to one request."""
VT = ua.VariantType
REALS = {VT.Float, VT.Double}
INTEGERS = {VT.Int16, VT.UInt16, VT.Int32, VT.UInt32, VT.Int64, VT.UInt64}
TYPES = {Kind.SWITCH: {VT.Boolean}, Kind.INTEGER: INTEGERS, Kind.TEXT: {VT.String}}
PLACES = ("pose", "joints")
"""What is no place before the joints are homed."""

Values = Mapping[str, Any]
"""What the nodes hold, by name; None where there is no such node, or nobody knows."""
Result = TypeVar("Result")


def fault(reason: str) -> FailedError:
    """A failure for a reason that no other kind has."""
    return FailedError("fault", reason)


class PlcNodes:
    """The nodes of one PLC, for any thread; the connection lives in a thread of its own."""

    def __init__(self, options: OpcUaOptions) -> None:
        self._options = options
        self._client = Client(options.endpoint, timeout=REQUEST_S)
        self._client.application_uri = URI
        self._ids = {
            n: [ua.NodeId.from_string(one) for one in ids] for n, ids in options.node_ids().items()
        }
        self._types: dict[str, list[ua.VariantType]] = {}
        self._thread = ThreadLoop(None)
        self._thread.daemon = True
        self._thread.start()

    def connect(self) -> None:
        """Log in at the PLC's server; raises ``FailedError``, as all of these do."""
        self._do(self._connect())

    def close(self) -> None:
        """Log out, so that the PLC has this session for the next client."""
        self._do(self._client.disconnect())
        self._thread.stop()

    def read(self) -> Values:
        """All of them now; it fails if one is not Good, not of its type or not finite."""
        asked = [one for each in self._ids.values() for one in each]
        answers = iter(self._do(self._client.uaclient.read_attributes(asked, AttributeIds.Value)))
        data = {name: list(islice(answers, len(each))) for name, each in self._ids.items()}
        values = {name: _checked(name, each) for name, each in data.items() if name not in PLACES}
        if not self._types:  # of the first read, as a later one may be wrong and it must be stopped
            self._types = {name: [_variant(one).VariantType for one in each] for name, each in data.items()}
        return values | {name: _checked(name, data[name]) if values["homed"] else None for name in PLACES}

    def write(self, **values: Any) -> None:  # noqa: ANN401 - as the nodes are
        """Write some of them, once all have been read."""
        ids = [one for name in values for one in self._ids[name]]
        each = [one for name, v in values.items() for one in ([v] if len(self._ids[name]) == 1 else v)]
        kinds = [one for name in values for one in self._types[name]]
        # Without status and time, as PLCs refuse a write that has them.
        data = [ua.DataValue(ua.Variant(*one), None) for one in zip(each, kinds, strict=True)]
        for node, status in zip(
            ids, self._do(self._client.uaclient.write_attributes(ids, data)), strict=True
        ):
            if not status.is_good():
                raise fault(f"the PLC refuses to have {node.to_string()} written: {status.name}")

    async def _connect(self) -> None:
        options, client = self._options, self._client
        if options.security != "none":
            certificate, key = ensure_certificate(Path(options.folder), URI, gethostname(), is_server=False)
            policy = getattr(security_policies, f"SecurityPolicy{options.security}")
            pinned = options.server_certificate
            await client.set_security(policy, certificate, key, server_certificate=pinned)
        if (login := options.login()) is not None:
            client.set_user(login.user)
            client.set_password(login.password)
        await client.connect()

    def _do(self, work: Coroutine[Any, Any, Result]) -> Result:
        try:
            return self._thread.post(work)
        except HexacellError as error:
            raise FailedError("fault", error.cause, action=error.action or "Correct it") from error
        except (OSError, TimeoutError, UaError, CancelledError) as error:
            raise fault(f"no connection to the PLC: {type(error).__name__} {error}") from error


def _variant(data: ua.DataValue) -> ua.Variant:
    return data.Value or ua.Variant()


def _checked(name: str, data: Sequence[ua.DataValue]) -> Any:  # noqa: ANN401 - as the node is
    if not data:
        return None
    if bad := next((one.StatusCode for one in data if one.StatusCode and one.StatusCode.value), None):
        raise fault(f"node {name} of the PLC is not Good but {bad.name}")
    kind, found = NODES[name], [_variant(one).Value for one in data]
    value = found[0] if len(found) == 1 else found
    listed = value if isinstance(value, list) else [value]
    types = TYPES.get(kind, REALS)
    if (
        any(_variant(one).VariantType not in types for one in data)
        or (len(listed) != 6 if kind is Kind.SIX else isinstance(value, list))
        or (types is REALS and not all(map(math.isfinite, listed)))
    ):
        raise fault(f"node {name} of the PLC is {ascii(value)[:80]}, which is not {kind.value}")
    return value


def same(written: Any, read: Any) -> bool:  # noqa: ANN401 - as the nodes are
    """Whether a node holds what was written, as far as 32 bits can."""
    pairs = zip(written, read, strict=True) if isinstance(read, list) else [(written, read)]
    return all(math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-6) for a, b in pairs)
