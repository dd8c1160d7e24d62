"""Poses across the workspace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexacell.design.candidates import workspace_poses


@pytest.fixture
def belief(know, paper):
    return know(paper.nominal, sigma_mm=1.0)


def test_level_and_tilted_at_every_point(belief, paper):
    poses = workspace_poses(belief, paper.points[:1])
    assert len(poses) == 7
    assert np.unique(np.round(np.degrees(poses.tilts()), 6)).tolist() == [0.0, 15.0]
    assert np.allclose(poses.positions, paper.points[0])


def test_tilts_keep_a_smaller_limit(belief, paper):
    narrow = replace(belief, limits=replace(belief.limits, tilt=np.radians(8.0)))
    assert np.degrees(workspace_poses(narrow, paper.points[:2]).tilts()).max() == pytest.approx(8.0)


def test_poses_out_of_reach_are_left_out(belief):
    assert len(workspace_poses(belief, np.array([[0.0, 2000.0, 500.0]]))) == 0
