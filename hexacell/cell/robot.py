"""Sections of the cell file: the mechanism with its drawing, and its controller with the geometry."""

from functools import cache
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import SecretStr, model_validator

from hexacell.cell.fields import (
    Direction,
    GeometrySettings,
    Host,
    InRange,
    Password,
    PointInRange,
    Positive,
    Section,
    Six,
    Text,
    broken_rule,
    key,
)
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism, with_coordinates
from hexacell.kinematics.mechanisms.encoder_scales import WithEncoderScales
from hexacell.kinematics.mechanisms.gough_stewart import GOUGH_STEWART_PARAMETERS, ScrewLegs
from hexacell.kinematics.pose import AXES
from hexacell.plugins import Group, created

StartupWord = Literal["reset-estop", "switch-on", "home"]
STARTUP_WORDS: tuple[StartupWord, ...] = ("reset-estop", "switch-on", "home")

DEFAULT_MECHANISM = "hexaglide"
SCREW_MECHANISM = "gough-stewart"
DEFAULT_CONTROLLER = "linuxcncrsh"


class ScrewSettings(Section):
    """Screws that are not held against turning, in legs between universal joints."""

    lead_mm: InRange = key(..., "lead of the screws, mm a turn; below zero for left-handed threads")
    base_axes: Six[Direction] = key(
        ..., "axes of the joints on the base that the legs turn about, in the base frame, legs 1 to 6"
    )
    platform_axes: Six[Direction] = key(
        ...,
        "axes of the joints on the platform that the legs turn about, in the platform frame, legs 1 to 6",
    )


class RobotSettings(Section):
    """The mechanism and its drawing."""

    mechanism: Text = key(
        DEFAULT_MECHANISM,
        "name of the mechanism: hexaglide, gough-stewart, six-rails, rotary-cranks, or one that a "
        "plug-in adds",
    )
    nominal: GeometrySettings = key(..., "geometry by the drawing, with which identification starts")
    encoder_scales: bool = key(
        False,
        "whether errors of the encoders' scales are identified too: encoder_scale in drawing, tolerances "
        "and the controller's config, which needs a place for them",
    )
    screws: ScrewSettings | None = key(
        None, "screws of a Gough-Stewart platform whose legs may turn in their nuts"
    )

    @model_validator(mode="after")
    def _screws_are_legs(self) -> Self:
        if self.screws is not None and self.mechanism != SCREW_MECHANISM:
            raise broken_rule(
                f"the legs of {self.mechanism} are no screws",
                f'Remove [robot.screws], or write mechanism = "{SCREW_MECHANISM}"',
            )
        return self

    def built(self) -> Mechanism:
        """The mechanism, with what is stated of it; raises ``UsageError`` if it is not installed."""
        if self.screws is None:
            return mechanism_of(self.mechanism, encoder_scales=self.encoder_scales)
        drawn = self.nominal.model_dump()
        return _screw_legs(
            self.screws, drawn["base"], drawn["platform"], encoder_scales=self.encoder_scales
        )


@cache
def mechanism_of(name: str, *, encoder_scales: bool) -> Mechanism:
    """A mechanism, with errors of its encoders' scales or not; ``UsageError`` if it is not installed."""
    found = with_coordinates(created(Group.MECHANISMS, name))
    return WithEncoderScales(found) if encoder_scales else found


@cache
def _screw_legs(
    settings: ScrewSettings, base: Six[PointInRange], platform: Six[PointInRange], *, encoder_scales: bool
) -> Mechanism:
    axes = np.array(settings.base_axes), np.array(settings.platform_axes)
    drawn: dict[str, ArrayLike] = {"base": base, "platform": platform, "offset": np.zeros(6)}
    legs = ScrewLegs(settings.lead_mm, *axes, Geometry.of(GOUGH_STEWART_PARAMETERS, drawn))
    return WithEncoderScales(legs) if encoder_scales else legs


FORMATS = "toml, json, yaml, urdf, linuxcnc-ini, linuxcnc-hal, template, or one that a plug-in adds"


class FurtherFileSettings(Section):
    """A file beside ``config`` that has the rest of the geometry; the keys mean what they mean there."""

    config: Text = key(..., "file with a part of the geometry, relative to the cell file")
    config_format: Text = key(..., FORMATS)
    config_options: dict[str, Any] = key({}, "where that format finds the numbers, see docs/linuxcnc.md")
    taught: Text | None = key(None, "copy of this file, from the same day as that of the first one")


class ControllerOptions(Section):
    """What one protocol needs beside the keys that all have: ``Options`` of its driver is derived of it."""

    def beside(self, folder: Path) -> Self:
        """The options with the files that they name found; ``folder`` has the cell file."""
        del folder  # these name none
        return self


class ControllerSettings(Section):
    """The robot's controller and the file, or the files, with its geometry."""

    protocol: Text = key(
        DEFAULT_CONTROLLER, "protocol of the controller: linuxcncrsh, adapter, or one that a plug-in adds"
    )
    options: ControllerOptions = key(
        ControllerOptions(), "what this protocol needs beside the keys that all have"
    )
    coordinates: Text = key(
        AXES, "those of a pose that the controller takes: xyzabc, or fewer where the mechanism has fewer"
    )
    host: Host = key("127.0.0.1", "network name or address of the controller")
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
    config_format: Text = key("toml", FORMATS)
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
    def _files_are_together(self) -> "ControllerSettings":
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
