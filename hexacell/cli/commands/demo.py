"""``hexacell demo``: the whole job with nothing attached."""

from __future__ import annotations

import argparse

from hexacell.application.demo import prepare_demo
from hexacell.cli.console import Console
from hexacell.cli.run_session import run_to_end
from hexacell.errors import ExitCode
from hexacell.presentation.run import demo_opening


def main(options: argparse.Namespace) -> ExitCode:
    """Copy a simulated cell into a folder of its own and calibrate it there."""
    console = Console(options.json)
    request = prepare_demo(options.folder, options.config)
    console.print(demo_opening(request.cell.config_path))
    return run_to_end(request, console)
