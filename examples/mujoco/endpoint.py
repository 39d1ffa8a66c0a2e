"""A PR2 arm in MuJoCo as the executor's hardware endpoint: setpoints in, joint states out, 1 kHz.

    python3 endpoint.py PLAN.json [--picture arm.png] [--json figures.json]
    python3 endpoint.py --check

Stands where the plan begins. At its end (SIGINT, SIGTERM) it tells the tracking error while plans
ran and how much of the plan's surface the measured positions have swept. `cargo run --release
--bin demo -- --hardware mujoco` runs it with everything around it. Exit code 77: packages are
missing; it says which. --check does no more than that.
"""

import argparse
import collections
import importlib.metadata
import json
import math
import os
import pathlib
import signal
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "python"))

NEEDED = {"mujoco": None, "numpy": None, "matplotlib": None, "xxhash": None, "iceoryx2": "0.10.0"}


def need_packages():
    lacking = []
    for name, version in NEEDED.items():
        try:
            found = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found = None
        if found is None or version not in (None, found):
            lacking.append(name if version is None else f"{name}=={version}")
    if lacking:
        print(f"missing for {sys.executable}:\n    pip install {' '.join(lacking)}")
        sys.exit(77)


need_packages()

import mujoco
import numpy as np

import model as arm_model
import nullsweep_ipc
import nullsweep_types as types

STEP_NS = 1_000_000
START_TOLERANCE = 0.02


class Simulation:
    """The arm, its joint controllers, and time that only goes on when it is told to."""

    def __init__(self, plan, urdf):
        self.joints = plan["joints"]
        self.dof = len(self.joints)
        held = {h["name"]: h["position"] for h in plan["held"]}
        self.model = mujoco.MjModel.from_xml_string(arm_model.mjcf(urdf, self.joints, held))
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = plan["knots"][0]["q"][: self.dof]
        mujoco.mj_forward(self.model, self.data)
        p, d = arm_model.gains(self.joints)
        self.p, self.d = np.array(p), np.array(d)
        self.wanted = self.data.qpos.copy()
        self.speed = np.zeros(self.dof)
        self.enabled = True
        self.endless = self.model.jnt_limited[: self.dof] == 0

    def step(self):
        effort = self.p * (self.wanted - self.data.qpos) + self.d * (self.speed - self.data.qvel)
        # The joints' viscous damping is known, so it is fed forward.
        effort += self.model.dof_damping * self.speed
        self.data.ctrl[:] = effort if self.enabled else 0.0
        mujoco.mj_step(self.model, self.data)

    def nearest(self, q):
        """Whole turns of a joint that turns without end are no way to go."""
        turns = np.round((self.data.qpos - q) / (2 * math.pi)) * self.endless
        return q + turns * 2 * math.pi

    def hold(self):
        self.wanted = self.data.qpos.copy()
        self.speed[:] = 0.0


def swept(plan, model, postures):
    """Which scanned points the pad passes over, as the planner counts it."""
    tool = plan["tool"]
    points = np.array([s["p"] for s in plan["surface"]])
    normals = np.array([s["n"] for s in plan["surface"]])
    data = mujoco.MjData(model)
    z = np.array(tool["approach"]) / np.linalg.norm(tool["approach"])
    y = np.array(tool["across"]) - z * np.dot(tool["across"], z)
    y /= np.linalg.norm(y)
    axes = np.stack([np.cross(y, z), y, z])
    tip = plan["joints"][0][0] + "_gripper_tool_frame"
    hit = np.zeros(len(points), bool)
    pads = []
    reach = 0.5 * math.hypot(tool["length"], tool["width"]) + tool["reach_normal"]
    for q in postures:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        body = data.body(tip)
        rotation = body.xmat.reshape(3, 3)
        centre = body.xpos + rotation @ np.array(tool["centre"])
        pads.append(centre)
        x, y, z = (rotation @ axis for axis in axes)
        offset = points - centre - z * tool["stand_off"]
        near = np.flatnonzero(np.einsum("ij,ij->i", offset, offset) <= reach * reach)
        o = offset[near]
        ok = (np.abs(o @ x) <= 0.5 * tool["width"]) & (np.abs(o @ y) <= 0.5 * tool["length"])
        ok &= np.abs(o @ z) <= tool["reach_normal"]
        ok &= -(normals[near] @ z) >= math.cos(tool["reach_angle"])
        hit[near[ok]] = True
    return hit, np.array(pads)


