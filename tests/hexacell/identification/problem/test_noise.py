"""The noise of a record: that of each instrument, propagated to the ball."""

import numpy as np
import pytest

from hexacell.identification.problem.prior import Noise

ENCODERS = (0.01, 0.02, 0.005, 0.01, 0.03, 0.01)
GAUGES = (0.004, 0.05, 0.01)


def test_each_instrument_keeps_its_own_noise_and_what_else_is_stated() -> None:
    noise = Noise(0.01, 0.01, alignment=0.005, gauge_scale=0.001).with_devices(ENCODERS, GAUGES)
    assert noise.encoders == pytest.approx(np.array(ENCODERS))
    assert noise.gauges_mm == pytest.approx(np.array(GAUGES))
    assert noise.encoder == pytest.approx(np.sqrt(np.mean(np.square(ENCODERS))))
    assert (noise.alignment, noise.gauge_scale) == (0.005, 0.001)


def test_the_covariance_of_a_record_is_that_of_drawn_records() -> None:
    random = np.random.default_rng(1)
    by_joints = random.standard_normal((3, 6))
    encoders = ENCODERS * random.standard_normal((200_000, 6))
    drawn = encoders @ by_joints.T + GAUGES * random.standard_normal((200_000, 3))
    noise = Noise(1.0, 1.0).with_devices(ENCODERS, GAUGES)
    covariance = noise.record_covariance(by_joints[None])[0]
    assert covariance == pytest.approx(np.cov(drawn.T), rel=0.02, abs=2e-5)
