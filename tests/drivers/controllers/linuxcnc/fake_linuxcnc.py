"""LinuxCNC's Python module as its documentation has it, with a robot that is there at once."""

import re
from collections.abc import Callable, Iterator
from itertools import repeat
from types import SimpleNamespace

ANGULAR, LINEAR = 2, 1
INTERP_IDLE, INTERP_READING = 1, 2
MODE_MANUAL, MODE_AUTO, MODE_MDI = 1, 2, 3
NML_ERROR, OPERATOR_ERROR, OPERATOR_TEXT = 1, 11, 12
RCS_DONE, RCS_EXEC, RCS_ERROR = 1, 2, 3
STATE_ESTOP, STATE_ESTOP_RESET, STATE_OFF, STATE_ON = 1, 2, 3, 4
TRAJ_MODE_FREE, TRAJ_MODE_COORD, TRAJ_MODE_TELEOP = 1, 2, 3
MACHINE = (0.0,) * 9


class FakeLinuxcnc(SimpleNamespace):
    """The module; tests change ``now``, what its task tells, and the rest of its attributes.

    Attributes:
        blocks: that it was given.
        messages: that its error channel will give.
        fails: whether its status cannot be read.
        is_frozen: whether its task receives no command.
        breaks_off: a mode that another client takes as soon as a block is begun.
    """

    class error(Exception):  # noqa: N801 - as it is called
        """Of the module."""

    def __init__(self, linear_units: float = 1.0) -> None:
        super().__init__(**{name: value for name, value in globals().items() if name.isupper()})
        self.version = "2.9"
        self.blocks: list[str] = []
        self.messages: Iterator[tuple[int, str]] = iter(())
        self.fails = self.is_frozen = False
        self.breaks_off: int | None = None
        self.now = SimpleNamespace(
            linear_units=linear_units,
            angular_units=1.0,
            ini_filename="/home/hexa/hexa.ini",
            task_state=STATE_ON,
            task_mode=MODE_MANUAL,
            interp_state=INTERP_IDLE,
            motion_mode=TRAJ_MODE_FREE,
            state=RCS_DONE,
            echo_serial_number=0,
            joints=6,
            homed=(1,) * 16,
            joint=[{"jointType": LINEAR, "homing": 0}] * 16,
            joint_actual_position=(2.0,) * 16,
            inpos=True,
            queue=0,
            position=(0.0,) * 9,
            gcodes=(0, 0, 200, 900, 940, 540),
            settings=(0.0, 12.5, 0.0),
            feedrate=1.0,
            g5x_offset=MACHINE,
            g92_offset=MACHINE,
            tool_offset=MACHINE,
        )

    def stat(self) -> SimpleNamespace:
        found = SimpleNamespace()

        def poll() -> None:
            if self.fails:
                raise self.error("emcStatusBuffer invalid err=3")
            vars(found).update(vars(self.now), actual_position=self.now.position)

        found.poll = poll
        return found

    def error_channel(self) -> SimpleNamespace:
        return SimpleNamespace(poll=lambda: next(self.messages, None))

    def flood(self, text: str) -> None:
        """Give this error without end."""
        self.messages = repeat((OPERATOR_ERROR, text))

    def command(self) -> SimpleNamespace:
        made = SimpleNamespace(serial=0)

        def given(carry_out: Callable[..., object]) -> Callable[..., None]:
            def command(*arguments: object) -> None:
                made.serial = self.now.echo_serial_number + 1
                if not self.is_frozen:
                    self.now.echo_serial_number += 1
                    carry_out(*arguments)

            return command

        made.mode = given(lambda mode: setattr(self.now, "task_mode", mode))
        made.mdi, made.abort = given(self._execute), given(lambda: None)
        made.state = made.home = made.teleop_enable = given(lambda _value: None)
        return made

    def _execute(self, block: str) -> None:
        self.blocks.append(block)
        if found := re.match("G21 G53 G93 G1 X(.*) Y(.*) Z(.*) A(.*) B(.*) C(.*) F", block):
            if self.breaks_off is not None:
                self.now.task_mode, self.breaks_off = self.breaks_off, None
                return
            x, y, z, *angles = (float(word) for word in found.groups())
            units = self.now.linear_units
            self.now.position = (x * units, y * units, z * units, *angles, 0.0, 0.0, 0.0)
            self.now.gcodes = (0, 10, 210, 900, 930, 540)
