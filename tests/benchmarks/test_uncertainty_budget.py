"""The uncertainty budget of Table 1's machine: what each effect does, beside an independent simulation.

That had other poses, on which repeatability depends most: it is drawn on the poses of this one. Whether U
holds for machines that have all effects of their grade, moved without the first-order propagation that is
under test, is measured by ``test_worlds.py``.
"""

from dataclasses import replace

import numpy as np

from hexacell.campaign.planner import Plan
from hexacell.campaign.task_accuracy import Task
from hexacell.cell.model import CellSettings
from hexacell.cell.uncertainty import Grade, UncertaintySettings
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.identification.estimator import identify
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import MachinePart
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.stated import stated_effects
from hexacell.robot.virtual_robot import VirtualRobot
from hexacell.uncertainty import effect_kinds
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.uncertainty.effects import Effect
from hexacell.uncertainty.propagation import Propagation
from tests.benchmarks.figures import between
from tests.benchmarks.machines import bundled

ALUMINIUM = dict.fromkeys(MachinePart, 23.0)
TABLE: tuple[tuple[str, Effect, float], ...] = (
    ("common encoder scale 1e-4", effect_kinds.common_encoder_scale(100.0), 0.019),
    ("each encoder's scale 1e-4", effect_kinds.encoder_scales(100.0), 0.099),
    ("rails wavy 20 um, 600 mm long", effect_kinds.rail_waves(20.0, 600.0), 0.130),
    ("rails wavy 20 um, 1,500 mm long", effect_kinds.rail_waves(20.0, 1500.0), 0.058),
    ("rails sag 50 um", effect_kinds.common_sag(50.0, 800.0), 0.023),
    ("rails 0.1 mrad off parallel", effect_kinds.rail_directions(0.1), 0.099),
    ("gauge scale 1e-3", effect_kinds.gauge_scales(1.0, is_estimated=False), 0.001),
    ("ball 5 um out of round", effect_kinds.ball_roundness(5.0), 0.006),
    ("all 1 K warmer at work, aluminium", effect_kinds.temperature_at_work(1.0, ALUMINIUM), 0.006),
    ("20 N at 0.05 um/N a leg", effect_kinds.load_at_work(20.0, 0.05), 0.040),
)
SUMS: dict[Grade, float] = {"ideal": 0.063, "precision": 0.115, "ordinary": 0.161}
"""U by grade."""
STOPS_DRAWN = 200


def propagation_of(table_one, settings: CellSettings) -> Propagation:
    """Of a calibration, to the poses of the task at which the robot is judged."""
    # Passive joints of the independent simulation allow all poses within 45 deg.
    robot = replace(table_one.robot, limits=replace(table_one.robot.limits, legs=None))
    virtual = VirtualRobot(robot, table_one.truth, np.random.default_rng(1))
    campaign = VirtualCampaign(Plan(settings, robot, with_forecast=False), virtual)
    campaign.carry_out()
    robot = campaign.plan.robot  # with the geometries that commanded the records
    found = identify(robot.problem(campaign.measurements), find_outliers=False)
    belief = robot.belief(found)
    reached = Task.of(settings, robot, belief).reachable(belief)
    return Propagation(found, belief, reached.poses, reached.workspace)


def through_drawn_stops(propagation: Propagation, truth: Geometry, size_mm: float) -> float:
    """The error at the worst task pose, rms, of identifications whose sliders stop elsewhere by chance."""
    found = propagation.found
    problem, random = found.problem, np.random.default_rng(2)
    joints, mechanism = problem.joints, problem.mechanism

    def ball(at: Array, start: PoseBatch, geometry: Geometry) -> PoseBatch:
        return continue_solution(
            mechanism, truth, at, start=start, start_geometry=geometry, start_joints=joints
        ).poses

    exact = ball(joints, found.poses, found.geometry)
    free = mechanism.convention.free_parameters(truth)
    errors = []
    for _ in range(STOPS_DRAWN):
        shown = ball(joints + size_mm * random.standard_normal(joints.shape), exact, truth).positions
        deviations = shown - shown[problem.first_rows][problem.stations]
        drawn = identify(replace(problem, deviations=deviations), find_outliers=False)
        errors.append(np.einsum("tcp,p->tc", propagation.jacobian[:, :3], drawn.free - free))
    return float(np.sqrt((np.square(errors).sum(axis=-1)).mean(axis=0).max()))


def test_effects_and_their_sums_are_as_large_as_an_independent_simulation_says(table_one, figure) -> None:
    settings = bundled().settings
    propagation = propagation_of(table_one, settings)
    budget = UncertaintyBudget.of(propagation, tuple(effect for _, effect, _ in TABLE))
    for (name, _, beside), line in zip(TABLE, budget.lines, strict=True):
        near = between(0.5 * beside - 5e-4, 1.5 * beside + 5e-4)
        figure(f"{name}, at the worst task pose, mm: through the result", line.through_mm)
        figure(f"{name}: directly", line.direct_mm)
        figure(f"{name}: both, an independent simulation {beside}", line.combined_mm, "", near)
    stops = UncertaintyBudget.of(propagation, (effect_kinds.stop_repeatability(5.0),)).lines[0]
    words = "repeatability 5 um a slider, mm:"
    drawn_mm = through_drawn_stops(propagation, table_one.truth, 0.005)
    near = between(0.85 * drawn_mm, 1.15 * drawn_mm)
    figure(
        f"{words} through the result, identified from drawn stops {drawn_mm:.4f}",
        stops.through_mm,
        "",
        near,
    )
    figure(f"{words} directly", stops.direct_mm, "", between(0.98 * 0.038, 1.02 * 0.038))
    for grade, expanded in SUMS.items():
        of_grade = settings.model_copy(update={"uncertainty": UncertaintySettings(grade=grade)})
        budget = UncertaintyBudget.of(propagation, stated_effects(of_grade))
        figure(f"systematic u, grade {grade}", budget.systematic_mm, "mm")
        figure(f"  u, {grade}", budget.standard_mm, "mm")
        figure(f"  U, {grade}", budget.expanded_mm, "mm", between(0.8 * expanded, 1.2 * expanded))
