"""``make bench-peers``: other methods and libraries against this program, on the same robots and records.

Each peer runs in a process of its own, one after the other. It is given, of every robot, records in poses
that are chosen in three ways, see ``robots``, as many of each; and smaller and larger sets, by which the
number of records is found that a tolerance takes.
"""

from __future__ import annotations

import argparse
import json
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path

from hexacell.errors import HexacellError
from hexacell.measurements.records import MeasurementSet
from tests.benchmarks.peers.comparison import WHOLE, Case, Comparison, Way
from tests.benchmarks.peers.interface import Ended, Records
from tests.benchmarks.peers.robots import StudiedRobot

PEERS = ("hexacell_estimator", "casadi_poses", "ceres_poses", "paper_least_squares", "full_poses")
CHOSEN_SIZES = (25, 30, 40, WHOLE)
"""The first of a campaign's records."""

RANDOM_ORIENTATIONS = (11, 22)
"""At each of five points."""

AIMED_ORIENTATIONS = (5, 8, 11)
"""Likewise."""


def cases_of(robot: StudiedRobot) -> list[tuple[Case, Records]]:
    """All sets of records of a robot.

    Raises:
        HexacellError: it cannot give them.
    """
    campaign = robot.chosen()
    sets = [(Way.CHOSEN, MeasurementSet(campaign.records[:size])) for size in CHOSEN_SIZES]
    sets += [(Way.RANDOM, robot.random(count)) for count in RANDOM_ORIENTATIONS]
    sets += [(Way.AIMED, robot.aimed(count)) for count in AIMED_ORIENTATIONS]
    return [(Case(robot.number, way, len(some.records)), robot.records(some)) for way, some in sets]


def solve(peer: str, records: list[Records]) -> Ended:
    """What a peer makes of them, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        given, result = Path(folder) / "records", Path(folder) / "result.json"
        given.write_bytes(pickle.dumps(records))
        subprocess.run(
            [sys.executable, "-m", "tests.benchmarks.peers.worker", peer, str(given), str(result)],
            check=True,
        )
        return Ended.of(json.loads(result.read_text()))


def compare(count: int, peers: tuple[str, ...] = PEERS) -> Comparison:
    """So many robots; one that cannot give the records is passed over."""
    robots: dict[int, StudiedRobot] = {}
    every: list[tuple[Case, Records]] = []
    number = 0
    while len(robots) < count:
        robot = StudiedRobot.drawn(number)
        try:
            every += cases_of(robot)
        except HexacellError as error:
            print(f"robot {number} is passed over: {error}", file=sys.stderr)
        else:
            robots[number] = robot
        number += 1
    cases = [case for case, _ in every]
    found = Comparison()
    for peer in peers:
        print(f"{peer} solves {len(cases)} sets", file=sys.stderr)
        ended = solve(peer, [records for _, records in every])
        found.add(peer, cases, ended, robots)
    return found


def main() -> None:
    """Print the table; the figures go into a file as well."""
    parser = argparse.ArgumentParser(prog="make bench-peers")
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--output", type=Path, default=Path("build/peers.json"))
    options = parser.parse_args()
    found = compare(options.robots)
    for line in found.lines():
        print(line)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    options.output.write_text(json.dumps(found.document(), indent=2))


if __name__ == "__main__":
    main()
