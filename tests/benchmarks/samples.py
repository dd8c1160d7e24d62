"""How many samples each benchmark takes: in ``make bench``, and with ``FULL=1`` as the targets have it.

A variable of the environment of the same name takes precedence: ``ROBOTS=24 make bench ARGS=...``.
"""

import os

SAMPLES: dict[str, dict[str, tuple[int, int]]] = {
    "adapter": {"FAULTS": (200, 1000)},
    "change_alarm": {"RUNS": (48, 200)},
    "check": {"RUNS": (8, 100)},
    "damaged_lines": {"FRAMES": (5_000, 1_000_000)},
    "design_efficiency": {"ROBOTS": (10, 24)},
    "drift_watch": {"CELLS": (6, 100), "STEPS": (60, 300)},
    "encoder_rounds": {"ROUNDS": (3_000, 100_000)},
    "first_resume": {"KILLS": (2, 200)},
    "gauge_trials": {"TRIALS": (12, 100)},
    "guards": {"TIMES": (1, 3)},
    "healthy_robots": {"ROBOTS": (30, 1000)},
    "long_polling": {"HOURS": (1, 24)},
    "mechanisms": {"FAULTY": (16, 100), "ROBOTS": (6, 100)},
    "minutes": {"FIXED_PLANS": (200, 200), "MECHANISMS": (1, 4), "ROBOTS": (20, 20)},
    "motion_limits": {"CAMPAIGNS": (8, 1000), "COMPARED": (4, 6)},
    "mutations": {"MUTATIONS": (60, 10_000)},
    "paper_study": {"DRAWS": (20, 20)},
    "peers": {"ROBOTS": (2, 6)},
    "plc": {"FAULTY": (60, 1000), "MOVES": (40, 200)},
    "public_geometries": {"ROBOTS": (8, 100)},
    "quick_level": {"ROBOTS": (12, 100)},
    "recalibration": {"MACHINES": (4, 100)},
    "scatter": {"MACHINES": (4, 167)},
    "screen_speed": {"RUNS": (3, 5)},
    "statistics": {"PAIRED": (100, 100), "ROBOTS": (200, 1000), "SETS": (1000, 1000)},
    "terms": {"MACHINES": (6, 100)},
    "tolerances": {"BUILT": (300, 1500)},
    "worlds": {"RUNS": (1, 34)},
    "year": {"NIGHTS": (40, 365)},
}


def samples(benchmark: str) -> dict[str, int]:
    """How many samples a benchmark takes now, by their names; ``benchmark`` is its module."""
    column = int(os.environ.get("FULL", "0") == "1")
    listed = SAMPLES.get(benchmark.rpartition(".test_")[2] or benchmark, {})
    return {name: int(os.environ.get(name, sizes[column])) for name, sizes in listed.items()}


def sample(benchmark: str, name: str) -> int:
    """How many of one kind, see :func:`samples`."""
    return samples(benchmark)[name]
