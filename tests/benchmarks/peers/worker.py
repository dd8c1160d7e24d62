"""One peer in a process of its own: ``python -m tests.benchmarks.peers.worker PEER RECORDS RESULT``."""

from __future__ import annotations

import json
import pickle
import resource
import sys
import time
from dataclasses import asdict
from importlib import import_module
from pathlib import Path

from tests.benchmarks.peers.interface import Ended, Records, Solve, Solved


def main(peer: str, given: Path, result: Path) -> None:
    """Solve all sets of records in order."""
    try:
        solve = import_module(f"tests.benchmarks.peers.{peer}").solve
    except ImportError as error:
        ended = Ended(absent=str(error))
    else:
        every: list[Records] = pickle.loads(given.read_bytes())
        solved = tuple(_timed(solve, records) for records in every)
        ended = Ended(solved, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
    result.write_text(json.dumps(asdict(ended)))


def _timed(solve: Solve, records: Records) -> Solved:
    begun, worked = time.perf_counter(), time.process_time()
    try:
        geometry = tuple(map(float, solve(records)))
    except ArithmeticError:
        geometry = ()
    return Solved(geometry, time.perf_counter() - begun, time.process_time() - worked)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
