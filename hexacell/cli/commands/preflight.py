"""``hexacell preflight``: everything that must hold before motion."""

from __future__ import annotations

import argparse
import asyncio
from dataclasses import asdict

from hexacell.application.calibration_run import preflight
from hexacell.campaign.dry_run import dry_run
from hexacell.campaign.feasibility import unreachable_share
from hexacell.campaign.planner import Plan
from hexacell.campaign.pose_list import pose_list_of
from hexacell.cell.loader import load_cell
from hexacell.cli.console import Console
from hexacell.errors import ExitCode
from hexacell.presentation.devices import device_words
from hexacell.presentation.layout import wrapped
from hexacell.presentation.planning import foretold_words
from hexacell.robot_model import robot_of
from procedures.calibration.workflow import Mode


def main(options: argparse.Namespace) -> ExitCode:
    """Check, move nothing, report every failure at once; then foretell what the plan will give."""
    console = Console(options.json)
    cell = load_cell(options.cell)
    found = asyncio.run(preflight(cell, Mode.OPTIMISE, unattended=options.unattended))
    for identity in found:
        console.say(wrapped(f"ok  {device_words(identity)}", indent=6))
    console.say("ok  all points can be reached, all devices answer; nothing was moved")
    console.say("Trying the plan on simulated robots within the tolerances, some seconds ...")
    plan = Plan(cell.settings, robot_of(cell), pose_list_of(cell))
    foretold, lost = dry_run(plan), unreachable_share(plan)
    console.document(
        {
            "ready": True,
            "devices": [identity.model_dump() for identity in found],
            "expected": asdict(foretold) | {"lost": {str(point): share for point, share in lost.items()}},
        }
    )
    for line in foretold_words(foretold, lost, target_mm=cell.settings.identification.target_mm):
        console.say(wrapped(line))
    return ExitCode.DONE
