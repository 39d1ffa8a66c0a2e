"""Kinematics by rows."""

import numpy as np
import pytest

import nullsweep


@pytest.fixture(params=["pr2", "sample"])
def arm(request, cell):
    return cell.arm if request.param == "sample" else nullsweep.Cell(arm="left", torso=0.2).arm


def postures(arm, n, seed=1):
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    return np.random.default_rng(seed).uniform(low + 0.2, high - 0.2, (n, arm.dof))


def test_one_row_is_one_of_many(arm):
    q = postures(arm, 300)
    poses, jacobians = arm.fk(q), arm.jacobian(q)
    assert poses.shape == (300, 4, 4) and jacobians.shape == (300, 6, arm.dof)
    assert (arm.fk(q[7]) == poses[7]).all() and (arm.jacobian(q[7]) == jacobians[7]).all()
    assert arm.fk(q[:0]).shape == (0, 4, 4)
    turn = poses[:, :3, :3]
    assert np.allclose(turn @ turn.transpose(0, 2, 1), np.eye(3), atol=1e-12)


def test_the_jacobian_is_how_the_tip_moves(arm):
    q, h = postures(arm, 40), 1e-6
    jacobian = arm.jacobian(q)
    for j in range(arm.dof):
        step = np.eye(arm.dof)[j] * h
        after, before = arm.fk(q + step), arm.fk(q - step)
        linear = (after[:, :3, 3] - before[:, :3, 3]) / (2 * h)
        spin = after[:, :3, :3] @ before[:, :3, :3].transpose(0, 2, 1) / (2 * h)
        angular = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        assert np.allclose(jacobian[:, :3, j], linear, atol=1e-6)
        assert np.allclose(jacobian[:, 3:, j], angular, atol=1e-6)


def test_all_solutions_bring_the_tip_there(arm):
    q = postures(arm, 100)
    poses = arm.fk(q)
    # The posture that each came from is among them, but for whole turns.
    at = arm.redundancy and arm.joints.index(arm.redundancy[0])
    for i, (pose, posture) in enumerate(zip(poses, q)):
        how = {} if at is None else {"redundancy": posture[at]}
        found = arm.ik(pose, within_limits=False, **how)
        assert (found.row == 0).all()
        assert at is None or np.allclose(found.redundancy, posture[at])
        apart = np.abs((found.q - posture + np.pi) % (2 * np.pi) - np.pi).max(axis=1)
        assert apart.min(initial=9.0) < 1e-4, i


def test_many_poses_are_solved_at_once_inside_the_limits(arm):
    q = postures(arm, 300)
    poses = arm.fk(q)
    found = arm.ik(poses)
    assert len(found) > len(q) / 2 and (np.diff(found.row) >= 0).all()
    assert np.abs(arm.fk(found.q) - poses[found.row]).max() < 1e-6
    assert (found.q >= arm.lower).all() and (found.q <= arm.upper).all()
    if arm.redundancy is not None:
        assert len(set(found.redundancy)) == 24
    one = arm.ik(poses[5])
    assert (one.q == found.q[found.row == 5]).all() and len(one) == (found.row == 5).sum()
    assert found.branch.shape == found.row.shape == (len(found),)


def test_a_tool_is_ahead_of_the_tip(cell):
    arm = cell.arm
    q = postures(arm, 20)
    contact = arm.fk(q, tool=True)
    ahead = np.linalg.norm(contact[:, :3, 3] - arm.fk(q)[:, :3, 3], axis=1)
    assert np.allclose(ahead, 0.12)
    found = arm.ik(contact, tool=True)
    assert np.abs(arm.fk(found.q, tool=True) - contact[found.row]).max() < 1e-6
    assert set(found.row) == set(range(20))


def test_matrices_and_quaternions_are_the_same(cell):
    arm = cell.arm
    pose = np.eye(4)
    pose[:3, 3], pose[:3, :3] = (0.4, 0.1, 0.3), np.diag([1.0, -1.0, -1.0])
    one, other = arm.ik(pose), arm.ik([0.4, 0.1, 0.3, 1, 0, 0, 0])
    assert len(one) > 0 and np.allclose(one.q, other.q, atol=1e-9)


def test_what_cannot_be_is_refused(cell):
    arm = cell.arm
    with pytest.raises(TypeError, match=r"\(6,\) or \(n, 6\)"):
        arm.fk(np.zeros(7))
    with pytest.raises(ValueError, match="finite"):
        arm.fk([0, 0, np.nan, 0, 0, 0])
    with pytest.raises(ValueError, match="rigid"):
        arm.ik(2 * np.eye(4))
    with pytest.raises(TypeError, match=r"\(4, 4\)"):
        arm.ik(np.zeros(3))
    # Far away there is none.
    assert len(arm.ik([9.0, 0, 0, 0, 0, 0, 1])) == 0
