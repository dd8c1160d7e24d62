"""Results for other machines, by OPC UA: where they are served, and who may read them."""

from __future__ import annotations

from pydantic import Field

from hexacell.cell.fields import Section, Text


class OpcUaSettings(Section):
    """The server that ``hexacell serve`` starts; its messages are always signed and encrypted."""

    host: Text = Field("127.0.0.1", min_length=1, description="address it listens at")
    port: int = Field(4840, ge=1, le=65535, description="TCP port")
    folder: Text = Field(
        "opcua",
        min_length=1,
        description="for its certificate and private key, relative to the cell file; made where absent",
    )
    password_file: Text | None = Field(
        None,
        min_length=1,
        description="TOML file with user and password of who may read, relative to the cell file, which "
        "others must not be able to read. HEXACELL_OPCUA_USER and HEXACELL_OPCUA_PASSWORD in the "
        "environment take precedence",
    )
    anonymous: bool = Field(False, description="whether anybody may read, without a password")
    poll_s: float = Field(
        2.0, ge=0.05, le=3600, allow_inf_nan=False, description="between looks for new runs"
    )
