"""Poses and their inverse."""

from math import pi
from pathlib import Path

import kincal
import numpy as np
import pytest
from conftest import MACHINES


@pytest.fixture
def arm() -> kincal.Machine:
    return kincal.load_machine(MACHINES / "six_r_arm.ron")


def test_joints_have_names_units_and_travel(arm: kincal.Machine) -> None:
    assert arm.commands == ["q1", "q2", "q3", "q4", "q5", "q6"]
    assert {joint["unit"] for joint in arm.joints} == {"rad"}
    low, high = arm.joints[0]["travel"]
    assert low == pytest.approx(-high) and high > 2
    assert kincal.load_machine(MACHINES / "linear_axis.ron").joints[0]["unit"] == "m"
    assert "six_r_arm" in repr(arm)


def test_the_inverse_brings_the_tool_to_its_poses(arm: kincal.Machine) -> None:
    t = np.linspace(0, 1, 50)
    q = np.stack([0.4 * np.sin(3 * t), 0.2 + 0.2 * t, 0.3 * t, 0.3 + 0.1 * t, 0.7 + 0.2 * np.sin(5 * t), 0.2 * t], axis=1)
    goals = arm.poses(q)
    assert goals.shape == (50, 4, 4)
    found = kincal.inverse(arm, goals, start=q[0])
    assert found["reached"].all() and set(found["outcome"]) == {"reached"}
    np.testing.assert_allclose(arm.poses(found["commands"]), goals, atol=1e-9)
    np.testing.assert_allclose(found["commands"], q, atol=1e-7)
    assert found["position_left_m"].max() < 1e-9 and found["angle_left_rad"].max() < 1e-9


def test_one_pose_of_a_linear_axis_is_its_place() -> None:
    axis = kincal.load_machine(MACHINES / "linear_axis.ron")
    [there] = axis.poses([0.2])
    np.testing.assert_allclose(there[:3, 3] - axis.poses([0.0])[0, :3, 3], [0.2, 0, 0], atol=1e-15)
    np.testing.assert_allclose(there[:3, :3], np.eye(3), atol=1e-15)


def test_a_calibrated_machine_reaches_what_the_declared_one_misses(tracked: Path) -> None:
    declared = kincal.load_machine(MACHINES / "scara.ron")
    calibrated, _ = kincal.calibrate(declared, tracked)
    q = np.array([[0.3, 0.5, 0.1, 0.2]])
    goal = declared.poses(q)
    found = kincal.inverse(calibrated, goal, q, mode="position")
    miss = np.linalg.norm((calibrated.poses(q) - goal)[0, :3, 3])
    left = np.linalg.norm((calibrated.poses(found["commands"]) - goal)[0, :3, 3])
    assert miss > 1e-5 and left < 1e-9


def test_a_joint_that_ends_before_the_goal_is_named(arm: kincal.Machine) -> None:
    beyond = [175 * pi / 180, 0.2, 0.3, 0.0, 0.9, 0.0]
    near = [165 * pi / 180, 0.2, 0.3, 0.0, 0.9, 0.0]
    found = kincal.inverse(arm, arm.poses(beyond), near)
    assert not found["reached"][0] and "q1 would have to go 0.0872" in found["outcome"][0]
    assert kincal.inverse(arm, arm.poses(beyond), near, within_travel=False)["reached"].all()


def test_a_tip_and_free_joints_count(arm: kincal.Machine) -> None:
    tip = np.eye(4)
    tip[2, 3] = 0.05
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.8, 0.1])
    found = kincal.inverse(arm, arm.poses(q) @ tip, q + 0.01, tip=tip)
    np.testing.assert_allclose(found["commands"], [q], atol=1e-8)
    held = kincal.inverse(arm, arm.poses(q), q + 0.01, free=["q1", "q2", "q3"], mode="position")
    np.testing.assert_array_equal(held["commands"][0, 3:], q[3:] + 0.01)
    assert held["reached"].all()
