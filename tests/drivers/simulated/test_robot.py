"""The simulated robot as its controller moves it, with the geometry of the config."""

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.simulated.linuxcnc.state import MotionRefused
from drivers.simulated.robot import LINE_STEPS
from hexacell.config.toml_format import native_layout
from hexacell.errors import FileError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.pose import Pose
from tests.geometries import hexaglide_geometry

TILTED = Pose(5.0, -3.0, 548.0, 6.0, -4.0, 2.0)


def rewrite(twin: Any, geometry: Geometry) -> None:
    text = twin.config.read_text()
    twin.config.write_text(native_layout(HEXAGLIDE_PARAMETERS).rewrite([text], geometry)[0])


def test_moves_are_straight(twin) -> None:
    """At every piece of the line the sliders are where the geometry puts them for that pose."""
    paths: list[Any] = []
    real = twin.physics.start_motion

    def travel(path: Any, duration_s: Any) -> Any:
        paths.append(path)
        return real(path, duration_s)

    twin.physics.start_motion = travel
    target = Pose(30.0, -20.0, 540.0)
    twin.machine.move(target)
    (path,) = paths
    assert path.shape == (LINE_STEPS + 1, 6)
    middle = Pose(15.0, -10.0, 545.0)
    assert path[LINE_STEPS // 2] == pytest.approx(twin.joints_for(middle), abs=1e-9)


@pytest.mark.parametrize(
    "pose", [Pose(0.0, 0.0, 2000.0), Pose(0.0, 900.0, 550.0), Pose(0.0, 0.0, 550.0, 179.0, 0.0, 0.0)]
)
def test_a_pose_out_of_reach_is_refused_and_nothing_moves(twin, pose: Pose) -> None:
    twin.machine.move(TILTED)
    before, time_s = twin.physics.encoder_positions(), twin.clock.now()
    with pytest.raises(MotionRefused, match="kinematicsInverse"):
        twin.machine.move(pose)
    assert twin.clock.now() == time_s
    assert np.array_equal(twin.physics.encoder_positions(), before)
    assert twin.machine.pose().as_tuple() == pytest.approx(TILTED.as_tuple(), abs=1e-9)


def test_the_machine_stops_in_place(twin) -> None:
    def stop_half_way() -> None:
        twin.clock.time_s += 0.15
        twin.machine.stop()

    twin.clock.on_wait = stop_half_way
    twin.machine.move(Pose(4.0, 0.0, 550.0))
    there = Pose(2.0, 0.0, 550.0)
    twin.clock.time_s += 10.0
    assert twin.machine.pose().as_tuple() == pytest.approx(there.as_tuple(), abs=1e-6)
    assert twin.physics.encoder_positions() == pytest.approx(twin.joints_for(there), abs=1e-3)


def test_a_stop_while_the_line_is_computed_is_not_lost(twin, monkeypatch) -> None:
    real = twin.machine._joints

    def interrupted(poses: Any) -> Any:
        twin.machine.stop()
        return real(poses)

    monkeypatch.setattr(twin.machine, "_joints", interrupted)
    before = twin.physics.encoder_positions()
    twin.machine.move(TILTED)
    monkeypatch.undo()
    twin.clock.time_s += 10.0
    assert np.array_equal(twin.physics.encoder_positions(), before)
    assert twin.machine.pose().as_tuple() == pytest.approx((0.0, 0.0, 550.0, 0.0, 0.0, 0.0), abs=1e-9)


def test_a_stop_from_another_thread_ends_the_wait(make_twin) -> None:
    twin = make_twin(motion__minimum_s=1000.0)
    waiting = threading.Event()
    released = threading.Event()

    def wait(seconds: float, until: threading.Event | None = None) -> bool:
        assert until is not None
        waiting.set()
        assert until.wait()
        released.set()
        return True

    twin.clock.wait = wait
    mover = threading.Thread(target=twin.machine.move, args=(TILTED,))
    mover.start()
    assert waiting.wait()
    twin.machine.stop()
    mover.join()
    assert released.is_set()
    assert not mover.is_alive()


def test_switching_on_reads_the_geometry_and_moves_no_slider(twin) -> None:
    twin.machine.move(TILTED)
    sliders, seen = twin.physics.encoder_positions(), twin.seen()
    rewrite(twin, twin.truth)
    assert twin.machine.pose().as_tuple() == pytest.approx(TILTED.as_tuple(), abs=1e-9)
    twin.machine.switch_on()
    assert np.array_equal(twin.physics.encoder_positions(), sliders)
    assert np.array_equal(twin.seen(), seen)
    believed = twin.machine.pose()
    assert believed.position == pytest.approx(twin.ball_at(TILTED), abs=1e-6)
    assert twin.machine.joints() == pytest.approx(sliders, abs=1e-8)


def test_a_person_mounts_the_gauges_anew_where_another_geometry_brings_the_ball(twin) -> None:
    """However near that is: with the gauges of before, the plungers would be at an end of their travel."""
    near = Pose(6.0, 6.0, 550.0)
    twin.go(Pose(0.0, 0.0, 550.0))
    twin.physics.gauge_displacement("x")
    same = native_layout(HEXAGLIDE_PARAMETERS).read(twin.config).geometry
    for geometry, is_mounted in ((same, False), (twin.truth, True)):
        station = twin.physics.gauges.station
        rewrite(twin, geometry)
        twin.machine.switch_on()
        twin.go(near)
        twin.physics.gauge_displacement("x")
        assert np.array_equal(twin.physics.gauges.station, station) != is_mounted


def test_a_geometry_that_cannot_hold_the_sliders_is_refused(twin) -> None:
    shrunk = hexaglide_geometry(twin.truth["S"], twin.truth["B"], twin.truth["l"] / 3.0)
    kept = twin.config.read_text()
    rewrite(twin, shrunk)
    with pytest.raises(FileError, match="no pose at the present joint variables"):
        twin.machine.switch_on()
    twin.config.write_text(kept)
    twin.machine.move(TILTED)
    assert twin.physics.encoder_positions() == pytest.approx(twin.joints_for(TILTED), abs=1e-9)


def test_a_stop_near_the_dead_point_of_a_leg_leaves_joints_where_the_controller_has_them(twin) -> None:
    """There a slider goes far while the platform hardly moves, so that a coarse line would miss it."""
    twin.machine.move(Pose(-41.2, -29.6, 540.4, -5.7, -20.7, -7.0))
    twin.machine.move(Pose(31.7, 77.2, 593.5, 39.6, 2.3, -7.8))
    motion = twin.physics._motion
    for share in np.linspace(0.02, 0.98, 97):
        twin.physics._motion = replace(motion, stopped_s=motion.start_s + share * motion.duration_s)
        off = np.abs(np.array(twin.machine.joints()) - twin.physics.encoder_positions())
        assert off.max() < 0.5
