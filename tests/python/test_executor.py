"""Sending plans, and what the executor tells."""

import itertools
import threading
import time

import numpy as np
import pytest

import nullsweep


def at(plan, time):
    """Where a plan has the joints: cubic between knots, by positions and velocities."""
    i = np.clip(np.searchsorted(plan.times, time, side="right") - 1, 0, len(plan) - 2)
    h = plan.times[i + 1] - plan.times[i]
    u = (time - plan.times[i]) / h
    basis = (2 * u**3 - 3 * u**2 + 1, h * (u**3 - 2 * u**2 + u), -2 * u**3 + 3 * u**2, h * (u**3 - u**2))
    ends = (plan.positions[i], plan.velocities[i], plan.positions[i + 1], plan.velocities[i + 1])
    return sum(share * end for share, end in zip(basis, ends))


def test_a_plan_is_sent_and_followed(stage, plan):
    events, seen = [], []
    executor = nullsweep.Executor(stage.cell)
    sent = nullsweep.publish(plan, stage.cell, event=events.append)
    assert f"plan {sent} accepted" in events[0]
    for now in itertools.islice(executor, 100):
        seen.append(now)
    assert all(b.sequence > a.sequence for a, b in zip(seen, seen[1:]))
    now = seen[-1]
    assert (now.mode, now.plan, now.fault, now.is_verified) == ("executing", sent, None, True)
    assert now.commanded.shape == now.measured.shape == (6,)
    assert np.abs(now.commanded - at(plan, now.plan_time)).max() < 1e-6
    assert executor.speed(0.5).speed == 0.5
    assert executor.pause().plan == sent
    stage.until(lambda: executor.telemetry.mode == "paused")
    held = executor.telemetry.plan_time
    executor.resume()
    stage.until(lambda: executor.telemetry.plan_time > held)
    executor.stop()
    stage.until(lambda: executor.status().mode == "hold")
    assert executor.status().plan is None
    with pytest.raises(nullsweep.Error, match="out of range"):
        executor.speed(7.0)
    # The arm is elsewhere now.
    with pytest.raises(nullsweep.Error, match="rejected"):
        nullsweep.publish(plan, stage.cell)


def test_an_executor_that_dies_is_lost(stage, plan):
    killer = threading.Timer(1.5, stage.executor.kill)
    killer.start()
    began = time.monotonic()
    with pytest.raises(nullsweep.LostError):
        nullsweep.publish(plan, stage.cell, wait=True)
    assert time.monotonic() - began < 10


def test_no_executor_is_told(tmp_path, plan):
    cell = nullsweep.Cell(ipc_root=tmp_path)
    with pytest.raises(nullsweep.Error, match="executor"):
        nullsweep.publish(plan, cell)
    executor = nullsweep.Executor(cell, timeout=0.2)
    with pytest.raises(TimeoutError, match="no telemetry"):
        next(executor)
    with pytest.raises(nullsweep.Error, match="executor"):
        executor.stop()
    with pytest.raises(nullsweep.UsageError, match="join"):
        nullsweep.publish(plan, cell, join="soon")
