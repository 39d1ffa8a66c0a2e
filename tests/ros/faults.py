"""What can go wrong in mid-sweep, one thing after another, each on a stage of its own: the arm
must come to rest without a jump, the bridge and the executor must say why, and once the cause is
gone and an operator has reset it, the arm must be held again.
"""

import json
import signal
import time

from stage import no_jump, tell

RESET = ["reset", "resume"]


def stall(stage, seconds):
    """The bridge gets no time for so long."""
    stage.bridge_process.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    stage.bridge_process.send_signal(signal.SIGCONT)


def perform(faults, new_stage, plan, options):
    """Plays all faults, each what is done, what the bridge says, what the executor says, how it is
    undone, if it can be, and the operator's orders then; whether the arm passed all of them."""
    found = []
    for number, (name, fault) in enumerate(faults.items()):
        stage = new_stage(number)
        try:
            found.append(play(stage, plan, name, fault, options))
        finally:
            stage.close()
    print(f"{sum(found)} of {len(found)} passed")
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
    # A master counts as lost after 2 s, halted motors are told within one.
    time.sleep(4.0)
    checks = [("the arm was sweeping", "executing" in moving, moving)]
    if bridge_says is not None:
        words = [line for line in stage.said("bridge").splitlines() if bridge_says in line]
        checks.append(("the bridge says it", bool(words), (words or ["nothing"])[0].split("  ")[-1]))
    status = stage.status() if stage.executor_process.poll() is None else ""
    if executor_says is not None:
        checks.append(("the executor says it", executor_says in status, status))
    if undo is not None:
        undo(stage)
        time.sleep(2.0)
        for order in orders:
            stage.run(stage.executor, "ctl", *stage.place, order)
        time.sleep(1.0)
        again = stage.status()
        checks.append(("the arm is held again", "holding, no plan runs" in again, again))
    if stage.arm.poll() is not None:
        # With it all that it saw is gone.
        return tell(checks)
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
