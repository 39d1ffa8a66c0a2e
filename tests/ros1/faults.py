"""What can go wrong in mid-sweep, one thing after another, each on a stage of its own: the arm
must come to rest without a jump, the bridge and the executor must say why, and once the cause is
gone and an operator has reset it, the arm must be held again.
"""

import json
import signal
import time

from stage import Stage, no_jump, tell

RESET = ["reset", "resume"]
# What is played; what the bridge says; what the executor says; how it is undone, if it can be, and
# the operator's orders then.
FAULTS = {
    "the master dies": (
        lambda s: s.master.kill(), "the ROS master is gone", "communication", None, []),
    "/joint_states ceases": (
        lambda s: s.play("mute"), "/joint_states is silent", "communication",
        lambda s: s.play("speak"), RESET),
    "joint states come 0.6 s late": (
        lambda s: s.play("old"), "its stamp is 0.6", "communication", lambda s: s.play("speak"), RESET),
    "the run stop is pressed": (
        lambda s: s.play("halt"), "the motors are halted", "fault",
        lambda s: s.play("run"), RESET),
    "the motors are halted by service": (
        lambda s: s.run(s.bridge, "halt"), "the motors are halted", "fault",
        lambda s: s.run(s.bridge, "reset"), RESET),
    "the controller no longer listens": (
        lambda s: s.play("deaf"), "controller does not listen", "fault", None, []),
    "the bridge stalls for 0.5 s": (
        lambda s: stall(s, 0.5), "would come too late", None, lambda s: None, RESET),
    "the bridge dies": (
        lambda s: s.bridge_process.kill(), None, "communication", None, []),
    "the executor dies": (
        lambda s: s.all[-1][1].kill(), "setpoints have ceased", None, None, []),
}


def stall(stage, seconds):
    stage.bridge_process.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    stage.bridge_process.send_signal(signal.SIGCONT)


def perform(bins, plan, folder, ipc, side, options):
    """Plays all faults; whether the arm passed all of them."""
    found = []
    for number, (name, fault) in enumerate(FAULTS.items()):
        stage = Stage(folder / f"fault-{number}", ipc / str(number), bins, side)
        try:
            found.append(play(stage, plan, name, fault, options))
        finally:
            stage.close()
    return all(found)


def play(stage, plan, name, fault, options):
    cause, bridge_says, executor_says, undo, orders = fault
    print(f"{name}:", flush=True)
    stage.start_robot(plan)
    stage.start_bridge(*options)
    stage.start_executor()
    stage.run(stage.planner, "publish", plan, *stage.place)
    time.sleep(3.0)
    moving = stage.status()
    cause(stage)
    # The master counts as lost after 2 s, halted motors are told within one.
    time.sleep(4.0)
    checks = [("the arm was sweeping", "executing" in moving, moving)]
    if bridge_says is not None:
        words = [line for line in stage.said("bridge").splitlines() if bridge_says in line]
        checks.append(("the bridge says it", bool(words), (words or ["nothing"])[0].split("  ")[-1]))
    status = stage.status() if "executor dies" not in name else ""
    if executor_says is not None:
        checks.append(("the executor says it", executor_says in status, status))
    if undo is not None:
        undo(stage)
        time.sleep(2.0)
        for order in orders:
            stage.run(stage.executor, "ctl", *stage.place, order)
        time.sleep(1.0)
        again = stage.status()
        checks.append(("the arm is held again", ": hold" in again, again))
    stage.end(stage.arm)
    data = json.load(open(stage.folder / "controller.json"))
    dof = len(data["joints"])
    last = [m for m in data["measured"] if m[0] > data["measured"][-1][0] - 0.5]
    way = max(abs(m[1 + j] - last[0][1 + j]) for m in last for j in range(dof))
    first = data["measured"][0]
    swept = max(abs(last[0][1 + j] - first[1 + j]) for j in range(dof))
    checks.append(("the arm stands", way < 1e-4 and swept > 0.01,
                   f"moves by {way:.6f} rad in its last 0.5 s, {swept:.2f} rad from its start"))
    return tell(checks + no_jump(data["seen"]))
