"""What a cell file states of a PLC: its OPC UA server, its nodes, who logs in."""

from enum import Enum
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from hexacell.cell.fields import Positive, Six, Text, broken_rule, key
from hexacell.cell.passwords import Login, stated_login
from hexacell.cell.robot import ControllerOptions
from hexacell.errors import UsageError

VARIABLES = {"user": "HEXACELL_CONTROLLER_USER", "password": "HEXACELL_CONTROLLER_PASSWORD"}


class Kind(Enum):
    """What a node holds."""

    SWITCH = "true or false"
    INTEGER = "an integer of 16 bits or more"
    REAL = "a finite real"
    SIX = "six finite reals"
    TEXT = "text"


_ANSWERS, _STATES = ("busy", "done", "error"), ("estop", "enabled", "homed", "moving", "remote")
NODES: dict[str, Kind] = {
    **dict.fromkeys(("execute", "stop", *_ANSWERS, *_STATES), Kind.SWITCH),
    **dict.fromkeys(("command", "number", "client_heartbeat"), Kind.INTEGER),
    **dict.fromkeys(("answered", "error_number", "heartbeat"), Kind.INTEGER),
    **dict.fromkeys(("target", "pose", "joints"), Kind.SIX),
    "duration": Kind.REAL,
    "error_text": Kind.TEXT,
}
"""Every node, by its name on docs/controller-opcua.md."""
OPTIONAL = ("remote", "joints", "error_text")

NodeId = Annotated[Text, Field(pattern=r"^((ns=\d+;)?(i=\d+|[sgb]=.+))?$")]
File = Annotated[Text, Field(min_length=1)]


class OpcUaOptions(ControllerOptions):
    """A PLC: its OPC UA server, its nodes, who logs in."""

    endpoint: Annotated[Text, Field(pattern=r"^opc\.tcp://[^@\s]+$")] = key(
        ..., "address of the PLC's OPC UA server, opc.tcp://host:port/path"
    )
    node: Text = key(
        ..., "node id of all nodes but those of nodes, with {name} in it; empty if nodes has all"
    )
    nodes: dict[str, NodeId | Six[NodeId]] = key(
        {}, "node ids by name; an empty one: there is no such node"
    )
    security: Literal["Basic256Sha256", "Aes128Sha256RsaOaep", "Aes256Sha256RsaPss", "none"] = key(
        "Basic256Sha256", "security policy; messages are signed and encrypted, but with none"
    )
    folder: File = key("opcua-client", "folder of the client's certificate and key, made where absent")
    server_certificate: File | None = key(None, "certificate of the PLC; without it any is taken")
    password_file: File | None = key(
        None,
        "TOML file with user and password, which others must not be able to read; "
        f"{VARIABLES['user']} and {VARIABLES['password']} in the environment take precedence",
    )
    heartbeat_s: Positive = key(1.0, "longest time in which the PLC's heartbeat may stand, s", le=60)

    @model_validator(mode="after")
    def _has_its_nodes(self) -> Self:
        if unknown := next((name for name in self.nodes if name not in NODES), None):
            raise broken_rule(f"there is no node '{unknown}'", "Write a name of docs/controller-opcua.md")
        if missing := [name for name, ids in self.node_ids().items() if not (ids or name in OPTIONAL)]:
            action = "Write them in nodes, or write node with {name} in it"
            raise broken_rule(f"no node id for {', '.join(missing)}", action)
        return self

    def node_ids(self) -> dict[str, tuple[str, ...]]:
        """The node ids of each name: one, or six, or none of a node that there is not."""
        pattern = self.node if "{name}" in self.node else ""
        each = {name: self.nodes.get(name, pattern.replace("{name}", name)) for name in NODES}
        return {name: (ids,) if isinstance(ids, str) and ids else tuple(ids) for name, ids in each.items()}

    def beside(self, folder: Path) -> Self:
        """The options with the files that they name found; ``folder`` has the cell file."""
        stated = {name: getattr(self, name) for name in ("folder", "server_certificate", "password_file")}
        return self.model_copy(update={name: str(folder / file) for name, file in stated.items() if file})

    def login(self) -> Login | None:
        """Who logs in, if anybody; raises as ``stated_login``, or ``UsageError`` if all could read it."""
        login = stated_login(self.password_file, Path(), VARIABLES)
        if login is not None and self.security == "none":
            raise UsageError("a password would be sent in clear", action="Choose another security")
        return login
