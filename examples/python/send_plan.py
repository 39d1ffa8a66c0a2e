"""Builds a small joint plan, a wave of one joint and back, and has the executor run it.

    python3 send_plan.py PLAN.json [--joint 5] [--angle 0.2] [--seconds 4]

Who the robot is (fingerprint, held joints) is read from a plan file of `planner plan`; where the
arm is, from the executor's telemetry.
"""

import argparse
import json
import math
import sys
import time

import nullsweep_ipc
import nullsweep_types as types


def wave(start, joint, angle, seconds, count=50):
    """Knots of a joint that swings out and back, at rest at both ends."""
    knots = []
    for k in range(count + 1):
        s = k / count
        knot = types.Knot()
        knot.time_from_start_ns = round(s * seconds * 1e9)
        knot.positions[: len(start)] = start
        # A raised cosine: its velocity is 0 at both ends.
        knot.positions[joint] += 0.5 * angle * (1 - math.cos(2 * math.pi * s))
        if 0 < k < count:
            knot.velocities[joint] = angle * math.pi / seconds * math.sin(2 * math.pi * s)
        knot.patch = types.NO_PATCH
        knot.contact = types.Contact.TRANSFER
        knots.append(knot)
    return knots


def wait_for(receive, wanted, seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for value in receive.all():
            if wanted(value):
                return value
        time.sleep(0.005)
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("plan", help="a plan file for this robot and arm")
    parser.add_argument("--robot-name", default="pr2")
    parser.add_argument("--ipc-root", help="iceoryx2's root path, if not the default")
    parser.add_argument("--joint", type=int, default=5, help="which joint, base to tip from 0")
    parser.add_argument("--angle", type=float, default=0.2, help="how far [rad]")
    parser.add_argument("--seconds", type=float, default=4.0)
    args = parser.parse_args()
    with open(args.plan) as file:
        robot = json.load(file)
    dof = len(robot["joints"])
    if not 0 <= args.joint < dof:
        parser.error(f"--joint must be 0 to {dof - 1}")

    ipc = nullsweep_ipc.Ipc(args.robot_name, args.ipc_root)
    telemetry = ipc.receiver("telemetry", types.Telemetry)
    now = wait_for(telemetry, lambda t: t.joint_count == dof, 3.0)
    if now is None:
        sys.exit("no telemetry came: is an executor running for this robot?")
    knots = wave(list(now.commanded[:dof]), args.joint, args.angle, args.seconds)

    header = types.PlanHeader()
    header.fingerprint = int(robot["fingerprint"], 16)
    header.joint_count = dof
    header.held_count = len(robot["held"])
    for i, held in enumerate(robot["held"]):
        header.held_positions[i] = held["position"]
    header.base_pose[6] = 1.0
    header.interpolation = types.Interpolation.CUBIC
    header.join_rule = types.JoinRule.STOP_THEN_START

    events = ipc.receiver("plan_event", types.PlanEvent)
    for _ in events.all():
        pass
    publisher = ipc.plan_publisher(len(knots))
    plan = publisher.publish(header, knots)
    if plan is None:
        sys.exit("no executor listens for plans")
    ends = (types.EventKind.REJECTED, types.EventKind.FINISHED, types.EventKind.SUPERSEDED,
            types.EventKind.ABORTED)

    def ours(event):
        if (event.plan.epoch, event.plan.number) != (plan.epoch, plan.number):
            return False
        reason = types.Reason(event.reason).text
        print(types.EventKind(event.kind).text, "" if reason == "none" else reason)
        return event.kind in ends

    end = wait_for(events, ours, args.seconds + 10.0)
    if end is None or end.kind != types.EventKind.FINISHED:
        sys.exit("the plan did not run to its end")


if __name__ == "__main__":
    main()