def faces(model, data):
    """The faces of all shapes of the arm where it stands: boxes, and cylinders as prisms."""
    for g in range(model.ngeom):
        size = model.geom_size[g]
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX:
            ring = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size[:2]
            height = size[2]
        else:
            turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
            ring = np.stack([np.cos(turn), np.sin(turn)], axis=1) * size[0]
            height = size[1]
        ends = [np.column_stack([ring, np.full(len(ring), z)]) for z in (-height, height)]
        sides = [np.array([ends[0][i - 1], ends[0][i], ends[1][i], ends[1][i - 1]])
                 for i in range(len(ring))]
        for face in ends + sides:
            yield data.geom_xpos[g] + face @ data.geom_xmat[g].reshape(3, 3).T


def picture(path, plan, simulation, hit, pads, rows):
    """The arm at the chair in the middle of its sweep, and how far it was from its setpoints."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = plt.figure(figsize=(14, 6.5))
    scene = figure.add_subplot(1, 2, 1, projection="3d", computed_zorder=False)
    points = np.array([s["p"] for s in plan["surface"]])
    scene.scatter(*points[~hit].T, s=2, c="#c0c4cc", label="scanned, not swept", zorder=1)
    scene.scatter(*points[hit].T, s=2, c="#2a8a4a", label="swept", zorder=2)
    moving = [r for r in rows if r[3]] or rows
    simulation.data.qpos[:] = moving[len(moving) // 2][1]
    mujoco.mj_kinematics(simulation.model, simulation.data)
    arm = list(faces(simulation.model, simulation.data))
    scene.add_collection3d(Poly3DCollection(arm, facecolor="#8fa3bf", edgecolor="#4a5a72",
                                            linewidth=0.2, alpha=0.9, zorder=3))
    scene.plot(*pads.T, lw=0.8, c="#d1350f", label="pad, measured", zorder=4)
    everything = np.vstack([points, *arm])
    scene.set(xlim=(everything[:, 0].min(), everything[:, 0].max()),
              ylim=(everything[:, 1].min(), everything[:, 1].max()),
              zlim=(everything[:, 2].min(), everything[:, 2].max()),
              xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    scene.set_box_aspect(np.ptp(everything, axis=0))
    scene.view_init(elev=28, azim=-125)
    scene.legend(loc="upper left", fontsize=8)
    chart = figure.add_subplot(1, 2, 2)
    times = np.array([r[0] for r in rows])
    errors = np.array([np.abs(r[1] - r[2]) for r in rows])
    for j, name in enumerate(plan["joints"]):
        chart.plot(times, errors[:, j], lw=0.7, label=name)
    chart.set(xlabel="time [s]", ylabel="tracking error [rad]")
    chart.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("plan", nargs="?",
                        help="stand where this plan begins, and measure what is swept of it")
    parser.add_argument("--check", action="store_true", help="end: the packages are all there")
    parser.add_argument("--robot-name", default="pr2")
    parser.add_argument("--ipc-root", help="iceoryx2's root path, if not the default")
    parser.add_argument("--urdf", default=HERE.parent.parent / "robot" / "pr2.urdf")
    parser.add_argument("--timeout", type=float, default=20.0,
                        help="stop by itself so long after the last deadline [ms]")
    parser.add_argument("--picture", help="where the picture is written, PNG")
    parser.add_argument("--json", help="where the figures are written")
    args = parser.parse_args()
    if args.check:
        return
    if args.plan is None:
        parser.error("a plan is needed")
    with open(args.plan) as file:
        plan = json.load(file)
    simulation = Simulation(plan, args.urdf)
    dof = simulation.dof

    ipc = nullsweep_ipc.Ipc(args.robot_name, args.ipc_root)
    setpoints = ipc.receiver("setpoint", types.Setpoint)
    states = ipc.sender("state", types.JointStates)
    done = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: done.append(True))
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))
    except PermissionError:
        pass
    print("mujoco endpoint: ready", flush=True)

    state = types.JointStates()
    state.joint_count, state.held_count = dof, len(plan["held"])
    for i, held in enumerate(plan["held"]):
        state.held_positions[i] = held["position"]
    waiting, rows = collections.deque(), []
    following = timed_out = disabled = running = False
    last_deadline = None
    began = clock = nullsweep_ipc.now_ns()
    refused = timeouts = 0
    while not done:
        now = nullsweep_ipc.now_ns()
        if now < clock + STEP_NS:
            time.sleep((clock + STEP_NS - now) * 1e-9)
        now = nullsweep_ipc.now_ns()
        waiting.extend(setpoints.all())
        # A process that stalls simulates what the arm did meanwhile.
        while clock + STEP_NS <= now:
            clock += STEP_NS
            while waiting and waiting[0].stamp_ns <= clock:
                s = waiting.popleft()
                values = list(s.positions[:dof]) + list(s.velocities[:dof])
                if s.joint_count != dof or not all(map(math.isfinite, values)):
                    refused += 1
                    continue
                last_deadline = s.deadline_ns
                disabled, running = s.disable != 0, s.plan.epoch != 0
                wanted = simulation.nearest(np.array(s.positions[:dof]))
                far = np.abs(wanted - simulation.data.qpos).max() > START_TOLERANCE
                if not disabled and not following and far:
                    # It begins to follow only what is where the arm is, and says that it waits.
                    refused += 1
                    timed_out = True
                    continue
                simulation.enabled = following = not disabled
                timed_out = False
                state.setpoint_sequence, state.setpoint_received_ns = s.sequence, clock
                if following:
                    simulation.wanted, simulation.speed = wanted, np.array(s.velocities[:dof])
                else:
                    simulation.hold()
            if following and clock > last_deadline + args.timeout * 1e6:
                simulation.hold()
                following, timed_out = False, True
                timeouts += 1
            simulation.step()
            if (clock - began) // STEP_NS % 5 == 0:
                rows.append(((clock - began) * 1e-9, simulation.data.qpos.copy(),
                             simulation.wanted.copy(), running))
        state.sequence += 1
        state.stamp_ns = clock
        state.positions[:dof] = simulation.data.qpos
        state.velocities[:dof] = simulation.data.qvel
        state.efforts[:dof] = simulation.data.ctrl
        state.status = (types.CALIBRATED | (types.HALTED if disabled else 0)
                        | (types.SETPOINT_TIMEOUT if timed_out else 0))
        states.send(state)

    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    # The pad moves by less than a third of its width in 20 ms.
    hit, pads = swept(plan, simulation.model, [r[1] for r in rows[::4]])
    reachable = np.array([s["r"] for s in plan["surface"]])
    error = np.array([np.abs(r[1] - r[2]).max() for r in rows if r[3]])
    tracking = None
    if len(error):
        p50, p95 = np.percentile(error, [50, 95])
        tracking = {"p50": p50, "p95": p95, "max": error.max()}
        print("tracking error [rad]:", ", ".join(f"{k} {v:.4f}" for k, v in tracking.items()))
    # The same shape as mock-hardware's verdict, which has a judge's findings as well.
    figures = {
        "seconds": (clock - began) * 1e-9,
        "tracking": tracking,
        "swept": {"all": hit.mean(), "reachable": hit[reachable].mean(), "points": len(hit)},
        "endpoint": {"timeouts": timeouts, "refused": refused, "states": state.sequence},
    }
    print(f"swept of reachable points: {100 * hit[reachable].mean():.1f} %")
    print(f"stopped by itself {timeouts} times, refused {refused} setpoints")
    if args.json:
        pathlib.Path(args.json).write_text(json.dumps(figures, indent=2))
    if args.picture:
        picture(args.picture, plan, simulation, hit, pads, rows)


if __name__ == "__main__":
    main()
