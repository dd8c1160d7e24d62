"""The section ``[controller]`` of the cell file: the robot's controller and the files with its geometry."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import SecretStr, model_validator

from hexacell.cell.fields import Password, Positive, Section, Text, broken_rule, key

StartupWord = Literal["reset-estop", "switch-on", "home"]
STARTUP_WORDS: tuple[StartupWord, ...] = ("reset-estop", "switch-on", "home")


class FurtherFileSettings(Section):
    """A file beside ``config`` that has the rest of the geometry; the keys mean what they mean there."""

    config: Text = key(..., "file with a part of the geometry, relative to the cell file")
    config_format: Text = key(..., "linuxcnc-ini, linuxcnc-hal, template, toml, or one that a plug-in adds")
    config_options: dict[str, Any] = key({}, "where that format finds the numbers, see docs/linuxcnc.md")
    taught: Text | None = key(None, "copy of this file, from the same day as that of the first one")


class ControllerSettings(Section):
    """The robot's controller and the file, or the files, with its geometry."""

    protocol: Text = key(
        "linuxcncrsh", "protocol of the controller: linuxcncrsh, or one that a plug-in adds"
    )
    host: Text = key("127.0.0.1", "network name or address of the controller")
    port: int | None = key(None, "TCP port of the controller", ge=1, le=65535)
    connect_password: Password = key(
        SecretStr("EMC"), "password that linuxcncrsh gets on connecting; better in password_file"
    )
    enable_password: Password = key(
        SecretStr("EMCTOO"), "password that linuxcncrsh gets to enable commands; better in password_file"
    )
    password_file: Text | None = key(
        None,
        "TOML file with connect_password and enable_password, relative to the cell file, which others "
        "must not be able to read. HEXACELL_CONNECT_PASSWORD and HEXACELL_ENABLE_PASSWORD in the "
        "environment take precedence",
        min_length=1,
    )
    config: Text = key(..., "file with the controller's geometry, relative to the cell file")
    config_format: Text = key(
        "toml", "toml, linuxcnc-ini, linuxcnc-hal, template, or one that a plug-in adds"
    )
    config_options: dict[str, Any] = key({}, "where that format finds the numbers, see docs/linuxcnc.md")
    taught: Text | None = key(
        None,
        "copy of config from when points and frames were taught last, relative to the cell file; without "
        "it, the config that runs when a run begins",
    )
    further_files: tuple[FurtherFileSettings, ...] = key(
        (),
        "files that have a part of the geometry each, if it is not all in config: every number must be "
        "in one of them, and in no other",
        max_length=8,
    )
    reload_command: tuple[Text, ...] = key(
        (), "command run with the machine off, so that the controller reads its config again"
    )
    startup: tuple[StartupWord, ...] = key(
        (),
        "what the program may do by itself to make the controller ready; a person is asked about the "
        "rest: reset-estop (the emergency stop that it starts in, before a run begins), switch-on, home",
        max_length=len(STARTUP_WORDS),
    )
    homing_timeout_s: Positive = key(60.0, "longest wait until all joints are homed, s")
    unit_mm: Positive = key(
        1.0, "one unit of the positions that the controller reports, mm; of an inch machine 25.4"
    )
    joints_include_zeros: bool = key(
        False,
        "whether the joints that the controller reports, and their limits in its config, include the "
        "zeros of its geometry: whole leg lengths, as LinuxCNC's genhexkins has them",
    )
    position_tolerance_mm: Positive = key(
        0.01, "largest position difference at which a move has arrived, mm"
    )
    angle_tolerance_deg: Positive = key(0.01, "largest angle difference at which a move has arrived, deg")

    @model_validator(mode="after")
    def _files_are_together(self) -> ControllerSettings:
        files = (self.config, *(one.config for one in self.further_files))
        if twice := next((name for name in files if files.count(name) > 1), None):
            raise broken_rule(f"the file {twice} is named twice", "Name each file once")
        taught = [self.taught, *(one.taught for one in self.further_files)]
        if any(taught) and not all(taught):
            raise broken_rule(
                "taught is stated for some of the files only", "State it for all of them, or leave it away"
            )
        return self

    @property
    def joint_unit_mm(self) -> float:
        """One unit of the joint variables that the controller reports, mm."""
        return self.unit_mm


class RotaryControllerSettings(ControllerSettings):
    """The controller of a robot whose joints turn."""

    @property
    def joint_unit_mm(self) -> float:
        """One degree: an inch machine reports angles in degrees too."""
        return 1.0
