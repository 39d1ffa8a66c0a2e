"""How long a plan takes beside `planner plan`, and inverse kinematics for each solution, beside EAIK
where it is there. In one run, in turns, the best of each. Plans are compared by processor time, which
other work on the machine changes least; wall-clock time is told beside it.

    tests/python/run --measure
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

import nullsweep

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
ROUNDS = 5
POSES = 20_000


def clock(work):
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def processor():
    """What this process and those that it has waited for have used. [s]"""
    return sum(os.times()[:4])


def both(work):
    """Wall-clock and processor time."""
    before = processor()
    wall = clock(work)
    return wall, processor() - before


def plans():
    """The chair's seat, by both."""
    settings = dict(base="-0.708,-0.004,1.047", torso=0.2, ik_samples=20)
    with tempfile.TemporaryDirectory() as folder:
        words = [f"--{k.replace('_', '-')}={v}" for k, v in settings.items()]
        command = [pathlib.Path(os.environ["NULLSWEEP_BINS"]) / "planner", "plan", "--demo",
                   "chair-seat", "--out", f"{folder}/theirs.json", "--cell=", *words]
        theirs = lambda: subprocess.run(command, check=True, capture_output=True)

        def ours():
            plan = nullsweep.plan(nullsweep.Scan.demo("chair-seat"), **settings)
            plan.write(f"{folder}/ours.json")

        times = [(both(theirs), both(ours)) for _ in range(ROUNDS)]
        same = (pathlib.Path(folder) / "ours.json").read_bytes() == \
            (pathlib.Path(folder) / "theirs.json").read_bytes()
    (wall, cpu), (our_wall, our_cpu) = (
        [min(t[side][kind] for t in times) for kind in range(2)] for side in range(2))
    print(f"plan: planner {cpu:.2f} s of a processor ({wall:.2f} s), Python {our_cpu:.2f} s "
          f"({our_wall:.2f} s), ratio {our_cpu / cpu:.3f} ({our_wall / wall:.3f}); "
          f"{'the same to the bit' if same else 'NOT the same'}; each {ROUNDS} times, the best")
    return same and our_cpu / cpu <= 1.05


def inverse():
    """All solutions of poses, one thread each."""
    cells = {"PR2's right arm, 7 joints, 1 value of the redundancy": nullsweep.Cell(),
             "sample arm, 6 joints": nullsweep.Cell(ROOT / "examples/sample/cell.toml")}
    for name, cell in cells.items():
        arm = cell.arm
        low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
        q = np.random.default_rng(1).uniform(low, high, (POSES, arm.dof))
        poses = arm.fk(q)
        how = {} if arm.redundancy is None else {"redundancy": [-0.5]}
        best = min(clock(lambda: arm.ik(poses, **how)) for _ in range(ROUNDS))
        count = len(arm.ik(poses, **how))
        one = min(clock(lambda: [arm.ik(p, **how) for p in poses[:2000]]) for _ in range(ROUNDS))
        print(f"inverse kinematics, {name}: {1e6 * best / POSES:.2f} µs a pose, "
              f"{1e6 * best / count:.2f} µs a solution ({count} of {POSES} poses); pose by pose "
              f"{1e6 * one / 2000:.2f} µs a pose")
        if arm.dof == 6:
            beside(cell, arm, poses)


def beside(cell, arm, poses):
    """EAIK on the same arm, by its own URDF reader."""
    try:
        from eaik.IK_URDF import UrdfRobot
    except ImportError:
        print("EAIK is not here: pip install eaik")
        return
    robot = UrdfRobot(str(ROOT / "examples/sample/arm.urdf"))
    # Its end is the last joint's, ours the flange.
    at = np.zeros(6)
    tip = np.linalg.inv(robot.fwdKin(at)) @ arm.fk(at)
    theirs = poses @ np.linalg.inv(tip)
    best = min(clock(lambda: robot.IK_batched(theirs, 1)) for _ in range(ROUNDS))
    found = robot.IK_batched(theirs, 1)
    count = sum(len(one.Q) for one in found)
    every = min(clock(lambda: arm.ik(poses, within_limits=False)) for _ in range(ROUNDS))
    ours = len(arm.ik(poses, within_limits=False))
    print(f"  EAIK: {1e6 * best / len(poses):.2f} µs a pose, {1e6 * best / count:.2f} µs a solution "
          f"({count}); ours beside it {1e6 * every / len(poses):.2f} and {1e6 * every / ours:.2f} µs "
          f"({ours})")


if __name__ == "__main__":
    if "--inverse" in sys.argv:
        inverse()
        sys.exit(0)
    sound = plans()
    # A process of its own: how many threads there are is asked once.
    one = dict(os.environ, RAYON_NUM_THREADS="1")
    subprocess.run([sys.executable, __file__, "--inverse"], check=True, env=one)
    sys.exit(0 if sound else 1)
