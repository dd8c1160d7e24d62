"""Where the program of an adapter is: ``[controller.options]`` of the cell file."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from pydantic import field_validator, model_validator

from drivers.controllers.adapter.local_program import LocalRobot
from hexacell.addresses import require_host
from hexacell.cell.fields import Text, accepted, broken_rule, key
from hexacell.cell.robot import ControllerOptions


@dataclass(frozen=True, slots=True)
class Program:
    """A program that serves a controller by the adapter protocol.

    Attributes:
        command: what starts it; empty where it is connected to.
        address: host and port of its TCP server.
        robot: makes the robot that is served within this process, where no other one does.
        settings: what it is told with ``hello``; what is secret of it enters no trace, log or message.
        name: the controller as messages name it.
        protocol: the name of its protocol in the cell file.
    """

    name: str
    command: tuple[str, ...] = ()
    address: tuple[str, int] = ("", 0)
    robot: Callable[[], LocalRobot] | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    protocol: str = "adapter"


class AdapterOptions(ControllerOptions):
    """A program that is started, or one that is connected to."""

    command: tuple[Text, ...] = key(
        (),
        "the program that is started, and its arguments; files beside the cell file are found",
        max_length=50,
    )
    address: Text | None = key(None, "host:port of the program's TCP server, if it is not started")
    settings: dict[str, Any] = key({}, "whatever the program wants to know")

    @field_validator("address")
    @classmethod
    def _has_a_port(cls, address: str | None) -> str | None:
        if address is not None:
            host, port = _host_and_port(address)
            accepted(host, require_host)
            if not 0 < port <= 65535:
                raise broken_rule(f"{address} has no port", 'Write host:port, as "10.0.0.5:6001"')
        return address

    @model_validator(mode="after")
    def _is_one_of_them(self) -> Self:
        if bool(self.command) == (self.address is not None):
            raise broken_rule(
                "one of command and address is needed, and only one",
                'Write command = ["python3", "robot.py"] or address = "10.0.0.5:6001"',
            )
        return self

    def beside(self, folder: Path) -> Self:
        """The options with absolute paths for the words that name files beside the cell file."""
        found = [str((folder / one).resolve()) if (folder / one).is_file() else one for one in self.command]
        return self.model_copy(update={"command": tuple(found)})

    @property
    def program(self) -> Program:
        """The program that they name."""
        if self.address is None:
            name = next((one for one in reversed(self.command) if not one.startswith("-")), "")
            return Program(f"controller {Path(name).name}", self.command, settings=self.settings)
        place = _host_and_port(self.address)
        return Program(f"controller {self.address}", address=place, settings=self.settings)


def _host_and_port(address: str) -> tuple[str, int]:
    """Both parts of ``host:port``; 0 where there is no port."""
    host, _, port = address.rpartition(":")
    return host, int(port) if port.isdecimal() else 0
